"""Line-of-sight ranges only; with two of them, the others choose the side (Liu, figure 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, Epochs
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.solvers.circle_pair import blur, meet
from tablerunner.uwb.solvers.judge import judge
from tablerunner.uwb.solvers.nonlinear import solve_nonlinear
from tablerunner.uwb.solvers.sides import weigh_sides
from tablerunner.uwb.solvers.sigma_points import propagate

NLOS_ABOVE = 0.5
"""Probability from which a range counts as blocked."""

NLOS_SCALE_M = 1.0
"""Mean length by which a blocked range is too long."""


def solve_two_anchor(epochs: Epochs) -> PositionFix:
    """Return positions from unblocked ranges alone.

    Three or more are solved by nonlinear least squares. Two leave the two points where their
    circles meet; the blocked ranges choose between these and do nothing else. Fewer than two, or
    two without any other range, are no position. A range whose probability of being blocked is
    not known counts as clear.

    Parameters
    ----------
    epochs : Epochs
        `nlos` tells which ranges are blocked.
    """
    with np.errstate(invalid='ignore'):
        clear = epochs.usable & ~(epochs.nlos > NLOS_ABOVE)
        possible = np.isfinite(epochs.plane_ranges())
    count = clear.sum(axis=1)
    full = solve_nonlinear(epochs.masked(clear))
    place, covariance = full.position, full.covariance
    state = np.where(count < 2, FixState.TOO_FEW, full.state).astype(np.int8)
    two = (count == 2) & ~(clear & ~possible).any(axis=1)
    state[(count == 2) & ~two] = FixState.NO_MEETING
    if two.any():
        few = epochs.some(two)
        place[two], covariance[two], state[two] = _two_ranges(few, clear[two])
    return judge(epochs, place, covariance, clear, state)


def _two_ranges(epochs: Epochs, clear: NDArray[np.bool_]) -> tuple[Array, Array, NDArray[np.int8]]:
    """Return position, covariance and state of epochs with two clear ranges each."""
    blocked = epochs.usable & ~clear
    # A stable sort of "not clear" puts both clear ranges first, in order.
    pairs = np.argsort(~clear, axis=1, kind='stable')[:, :2]
    first, second = meet(epochs, epochs.ranges, pairs)
    costs = np.stack([_disbelief(epochs, point, blocked) for point in (first, second)])
    left = costs[0] <= costs[1]

    def chosen(ranges: Array) -> Array:
        # The side is settled: only the ranges that made the place move it.
        points = meet(epochs, ranges, pairs)
        return np.where(left[:, None], points[0], points[1])

    covariance = propagate(chosen, epochs.ranges, epochs.std, clear)
    covariance += blur(epochs, epochs.ranges, pairs)
    sides = weigh_sides(np.stack([first.T, second.T]), costs, np.ones(len(epochs), dtype=np.int64))
    state = np.full(len(epochs), FixState.SOLVED, dtype=np.int8)
    state[sides.open(covariance)] = FixState.AMBIGUOUS
    state[~np.isfinite(first).all(axis=1)] = FixState.NO_MEETING
    return sides.place.T, covariance + sides.spread, state


def _disbelief(epochs: Epochs, point: Array, blocked: NDArray[np.bool_]) -> Array:
    """Return minus twice the log likelihood of the blocked ranges at the points, shape (m,).

    A blocked range is too long by an exponentially distributed length; too short it is only by
    noise, so that a range shorter than the distance speaks clearly against a place.
    """
    offset = point[:, None, :] - epochs.anchors[None, :, :2]
    distance = np.sqrt(np.sum(offset**2, axis=-1) + epochs.height**2)
    late = epochs.ranges - distance
    cost = np.where(late > 0.0, 2.0 * late / NLOS_SCALE_M, (late / epochs.std) ** 2)
    return np.asarray(np.where(blocked, cost, 0.0).sum(axis=1))
