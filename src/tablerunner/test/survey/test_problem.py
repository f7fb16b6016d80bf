"""Every Jacobian against finite differences, at random places."""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.odometry import MotionNoise
from tablerunner.survey.odometry import OdometryMotions
from tablerunner.survey.problem import Layout, Links, Problem, TagRanges
from tablerunner.survey.track import Pieces
from tablerunner.survey.wheel_motion import (
    Sizes,
    WheelAngles,
    WheelMotions,
    derivatives,
    integrated,
)

SIZES = Sizes(0.061, 0.058, 0.33)


@pytest.fixture(params=range(5))
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    return np.random.default_rng(request.param)


def drawn_wheels(rng: np.random.Generator, gyro: bool) -> WheelAngles:
    steps = rng.normal(0.3, 0.2, (200, 2))
    angles = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    stamps = (1 + np.arange(201)) * 200_000_000
    turn = (angles[:, 1] - angles[:, 0]) * 0.06 / 0.34
    return WheelAngles(stamps, angles, turn if gyro else None)


def slope_of(function: object, at: np.ndarray, step: float = 1e-6) -> np.ndarray:
    columns = []
    for index in range(len(at)):
        off = np.zeros(len(at))
        off[index] = step
        columns.append((function(at + off) - function(at - off)) / (2.0 * step))
    return np.stack(columns, axis=-1)


def problem_of(rng: np.random.Generator, kind: str) -> tuple[Problem, np.ndarray]:
    wheels = drawn_wheels(rng, kind == 'gyro')
    knots = np.arange(0, 201, 20)
    if kind == 'odometry':
        pieces = Pieces.of(integrated(wheels, SIZES), knots)
        motions = OdometryMotions(pieces, MotionNoise())
    else:
        motions = WheelMotions.of(wheels, SIZES, knots, MotionNoise())
    layout = Layout(len(knots), 3, motions.count)
    ranges = TagRanges(
        rng.integers(0, len(knots), 30),
        rng.integers(0, 3, 30),
        rng.normal(0.0, 0.5, (30, 3)),
        rng.uniform(1.0, 9.0, 30),
        rng.uniform(0.05, 0.2, 30),
    )
    links = Links(np.array([0, 1]), np.array([1, 2]), np.array([4.0, 5.0]), np.array([0.1, 0.2]))
    at = int(layout.anchor(1))
    priors = [(at + 2, 2.0, 0.5), (at + 3, 0.0, 0.1)]
    values = rng.normal(0.0, 3.0, layout.size)
    values[layout.first_motion :] = rng.normal(0.0, 0.01, motions.count)
    return Problem(layout, ranges, motions, links, priors), values


@pytest.mark.parametrize('kind', ['odometry', 'wheels', 'gyro'])
def test_jacobian_is_that_of_the_residuals(rng: np.random.Generator, kind: str) -> None:
    problem, values = problem_of(rng, kind)
    rows = problem.rows(values)
    expected = slope_of(lambda at: problem.rows(at).residual, values)
    size = np.maximum(np.abs(expected).max(axis=1, keepdims=True), 1.0)
    # Central differences: the third derivative times 1e-12, and rounding of 1e-16 / 1e-6 of it.
    np.testing.assert_allclose(rows.jacobian.toarray() / size, expected / size, atol=2e-6)
    assert len(rows.group) == len(rows.residual) == rows.jacobian.shape[0]


def test_motions_change_with_the_sizes_as_said(rng: np.random.Generator) -> None:
    wheels, knots = drawn_wheels(rng, False), np.arange(0, 201, 25)

    def motions(shares: np.ndarray) -> np.ndarray:
        return Pieces.of(integrated(wheels, SIZES.scaled(shares)), knots).motions

    expected = slope_of(motions, np.zeros(3))
    np.testing.assert_allclose(derivatives(wheels, SIZES, knots), expected, atol=1e-6)


def test_a_true_trajectory_leaves_nothing(rng: np.random.Generator) -> None:
    """Range and motions of one trajectory, whose tag is off the middle, fit it to rounding."""
    wheels = drawn_wheels(rng, True)
    track, knots = integrated(wheels, SIZES), np.arange(0, 201, 20)
    motions = WheelMotions.of(wheels, SIZES, knots, MotionNoise())
    layout = Layout(len(knots), 1, motions.count)
    poses, anchor = track.poses[knots], np.array([3.0, -2.0, 2.0, 0.1, 0.01])
    tag = np.array([-0.1, 0.2, 1.0])
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    there = poses[:, :2] + np.column_stack(
        [cos * tag[0] - sin * tag[1], sin * tag[0] + cos * tag[1]]
    )
    flat = np.linalg.norm(there - anchor[:2], axis=1)
    ranges = TagRanges(
        np.arange(len(knots)),
        np.zeros(len(knots), dtype=int),
        np.broadcast_to(tag, (len(knots), 3)),
        1.01 * np.hypot(flat, anchor[2] - tag[2]) + 0.1,
        np.full(len(knots), 0.1),
    )
    values = np.concatenate([poses.ravel(), anchor, np.zeros(motions.count)])
    rows = Problem(layout, ranges, motions).rows(values)
    own = (rows.group != 5) & (rows.group != 0)  # the gyroscope of `drawn_wheels` has other sizes
    np.testing.assert_allclose(rows.residual[own], 0.0, atol=1e-9)
