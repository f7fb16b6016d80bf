"""Position and heading of a body that carries several tags, from one epoch of ranges.

Gauss-Newton on x, y and heading over all ranges at once; ranges with a large residual lose weight
by Huber's function, so that a blocked one hardly turns the body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.errors import CovarianceError, GeometryError
from tablerunner.geometry.angles import wrap
from tablerunner.uwb.epochs import Array
from tablerunner.uwb.fix import FixState
from tablerunner.uwb.solvers.registry import solve

UNKNOWNS = 3
HUBER = 1.5
"""Residuals beyond this many standard deviations lose weight."""

_ROUNDS = 25
_SETTLED = 1e-7
_STEEPEST_TURN = 0.5  # [rad] largest step of the heading
_WORST_CONDITION = 1e10


@dataclass(frozen=True)
class BodyFix:
    """Poses of m epochs.

    Attributes
    ----------
    position : ndarray, shape (m, 2)
        Origin of the body in map [m]; NaN where an epoch has no answer.
    heading : ndarray, shape (m,)
        [rad].
    covariance : ndarray, shape (m, 3, 3)
        Of x, y, heading, from the deviations of the ranges.
    used : ndarray of int, shape (m,)
        Ranges that went in.
    state : ndarray of int8, shape (m,)
        `FixState`.
    """

    position: Array
    heading: Array
    covariance: Array
    used: NDArray[np.int64]
    state: NDArray[np.int8]

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Which epochs have a pose, shape (m,)."""
        return np.asarray(self.state == FixState.SOLVED)


def solve_rigid_body(
    anchors: ArrayLike, tags: ArrayLike, ranges: ArrayLike, std: float, height: float
) -> BodyFix:
    """Return the poses of a body that moves in the plane.

    Parameters
    ----------
    anchors : array_like, shape (n, 3)
        In map [m].
    tags : array_like, shape (k, 3)
        In the body's frame [m]; at least two.
    ranges : array_like, shape (m, n, k)
        Slant ranges [m], NaN where missing.
    std : float
        Standard deviation of a range [m].
    height : float
        Of the body's origin over the floor [m].

    Raises
    ------
    GeometryError
        Shapes that do not fit, fewer than two tags, tags on one spot.
    CovarianceError
        `std` is not positive.
    """
    places, body = np.asarray(anchors, dtype=float), np.asarray(tags, dtype=float)
    measured = np.asarray(ranges, dtype=float)
    if body.ndim != 2 or body.shape[1] != 3 or len(body) < 2:
        raise GeometryError(f'tags have shape {body.shape}; (k, 3) with k of at least 2 is needed')
    if np.ptp(body[:, :2], axis=0).max() < 1e-3:
        raise GeometryError('the tags are all on one spot, seen from above: no heading follows')
    if measured.ndim != 3 or measured.shape[1:] != (len(places), len(body)):
        raise GeometryError(
            f'ranges have shape {measured.shape}, (m, {len(places)}, {len(body)}) is needed'
        )
    if not std > 0.0:
        raise CovarianceError(f'the standard deviation of a range is {std}')
    with np.errstate(invalid='ignore'):
        there = np.isfinite(measured) & (measured > 0.0)
    pose = _begin(places, body, measured, std, height)
    begun = np.isfinite(pose).all(axis=1)
    pose[~begun] = 0.0
    for _ in range(_ROUNDS):
        normal, gradient = _normal(places, body, measured, there, std, height, pose)
        solvable = begun & (np.linalg.cond(normal) < _WORST_CONDITION)
        step = np.zeros_like(pose)
        step[solvable] = np.linalg.solve(normal[solvable], gradient[solvable][..., None])[..., 0]
        step[:, 2] = np.clip(step[:, 2], -_STEEPEST_TURN, _STEEPEST_TURN)
        pose += step
        if np.abs(step).max(initial=0.0) < _SETTLED:
            break
    normal, _ = _normal(places, body, measured, there, std, height, pose)
    state = np.full(len(pose), FixState.SOLVED, dtype=np.int8)
    state[~(begun & (np.linalg.cond(normal) < _WORST_CONDITION))] = FixState.AMBIGUOUS
    state[there.sum(axis=(1, 2)) < UNKNOWNS] = FixState.TOO_FEW
    solved = state == FixState.SOLVED
    covariance = np.full((len(pose), 3, 3), np.nan)
    covariance[solved] = np.linalg.inv(normal[solved])
    pose[~solved] = np.nan
    return BodyFix(
        pose[:, :2],
        np.asarray(wrap(pose[:, 2])),
        covariance,
        np.asarray(there.sum(axis=(1, 2))),
        state,
    )


def _begin(places: Array, body: Array, measured: Array, std: float, height: float) -> Array:
    """Return first poses, shape (m, 3): each tag on its own, then the body laid over them."""
    found = np.stack(
        [
            solve('nonlinear', places, measured[:, :, j], std, height + tag[2]).position
            for j, tag in enumerate(body)
        ],
        axis=1,
    )
    # Two tags are enough: the others of an epoch may be missing.
    sound = np.asarray(np.isfinite(found).all(axis=2))
    weight = sound[..., None].astype(float)
    count = np.maximum(weight.sum(axis=1), 1.0)
    filled = np.where(sound[..., None], found, 0.0)
    middle, of_body = filled.sum(axis=1) / count, (weight * body[:, :2]).sum(axis=1) / count
    here = (filled - middle[:, None]) * weight
    there = (body[None, :, :2] - of_body[:, None]) * weight
    cos = np.sum(here * there, axis=(1, 2))
    sin = np.sum(there[..., 0] * here[..., 1] - there[..., 1] * here[..., 0], axis=1)
    heading = np.arctan2(sin, cos)
    turned = np.stack(
        [
            np.cos(heading) * of_body[:, 0] - np.sin(heading) * of_body[:, 1],
            np.sin(heading) * of_body[:, 0] + np.cos(heading) * of_body[:, 1],
        ],
        axis=1,
    )
    pose = np.column_stack([middle - turned, heading])
    pose[sound.sum(axis=1) < 2] = np.nan
    return pose


def _normal(
    places: Array,
    body: Array,
    measured: Array,
    there: NDArray[np.bool_],
    std: float,
    height: float,
    pose: Array,
) -> tuple[Array, Array]:
    """Return the weighted normal matrices, (m, 3, 3), and right-hand sides, (m, 3)."""
    cos, sin = np.cos(pose[:, 2, None]), np.sin(pose[:, 2, None])
    arm_x = cos * body[:, 0] - sin * body[:, 1]  # (m, k)
    arm_y = sin * body[:, 0] + cos * body[:, 1]
    dx = (pose[:, 0, None] + arm_x)[:, None] - places[:, 0, None]  # (m, n, k)
    dy = (pose[:, 1, None] + arm_y)[:, None] - places[:, 1, None]
    dz = height + body[:, 2] - places[:, 2, None]
    distance = np.maximum(np.sqrt(dx**2 + dy**2 + dz**2), 1e-9)
    residual = np.where(there, measured - distance, 0.0)
    ux, uy = dx / distance, dy / distance
    jacobian = np.stack([ux, uy, uy * arm_x[:, None] - ux * arm_y[:, None]], axis=-1)
    size = np.abs(residual) / std
    weight = there * np.minimum(1.0, HUBER / np.maximum(size, 1e-12)) / std**2
    flat = jacobian.reshape(len(pose), -1, 3)
    weighted = flat * weight.reshape(len(pose), -1, 1)
    return (
        np.asarray(np.swapaxes(weighted, 1, 2) @ flat),
        np.asarray(np.einsum('mij,mi->mj', weighted, residual.reshape(len(pose), -1))),
    )
