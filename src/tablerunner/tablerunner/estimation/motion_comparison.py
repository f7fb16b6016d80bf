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
_WORST = 1e-6
"""Product of both eigenvalues over the square of their sum, below which one direction is open."""
_CLEARLY = 0.5
"""Share of a length below which a plain fit is believed that Huber's would not reach it."""
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
    window: RangeWindow, span_s: float, heading_std: float = 0.0, least_m: float = 0.0
) -> Disagreement | None:
    """Return by how much UWB moved more than odometry, or None where the ranges do not tell.

    A plain fit goes first, and where it finds clearly less than `least_m` the answer is None too.

    Whichever anchor is left out, the others must tell it too: what is returned is the least
    certain of these answers. So an anchor that disappears behind a person is no motion.

    Parameters
    ----------
    window : RangeWindow
    span_s : float
        Time that the displacement is meant for [s].
    heading_std : float
        Deviation of odometry's heading in the map [rad].
    least_m : float
        Displacement that is worth telling [m].
    """
    counts = np.bincount(window.anchor, minlength=len(window.anchors))
    known = np.flatnonzero(counts >= _FEWEST_EACH)
    if len(known) < _FEWEST_ANCHORS:
        return None
    away = window.tags - window.anchors[window.anchor, :2]
    height = window.tag_height - window.anchors[window.anchor, 2]
    distances = np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2 + height**2)
    slopes = away * (window.times / (span_s * np.maximum(distances, 1e-6)))[:, None]
    residuals = window.ranges - distances
    if least_m > 0.0:
        plain = _fit(slopes, residuals, window.stds, window.anchor, 0.0, rounds=1)
        if plain is None or math.hypot(*plain[0]) < _CLEARLY * least_m:
            return None
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
    slopes: Matrix,
    residuals: Vector,
    stds: Vector,
    index: NDArray[np.int64],
    own: float,
    rounds: int = _ROUNDS,
) -> tuple[Vector, float] | None:
    """Return the displacement and its length in deviations; `own` is odometry's deviation [m]."""
    weights = 1.0 / (stds * stds)
    for left in range(rounds, 0, -1):
        total = np.maximum(np.bincount(index, weights), 1e-300)
        x, y, rest = (
            column - (np.bincount(index, weights * column) / total)[index]
            for column in (slopes[:, 0], slopes[:, 1], residuals)
        )
        along_x, along_y = weights * x, weights * y
        xx, xy, yy = float(along_x @ x), float(along_x @ y), float(along_y @ y)
        determinant = xx * yy - xy * xy
        if determinant <= _WORST * (xx + yy) ** 2:
            return None
        to_x, to_y = float(along_x @ rest), float(along_y @ rest)
        east = (yy * to_x - xy * to_y) / determinant
        north = (xx * to_y - xy * to_x) / determinant
        open_ = np.abs(rest - east * x - north * y)
        if left > 1:
            weights = np.minimum(1.0, _KNEE / np.maximum(open_ / stds, _KNEE)) / (stds * stds)
    # Ranges that scatter more than they say make the answer as much less certain.
    freedom = max(len(residuals) - int(np.count_nonzero(total > 1e-300)) - 2, 1)
    excess = max(float(weights @ (open_ * open_)) / freedom, 1.0) / determinant
    # The covariance: the inverse of the information, and odometry's own in every direction.
    var_x, cov, var_y = yy * excess + own * own, -xy * excess, xx * excess + own * own
    squared = var_y * east * east - 2.0 * cov * east * north + var_x * north * north
    deviations = math.sqrt(squared / (var_x * var_y - cov * cov))
    return np.array([east, north]), deviations
