"""What every solver takes: checked ranges of many epochs to the same anchors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablerunner.errors import CovarianceError, GeometryError

Array = NDArray[np.float64]

LONGEST_RANGE_M = 10_000.0
"""No UWB radio reaches further: a longer range is not used."""

_SHORTFALL_SIGMAS = 5.0  # how far noise may push a range under the height it has to bridge


@dataclass(frozen=True)
class Epochs:
    """Ranges of m epochs to n anchors; make them with `Epochs.of`, which checks.

    Attributes
    ----------
    anchors : ndarray, shape (n, 3)
        Anchors in map [m].
    ranges : ndarray, shape (m, n)
        Slant ranges [m]; NaN where there is none that can be used.
    std : ndarray, shape (m, n)
        Standard deviation of each range [m].
    tag_height : float
        Height of the tag over the floor [m].
    nlos : ndarray, shape (m, n)
        Probability that a range is not line of sight; NaN where it is not known.
    """

    anchors: Array
    ranges: Array
    std: Array
    tag_height: float
    nlos: Array

    @classmethod
    def of(
        cls,
        anchors: ArrayLike,
        ranges: ArrayLike,
        std: ArrayLike,
        tag_height: float,
        nlos: ArrayLike = float('nan'),
    ) -> Epochs:
        """Return checked epochs.

        Parameters
        ----------
        anchors : array_like, shape (n, 3)
            Anchors in map [m].
        ranges : array_like, shape (m, n), or (n,) for one epoch
            Slant ranges [m]. NaN is a missing range; one that no radio can have measured (zero,
            negative, infinite, beyond `LONGEST_RANGE_M`) is not used either.
        std : array_like, broadcast to (m, n)
            Standard deviation of each range [m].
        tag_height : float
            Height of the tag over the floor [m].
        nlos : array_like, broadcast to (m, n)
            Probability that a range is not line of sight; only some solvers look at it.

        Raises
        ------
        GeometryError
            The shapes do not fit, or an anchor or the height is not finite.
        CovarianceError
            A used range has a standard deviation that is not positive and finite.
        """
        places = np.asarray(anchors, dtype=np.float64)
        if places.ndim != 2 or places.shape[1] != 3:
            raise GeometryError(f'anchors have shape {places.shape}, (n, 3) is needed')
        if not np.all(np.isfinite(places)):
            raise GeometryError('an anchor has a coordinate that is not finite')
        if not np.isfinite(tag_height):
            raise GeometryError(f'the height of the tag is {tag_height}')
        measured = np.atleast_2d(np.asarray(ranges, dtype=np.float64))
        if measured.ndim != 2 or measured.shape[1] != len(places):
            raise GeometryError(
                f'ranges have shape {measured.shape}, (m, {len(places)}) is needed'
            )
        with np.errstate(invalid='ignore'):
            usable = (measured > 0.0) & (measured <= LONGEST_RANGE_M)
        try:
            deviation = np.broadcast_to(np.asarray(std, dtype=np.float64), measured.shape)
            blocked = np.broadcast_to(np.asarray(nlos, dtype=np.float64), measured.shape)
        except ValueError as error:
            raise GeometryError(f'std or nlos do not fit ranges: {error}') from error
        if np.any(usable & ~((deviation > 0.0) & np.isfinite(deviation))):
            raise CovarianceError('a range has a standard deviation that is not positive')
        cleaned = measured if usable.all() else np.where(usable, measured, np.nan)
        return cls(places, cleaned, deviation, float(tag_height), blocked)

    def __len__(self) -> int:
        return len(self.ranges)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Which ranges there are, shape (m, n)."""
        return np.asarray(np.isfinite(self.ranges))

    @property
    def height(self) -> Array:
        """Height of each anchor over the tag [m], shape (n,)."""
        return self.anchors[:, 2] - self.tag_height

    def plane_ranges(self) -> Array:
        """Return the ranges carried down to the tag's plane [m], shape (m, n).

        A range that is shorter than the height it has to bridge becomes 0, the tag under the
        anchor, while noise can explain it (5 standard deviations); beyond that it becomes NaN.
        """
        square = self.ranges**2 - self.height**2
        with np.errstate(invalid='ignore'):
            noise = self.ranges + _SHORTFALL_SIGMAS * self.std >= np.abs(self.height)
            return np.asarray(np.where(noise, np.sqrt(np.maximum(square, 0.0)), np.nan))

    def some(self, rows: slice | NDArray[np.bool_] | NDArray[np.int64]) -> Epochs:
        """Return only these epochs."""
        return Epochs(
            self.anchors, self.ranges[rows], self.std[rows], self.tag_height, self.nlos[rows]
        )

    def masked(self, keep: NDArray[np.bool_]) -> Epochs:
        """Return the epochs with only those ranges that `keep`, shape (m, n), marks."""
        return Epochs(
            self.anchors,
            np.where(keep, self.ranges, np.nan),
            self.std,
            self.tag_height,
            self.nlos,
        )


def flatness(anchors: Array, used: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return how close to one line the anchors of each epoch stand, seen from above.

    Parameters
    ----------
    anchors : ndarray, shape (n, 3)
    used : ndarray of bool, shape (m, n)

    Returns
    -------
    ratio : ndarray, shape (m,)
        Spread across over spread along the line that fits best: 0 in one line, 1 for a square.
    centre : ndarray, shape (m, 2)
        Mean of the anchors [m].
    direction : ndarray, shape (m, 2)
        Unit vector of that line.
    """
    weight = used.astype(np.float64)
    count = np.maximum(weight.sum(axis=1), 1.0)
    # About the mean of all, so that maps far from their origin lose no digits.
    origin = anchors[:, :2].mean(axis=0) if len(anchors) else np.zeros(2)
    plan = anchors[:, :2] - origin
    x, y = plan[:, 0], plan[:, 1]
    mean_x, mean_y = weight @ x / count, weight @ y / count
    dx, dy = x - mean_x[:, None], y - mean_y[:, None]
    a = np.sum(weight * dx * dx, axis=1)
    b = np.sum(weight * dx * dy, axis=1)
    d = np.sum(weight * dy * dy, axis=1)
    half = 0.5 * (a + d)
    root = np.hypot(0.5 * (a - d), b)
    large = half + root
    with np.errstate(invalid='ignore', divide='ignore'):
        # The product of both is the determinant: no digits lost to half - root.
        ratio = np.sqrt(np.maximum(a * d - b * b, 0.0)) / large
    angle = 0.5 * np.arctan2(2.0 * b, a - d)
    # All on one spot is in one line, too: spreads of less than a millimetre are none.
    ratio = np.where(large > count * 1e-6, ratio, 0.0)
    return (
        ratio,
        np.stack([mean_x, mean_y], axis=1) + origin,
        np.stack([np.cos(angle), np.sin(angle)], axis=1),
    )
