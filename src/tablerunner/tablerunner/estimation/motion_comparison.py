"""Whether UWB and odometry saw the same motion over a short while (the idea of Sun 2.6).

Along the way that odometry tells, each anchor's ranges should differ from the distance to it by
the same amount throughout: a bias, a wrong pose and a wall in between shift them, but steadily.
If the tag moved by `e` more than odometry says, the residuals drift together:

    r_i = c_j(i) + (u_i . e) t_i / T + noise

with c_j a constant of anchor j, u_i the unit vector from the anchor to the tag, t_i the time and
T the window. Least squares with Huber's weights give e, the displacement by UWB less that by
odometry, without any of the estimator's beliefs but the heading of odometry in the map.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.types import Matrix, Vector

_FEWEST_EACH = 3
"""Ranges of an anchor from which its drift can be told from its constant."""
_FEWEST_ANCHORS = 3
"""With two, one blocked anchor could not be told from a motion."""
_KNEE = 1.5
_ROUNDS = 3
_ALONG = 0.8
"""Cosine of the angle to the way, beyond which a displacement lies along it: 37 degrees."""
_WHOLE_WAY = 1.3
"""Share of the way that a slip may seem to be, with the noise of ranges."""
_ODOMETRY_SHARE = 0.05
"""Deviation of odometry's displacement as a share of it: wheels of unknown size, sliding a bit."""


class RangeWindow(NamedTuple):
    """Ranges of a window beside the way that odometry tells; n ranges of m anchors."""

    times: Vector  # (n,) [s]
    tags: Matrix  # (n, 2) tag by odometry, in map [m]
    ranges: Vector  # (n,) [m]
    stds: Vector  # (n,) [m]
    anchor: NDArray[np.int64]  # (n,) which one
    anchors: Matrix  # (m, 3) in map [m]
    tag_height: float  # [m]


class Disagreement(NamedTuple):
    """Displacement by UWB less displacement by odometry over the window."""

    displacement: Vector  # (2,) in map [m]
    deviations: float  # its length in standard deviations
    by_odometry: Vector  # (2,) in map [m]

    @property
    def length_m(self) -> float:
        """How far apart the two are [m]."""
        return math.hypot(*self.displacement)

    @property
    def slipped_m(self) -> float:
        """How much less than odometry the robot moved, if turning wheels can explain it, else 0.

        Wheels that slip tell at most the whole way too much, along the way. That the robot moved
        farther or elsewhere they cannot explain: then it was carried, or UWB is at fault.
        """
        way = math.hypot(*self.by_odometry)
        back = -float(self.displacement @ self.by_odometry) / max(way, 1e-9)
        along = back > _ALONG * self.length_m and self.length_m < _WHOLE_WAY * way
        return min(back, way) if along else 0.0


def compare_motion(
    window: RangeWindow, span_s: float, heading_std: float = 0.0
) -> Disagreement | None:
    """Return by how much UWB moved more than odometry, or None where the ranges do not tell.

    Whichever anchor is left out, the others must tell it too: what is returned is the least
    certain of these answers. So an anchor that disappears behind a person is no motion.

    Parameters
    ----------
    window : RangeWindow
    span_s : float
        Time that the displacement is meant for [s].
    heading_std : float
        Deviation of odometry's heading in the map [rad].
    """
    counts = np.bincount(window.anchor, minlength=len(window.anchors))
    known = np.flatnonzero(counts >= _FEWEST_EACH)
    if len(known) < _FEWEST_ANCHORS:
        return None
    away = np.column_stack(
        [
            window.tags - window.anchors[window.anchor, :2],
            window.tag_height - window.anchors[window.anchor, 2],
        ]
    )
    distances = np.linalg.norm(away, axis=1)
    slopes = away[:, :2] / np.maximum(distances, 1e-6)[:, None] * (window.times / span_s)[:, None]
    residuals = window.ranges - distances
    way = window.tags[np.argmax(window.times)] - window.tags[np.argmin(window.times)]
    own = math.hypot(*way) * math.hypot(heading_std, _ODOMETRY_SHARE)

    worst = None
    for left_out in (-1, *known):
        rows = np.isin(window.anchor, known[known != left_out])
        found = _fit(slopes[rows], residuals[rows], window.stds[rows], window.anchor[rows], own)
        if found is None:
            return None
        if worst is None or found[1] < worst.deviations:
            worst = Disagreement(*found, way)
    return worst


def _fit(
    slopes: Matrix, residuals: Vector, stds: Vector, index: NDArray[np.int64], own: float
) -> tuple[Vector, float] | None:
    weights = 1.0 / stds**2
    found, spread = np.zeros(2), np.zeros((2, 2))
    for _ in range(_ROUNDS):
        slope, residual = _centred(slopes, weights, index), _centred(residuals, weights, index)
        information = slope.T @ (weights[:, None] * slope)
        if np.linalg.cond(information) > 1e6:
            return None
        spread = np.linalg.inv(information)
        found = spread @ (slope.T @ (weights * residual))
        scaled = np.abs(residual - slope @ found) / stds
        weights = np.minimum(1.0, _KNEE / np.maximum(scaled, _KNEE)) / stds**2
    # Ranges that scatter more than they say make the answer as much less certain.
    freedom = max(len(residuals) - len(np.unique(index)) - 2, 1)
    excess = max(float(np.sum(weights * (residual - slope @ found) ** 2)) / freedom, 1.0)
    spread = spread * excess + np.eye(2) * own**2
    return found, math.sqrt(float(found @ np.linalg.solve(spread, found)))


def _centred(values: NDArray[np.float64], weights: Vector, index: NDArray[np.int64]) -> Matrix:
    """Return the values less the weighted mean of those of the same anchor."""
    total = np.bincount(index, weights)
    columns = values if values.ndim == 2 else values[:, None]
    means = [
        np.bincount(index, weights * column) / np.maximum(total, 1e-300) for column in columns.T
    ]
    centred = columns - np.column_stack(means)[index]
    return np.asarray(centred if values.ndim == 2 else centred[:, 0])
