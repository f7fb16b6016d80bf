"""Knots and pieces of a track, and how their errors are weighed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.geometry.pose import Pose2
from tablerunner.survey.track import (
    FLOOR_M,
    KNOT_TURN_RAD,
    KNOT_WAY_M,
    MOST_KNOTS,
    Pieces,
    Track,
    choose_knots,
    composed,
    laid_on,
    relative,
    rotated,
)
from tablerunner.types import OdometrySample

numbers = st.floats(-20.0, 20.0)
pose_rows = st.tuples(numbers, numbers, numbers)


def arc(steps: int, step_m: float, turn_rad: float) -> Track:
    heading = turn_rad * np.arange(steps + 1)
    middle = 0.5 * (heading[1:] + heading[:-1])
    place = np.cumsum(step_m * np.exp(1j * middle))
    place = np.concatenate([[0.0], place])
    stamps = (1 + np.arange(steps + 1)) * 20_000_000
    return Track(stamps, np.column_stack([place.real, place.imag, heading]))


@given(pose_rows, pose_rows)
def test_relative_undoes_composed_as_poses_do(one: tuple, two: tuple) -> None:
    origin, seen = np.array([one]), np.array([two])
    there = composed(origin, seen)
    np.testing.assert_allclose(relative(there, origin), seen, atol=1e-9)
    pose = Pose2(*one) @ Pose2(*two)
    np.testing.assert_allclose(there[0, :2], (pose.x, pose.y), atol=1e-9)


@given(st.floats(-3.0, 3.0), numbers, numbers)
def test_points_are_laid_on_moved_and_turned_ones(angle: float, x: float, y: float) -> None:
    here = np.array([[0.0, 0.0], [3.0, 1.0], [-1.0, 2.0]])
    there = rotated(here, np.full(3, angle)) + np.array([x, y])
    laid, (_, _, turn) = laid_on(here, there)
    np.testing.assert_allclose(laid, there, atol=1e-9)
    assert np.cos(turn - angle) == pytest.approx(1.0, abs=1e-9)


def test_pieces_are_as_long_as_promised_and_join_into_the_track() -> None:
    track = arc(1000, 0.01, 0.004)
    knots = choose_knots(track)
    pieces = Pieces.of(track, knots)
    assert (knots[0], knots[-1]) == (0, 1000)
    progress = pieces.way / KNOT_WAY_M + pieces.turned / KNOT_TURN_RAD
    # One step of the track more, at most.
    assert progress.max() <= 1.0 + 0.01 / KNOT_WAY_M + 0.004 / KNOT_TURN_RAD + 1e-9
    pose = np.zeros((1, 3))
    for motion in pieces.motions:
        pose = composed(pose, motion[None])
    np.testing.assert_allclose(pose[0], track.poses[-1], atol=1e-9)


def test_long_drives_have_no_more_knots() -> None:
    assert len(choose_knots(arc(20_000, 0.02, 0.0))) <= MOST_KNOTS + 2


def test_a_stamp_belongs_to_the_knot_that_is_nearest() -> None:
    pieces = Pieces.of(arc(100, 0.02, 0.0), np.array([0, 40, 100]))
    ns = np.array([1, 20, 22, 40, 70, 72, 101]) * 20_000_000
    assert pieces.nearest(ns).tolist() == [0, 0, 1, 1, 1, 2, 2]


def test_odometry_that_repeats_a_stamp_is_left_out() -> None:
    samples = [
        OdometrySample(s, Pose2(x, 0.0, 0.0), 0.0, 0.0)
        for s, x in ((1, 0.0), (2, 1.0), (2, 5.0), (3, 2.0))
    ]
    assert Track.of(samples).poses[:, 0].tolist() == [0.0, 1.0, 2.0]


def test_whitened_errors_of_drawn_pieces_are_independent_and_of_size_one() -> None:
    """Two thousand drives of a piece with noise in every step."""
    rng = np.random.default_rng(3)
    distance, per_way, count, steps = 0.02, 0.05, 2000, 50
    step = 0.5 / steps
    lengths = step + distance * np.sqrt(step) * rng.standard_normal((count, steps))
    turns = per_way * np.sqrt(step) * rng.standard_normal((count, steps))
    heading = np.cumsum(turns, axis=1)
    place = np.sum(lengths * np.exp(1j * (heading - 0.5 * turns)), axis=1)
    errors = np.column_stack([place.real - 0.5, place.imag, heading[:, -1]])
    pieces = Pieces(
        np.array([1, 2]),
        np.array([[0.5, 0.0, 0.0]]),
        np.array([0.5]),
        np.array([0.0]),
        np.array([1.0]),
    )
    white = np.concatenate(pieces.whiteners((distance, 0.0, per_way, 0.0)))
    found = np.cov((errors @ white.T).T)
    # Of 2000 draws: 3 sigma of a variance are 9.5 %; FLOOR_M takes off another hundredth.
    assert 0.1 * distance * np.sqrt(0.5) > FLOOR_M
    np.testing.assert_allclose(found, np.eye(3), atol=0.11)
