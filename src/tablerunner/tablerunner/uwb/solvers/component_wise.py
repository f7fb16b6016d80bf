"""Component-wise correction for anchors mounted on the robot (Bae 9-15).

Anchors half a metre apart see a tag metres away nearly from one point: the distance is good, the
direction bad. Four steps, each with its own position: T by linear least squares, T_C without the
bias of the direction, T_R with the length put right, T_F smoothed from epoch to epoch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tablerunner.errors import GeometryError
from tablerunner.uwb.epochs import Array, Epochs
from tablerunner.uwb.fix import FixState
from tablerunner.uwb.solvers.circle_pair import plane_of
from tablerunner.uwb.solvers.linear import solve_linear
from tablerunner.uwb.solvers.sigma_points import propagate

_NEAREST_M = 1e-6  # a tag closer to the robot's centre has no direction


@dataclass(frozen=True)
class ComponentFix:
    """The stages of the correction for m epochs, in the robot's frame.

    Attributes
    ----------
    raw, calibrated, radial, filtered : ndarray, shape (m, 2)
        T, T_C, T_R and T_F [m]; NaN where an epoch has no answer.
    distance : ndarray, shape (m,)
        The tag's distance as least squares see it (the paper's r) [m].
    covariance : ndarray, shape (m, 2, 2)
        Of `filtered` [m^2]: noise of the ranges, and the lag behind a tag that moves.
    state : ndarray of int8, shape (m,)
        `FixState`.
    """

    raw: Array
    calibrated: Array
    radial: Array
    filtered: Array
    distance: Array
    covariance: Array
    state: np.ndarray


def calibrate_bias(truth: ArrayLike, mean_estimate: ArrayLike) -> Array:
    """Return the normalised bias of the direction (Bae 10).

    The mean over calibration points of (mean estimate - truth) / |mean estimate|. (The paper
    prints truth - estimate, but subtracts the result in 11.)

    Parameters
    ----------
    truth, mean_estimate : array_like, shape (k, 2)
        True places of the calibration points and the means of `linear` positions there, in the
        robot's frame, origin amid the anchors [m].

    Returns
    -------
    ndarray, shape (2,)
        Metres of error per metre of distance.

    Raises
    ------
    GeometryError
        No points, shapes that differ, or an estimate at the origin.
    """
    true, found = np.asarray(truth, dtype=float), np.asarray(mean_estimate, dtype=float)
    if true.shape != found.shape or true.ndim != 2 or true.shape[1] != 2 or not len(true):
        raise GeometryError(f'{true.shape} true and {found.shape} estimated points do not match')
    distance = np.linalg.norm(found, axis=1)
    if not np.all(np.isfinite(true)) or not np.all(distance > _NEAREST_M):
        raise GeometryError('a calibration point is not finite or lies at the origin')
    return np.asarray(np.mean((found - true) / distance[:, None], axis=0))


class ComponentCorrector:
    """Positions of a tag about a robot that carries the anchors, epoch after epoch.

    Parameters
    ----------
    bias : array_like, shape (2,)
        From `calibrate_bias`.
    tag_step : float
        How far the tag may move from one epoch to the next [m]; only widens the covariance.
    """

    def __init__(self, bias: ArrayLike = (0.0, 0.0), tag_step: float = 0.1) -> None:
        self._bias = np.asarray(bias, dtype=float)
        if self._bias.shape != (2,) or not np.all(np.isfinite(self._bias)):
            raise GeometryError(f'the bias is {bias!r}, two finite numbers are needed')
        self._tag_step = tag_step
        self.reset()

    def reset(self) -> None:
        """Forget the tag."""
        self._last: Array | None = None
        self._noise = np.zeros((2, 2))
        self._lag = 0.0

    def add(self, epochs: Epochs) -> ComponentFix:
        """Return the corrected positions of the next epochs, one or many.

        Epochs in the robot's frame: anchors about the origin, the tag at its own height. An epoch
        without an answer leaves the filter as it is.
        """
        fix = solve_linear(epochs)
        distance = _distance(epochs, epochs.ranges, fix.position)
        calibrated = fix.position - self._bias * distance[:, None]

        def stretched(moved: Array) -> Array:
            again = solve_linear(
                Epochs(epochs.anchors, moved, epochs.std, epochs.tag_height, epochs.nlos)
            ).position
            length = _distance(epochs, moved, again)
            return _stretch(again - self._bias * length[:, None], length)

        radial = _stretch(calibrated, distance)
        noise = propagate(stretched, epochs.ranges, epochs.std, fix.used_mask)
        filtered = np.full_like(radial, np.nan)
        covariance = np.full_like(noise, np.nan)
        for k in np.flatnonzero(np.isfinite(radial).all(axis=1) & fix.solved):
            row = epochs.some(slice(int(k), int(k) + 1))
            filtered[k] = self._smooth(row, radial[k], float(distance[k]), noise[k])
            covariance[k] = self._noise + self._lag**2 * np.eye(2)
        state = np.where(
            fix.solved & np.isnan(filtered).any(axis=1), FixState.NO_MEETING, fix.state
        ).astype(np.int8)
        return ComponentFix(
            fix.position, calibrated, radial, filtered, distance, covariance, state
        )

    def _smooth(self, row: Epochs, radial: Array, distance: float, noise: Array) -> Array:
        last = self._last
        before = 0.0 if last is None else float(np.hypot(last[0], last[1]))
        if last is None or before < _NEAREST_M:
            self._last, self._noise, self._lag = radial, noise, 0.0
            return radial
        ratio = distance / before
        candidate = ratio * last + (1.0 - ratio) * radial  # (13), over the previous radius
        alpha, beta = _misfit(row, radial), _misfit(row, candidate)
        # (14-15): each is weighted with the residual of the other.
        share = alpha / (alpha + beta) if alpha + beta > 0.0 else 0.5
        gain = share * ratio  # how much of the last position the new one holds
        place = share * candidate + (1.0 - share) * radial
        self._noise = (1.0 - gain) ** 2 * noise + gain**2 * self._noise
        self._lag = gain * (self._lag + self._tag_step)
        self._last = np.asarray(place)
        return self._last


def _distance(epochs: Epochs, ranges: Array, place: Array) -> Array:
    """Return the root of the third unknown of (3), the squared distance from the origin, (m,)."""
    plane = np.where(np.isfinite(epochs.plane_ranges()), plane_of(ranges, epochs.height), np.nan)
    anchors = epochs.anchors[:, :2]
    square = 2.0 * place @ anchors.T - np.sum(anchors**2, axis=1) + plane**2
    there = np.isfinite(square)
    mean = np.where(there, square, 0.0).sum(axis=1) / np.maximum(there.sum(axis=1), 1)
    return np.where(there.any(axis=1) & (mean > 0.0), np.sqrt(np.maximum(mean, 0.0)), np.nan)


def _stretch(place: Array, distance: Array) -> Array:
    """Return the places at the given distance from the origin (12), shape (m, 2)."""
    length = np.hypot(place[:, 0], place[:, 1])
    with np.errstate(invalid='ignore', divide='ignore'):
        return np.asarray(
            place * np.where(length > _NEAREST_M, distance / length, np.nan)[:, None]
        )


def _misfit(row: Epochs, place: Array) -> float:
    """Return the mean size of the residuals at a place [m] (15)."""
    plane = row.plane_ranges()[0]
    predicted = np.hypot(place[0] - row.anchors[:, 0], place[1] - row.anchors[:, 1])
    return float(np.nanmean(np.abs(predicted - plane)))
