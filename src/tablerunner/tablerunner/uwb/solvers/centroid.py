"""Triangle centroid and twice triangle centroid (Lv 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, Epochs
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.solvers.admit import admit_other_side, at_least_the_bound
from tablerunner.uwb.solvers.circle_pair import intersect, plane_of, touching
from tablerunner.uwb.solvers.judge import judge
from tablerunner.uwb.solvers.linear import MINIMUM_RANGES
from tablerunner.uwb.solvers.sigma_points import propagate
from tablerunner.uwb.solvers.triples import Triple, choose_triples, triples_by_area


def solve_centroid(epochs: Epochs) -> PositionFix:
    """Return the centroid of the triangle that three circles cut out of each other.

    With more than three ranges, those three whose anchors span the widest triangle are taken.
    """
    triples = triples_by_area(epochs.anchors)
    usable = np.isfinite(epochs.plane_ranges())
    chosen, found = choose_triples(triples, usable)
    used = np.zeros(usable.shape, dtype=bool)
    rows = np.arange(len(epochs))[:, None]
    used[rows[found], chosen[found]] = True
    return _solve(epochs, triples, used, usable)


def solve_twice_centroid(epochs: Epochs) -> PositionFix:
    """Return the mean of the triangle centroids of all triples of ranges.

    The paper draws a new triangle from the four centroids of four anchors and takes its centroid,
    without saying which three; the mean of all four matches its table. Triples whose circles do
    not meet are left out.
    """
    usable = np.isfinite(epochs.plane_ranges())
    return _solve(epochs, triples_by_area(epochs.anchors), usable, usable)


def triangle_centroid(epochs: Epochs, ranges: Array, triple: Triple) -> Array:
    """Return the triangle centroids of one triple of anchors, shape (m, 2).

    Of the two points where a pair of circles meets, the one counts that fits the third circle
    better. NaN where a range is missing or circles miss each other by more than noise explains.

    Parameters
    ----------
    epochs : Epochs
        For anchors and standard deviations.
    ranges : ndarray, shape (m, n)
        Slant ranges, which may be others than the epochs' [m].
    """
    plane = plane_of(ranges, epochs.height)
    total = np.zeros((len(ranges), 2))
    for turn in range(3):
        a, b, third = (triple[(turn + k) % 3] for k in range(3))
        pair = intersect(epochs.anchors[a, :2], epochs.anchors[b, :2], plane[:, a], plane[:, b])
        misfit = [
            np.abs(np.linalg.norm(point - epochs.anchors[third, :2], axis=1) - plane[:, third])
            for point in (pair.first, pair.second)
        ]
        corner = np.where((misfit[0] <= misfit[1])[:, None], pair.first, pair.second)
        total += corner * touching(pair.gap, epochs.std[:, a], epochs.std[:, b])[:, None]
    return total / 3.0


def _solve(
    epochs: Epochs,
    triples: tuple[Triple, ...],
    wanted: NDArray[np.bool_],
    usable: NDArray[np.bool_],
) -> PositionFix:
    ranges = np.where(wanted, epochs.ranges, np.nan)
    place, used = _mean_centroid(epochs, ranges, triples)
    covariance = propagate(
        lambda moved: _mean_centroid(epochs, moved, triples)[0], ranges, epochs.std, used
    )
    state = np.full(len(epochs), FixState.SOLVED, dtype=np.int8)
    state[np.isnan(place).any(axis=1)] = FixState.NO_MEETING
    _, found = choose_triples(triples, usable)
    state[~found] = FixState.IN_LINE
    state[usable.sum(axis=1) < MINIMUM_RANGES] = FixState.TOO_FEW
    covariance = at_least_the_bound(epochs, place, covariance, used)
    covariance, state = admit_other_side(epochs, place, covariance, state)
    return judge(epochs, place, covariance, used, state)


def _mean_centroid(
    epochs: Epochs, ranges: Array, triples: tuple[Triple, ...]
) -> tuple[Array, NDArray[np.bool_]]:
    total, count = np.zeros((len(ranges), 2)), np.zeros(len(ranges))
    used = np.zeros(ranges.shape, dtype=bool)
    for triple in triples:
        centroid = triangle_centroid(epochs, ranges, triple)
        sound = np.isfinite(centroid).all(axis=1)
        total[sound] += centroid[sound]
        count += sound
        for j in triple:
            used[:, j] |= sound
    with np.errstate(invalid='ignore', divide='ignore'):
        return total / np.where(count > 0, count, np.nan)[:, None], used
