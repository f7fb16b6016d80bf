"""What dead reckoning reads wrong all the time: scale of way and turns, drift of the heading."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tablerunner.odometry import MotionNoise
from tablerunner.survey.drift import drift_priors, drift_times
from tablerunner.survey.track import Pieces, rotated

Array = NDArray[np.float64]

WAY_STD, TURN_STD, DRIFT_STD = 0.03, 0.03, 0.01
"""How wrong odometry is believed to be: share of the way, share of the turns, [rad/s]."""


def noise_of(noise: MotionNoise) -> tuple[float, float, float, float]:
    """Return the noise as `Pieces.whiteners` takes it."""
    return (
        noise.distance,
        noise.heading_per_turn,
        noise.heading_per_distance,
        noise.heading_per_time,
    )


@dataclass(frozen=True)
class OdometryMotions:
    """Motions between knots as odometry tells them; values: way, turns, drift and its steps."""

    pieces: Pieces
    noise: MotionNoise

    @property
    def count(self) -> int:
        """Number of values that stand for what is read wrong."""
        return 2 + int(self._times.shape[1])

    @cached_property
    def _times(self) -> Array:
        return drift_times(self.pieces)

    @property
    def priors(self) -> Array:
        """Standard deviations of those values, shape (count,)."""
        return np.concatenate([[WAY_STD, TURN_STD], drift_priors(self._times, DRIFT_STD)])

    def told(self, wrongs: Array) -> tuple[Array, Array]:
        """Return the motions, and their derivatives by way, turns and drift."""
        motions, way = self.pieces.motions, float(wrongs[0])
        rates = np.column_stack([motions[:, 2], self._times])
        more = rates @ wrongs[1:]
        turned = rotated(motions[:, :2], 0.5 * more)
        told = np.column_stack([(1.0 + way) * turned, motions[:, 2] + more])
        by = np.zeros((len(motions), 3, self.count))
        by[:, :2, 0] = turned
        by_turn = 0.5 * (1.0 + way) * np.column_stack([-turned[:, 1], turned[:, 0]])
        by[:, :2, 1:] = by_turn[:, :, None] * rates[:, None, :]
        by[:, 2, 1:] = rates
        return told, by

    def whiteners(self) -> tuple[Array, Array, Array]:
        """Return `Pieces.whiteners` of the motions."""
        return self.pieces.whiteners(noise_of(self.noise))

    def turns(self, wrongs: Array) -> None:
        """Return nothing: what the gyroscope said is in the odometry already."""
        del wrongs
