"""What encoders and gyroscope say of the motion, and how that hangs on radii and track.

With angles a, b of the left and the right wheel since the start, radii r, s and the track B
(docs/survey.md):

    heading    H = (s b - r a) / B                                                      (3)
    way        dC = (r da + s db) / 2 e^(iH), with H in the middle of the step            (4)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tablerunner.odometry import MotionNoise
from tablerunner.survey.drift import drift_priors, drift_times
from tablerunner.survey.odometry import noise_of
from tablerunner.survey.track import FLOOR_RAD, Indices, Pieces, Track

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

SIZE_STD = 0.2
"""By which share radii and track are believed to be off."""

GYRO_SCALE_STD, GYRO_DRIFT_STD = 0.01, 0.02
"""By which share a gyroscope is believed to err, and by how much when it stands [rad/s]."""


@dataclass(frozen=True)
class Sizes:
    """Of a differential drive [m]."""

    left_radius_m: float
    right_radius_m: float
    track_m: float

    @property
    def values(self) -> Array:
        """The three of them."""
        return np.array([self.left_radius_m, self.right_radius_m, self.track_m])

    def scaled(self, shares: Array) -> Sizes:
        """Return sizes larger by shares of themselves."""
        left, right, track = self.values * (1.0 + shares)
        return Sizes(float(left), float(right), float(track))


@dataclass(frozen=True)
class WheelAngles:
    """Encoders, and the gyroscope at the same times.

    Attributes
    ----------
    stamps : ndarray of int64, shape (n,)
        Strictly increasing [ns].
    angles : ndarray, shape (n, 2)
        Of left and right wheel [rad].
    gyro : ndarray, shape (n,), or None
        Integral of the yaw rate as measured [rad]; None without a gyroscope.
    """

    stamps: Stamps
    angles: Array
    gyro: Array | None = None


def integrated(wheels: WheelAngles, sizes: Sizes) -> Track:
    """Return the track that the wheels alone tell, from the origin."""
    rims = (wheels.angles - wheels.angles[0]) * sizes.values[:2]
    heading = (rims[:, 1] - rims[:, 0]) / sizes.track_m
    steps = 0.5 * np.diff(rims.sum(axis=1))
    turned = steps * np.exp(0.5j * (heading[1:] + heading[:-1]))
    place = np.concatenate([[0.0], np.cumsum(turned)])
    return Track(wheels.stamps, np.column_stack([place.real, place.imag, heading]))


def derivatives(wheels: WheelAngles, sizes: Sizes, knots: Indices) -> Array:
    """Return the derivatives of the motions between knots by the shares of left, right, track.

    Returns
    -------
    ndarray, shape (k - 1, 3, 3)
        Of x, y, turn (rows) by each share (columns).
    """
    rims = (wheels.angles - wheels.angles[0]) * sizes.values[:2]
    heading = (rims[:, 1] - rims[:, 0]) / sizes.track_m
    by_heading = np.column_stack([-rims[:, 0], rims[:, 1], rims[:, 0] - rims[:, 1]])
    by_heading /= sizes.track_m
    steps = 0.5 * np.diff(rims.sum(axis=1))
    by_step = np.column_stack([0.5 * np.diff(rims, axis=0), np.zeros(len(steps))])
    spin = np.exp(0.5j * (heading[1:] + heading[:-1]))[:, None]
    middle = 0.5 * (by_heading[1:] + by_heading[:-1])
    zero = np.zeros((1, 3), dtype=complex)
    by_place = np.cumsum((by_step + 1j * steps[:, None] * middle) * spin, axis=0)
    by_place = np.concatenate([zero, by_place])[knots]
    place = np.concatenate([zero[:, 0], np.cumsum(steps * spin[:, 0])])[knots]
    back = np.exp(-1j * heading[knots[:-1]])
    motion = np.diff(place) * back
    by_motion = np.diff(by_place, axis=0) * back[:, None]
    by_motion -= 1j * by_heading[knots[:-1]] * motion[:, None]
    by_turn = np.diff(by_heading[knots], axis=0)
    return np.stack([by_motion.real, by_motion.imag, by_turn], axis=1)


@dataclass(frozen=True)
class WheelMotions:
    """Motions by wheels of about these sizes; values: shares of left, right, track, then gyro.

    Of the gyroscope: its scale, its drift, and the steps of that [rad/s].
    """

    wheels: WheelAngles
    pieces: Pieces
    knots: Indices
    slopes: Array
    noise: MotionNoise

    @classmethod
    def of(
        cls, wheels: WheelAngles, sizes: Sizes, knots: Indices, noise: MotionNoise
    ) -> WheelMotions:
        """Return the motions of wheels, straight lines about the sizes."""
        pieces = Pieces.of(integrated(wheels, sizes), knots)
        return cls(wheels, pieces, knots, derivatives(wheels, sizes, knots), noise)

    @property
    def count(self) -> int:
        """Number of values that stand for what is read wrong."""
        return 3 if self.wheels.gyro is None else 4 + int(self._times.shape[1])

    @cached_property
    def _times(self) -> Array:
        return drift_times(self.pieces)

    @property
    def priors(self) -> Array:
        """Standard deviations of those values, shape (count,)."""
        drift = drift_priors(self._times, GYRO_DRIFT_STD)
        return np.concatenate([[SIZE_STD] * 3, [GYRO_SCALE_STD], drift])[: self.count]

    def told(self, wrongs: Array) -> tuple[Array, Array]:
        """Return the motions, and their derivatives."""
        by = np.zeros((len(self.slopes), 3, self.count))
        by[:, :, :3] = self.slopes
        return self.pieces.motions + by @ wrongs, by

    def whiteners(self) -> tuple[Array, Array, Array]:
        """Return `Pieces.whiteners` of the motions."""
        return self.pieces.whiteners(noise_of(self.noise))

    def turns(self, wrongs: Array) -> tuple[Array, Array, Array] | None:
        """Return the turns by the gyroscope, their derivatives, and their deviations."""
        if self.wheels.gyro is None:
            return None
        raw = np.diff(self.wheels.gyro[self.knots])
        by = np.zeros((len(raw), self.count))
        by[:, 3], by[:, 4:] = -raw, -self._times
        variance = self.noise.heading_per_time**2 * self.pieces.time + FLOOR_RAD**2
        return raw + by @ wrongs, by, np.sqrt(variance)
