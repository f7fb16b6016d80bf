"""Sun's Kalman filter for each axis: odometry's displacement and UWB positions (Sun 18-24).

State: x, y, heading. The heading is odometry's and is never corrected; x and y are filtered each
for itself, so that the covariance of the position stays diagonal.

The paper leaves its noise input coefficients open. They are the distance driven here: an error of
odometry grows with the way, along it and across it, and a robot that stands gathers none.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation.estimator import (
    EstimatorConfig,
    Measurement,
    RangeByRange,
    Start,
    SunConfig,
    no_use,
)
from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import Point3
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import Anchor, Estimate, Innovation, PoseSample, Vector

STATE_NAMES = ('x', 'y', 'heading')


class Weighed(NamedTuple):
    """What positions do to places, each axis for itself, for any leading axes."""

    moved: Vector  # (..., 2), what is added to the place [m]
    variance: Vector  # (..., 2), afterwards [m^2]
    spread: Vector  # (..., 2), of the innovation [m^2]
    accepted: NDArray[np.bool_]  # (...)


def weigh(config: SunConfig, variance: Vector, innovation: Vector) -> Weighed:
    """Return the correction by positions (Sun 21, 22, 24).

    Parameters
    ----------
    config : SunConfig
    variance : ndarray, shape (..., 2)
        Of the places before [m^2].
    innovation : ndarray, shape (..., 2)
        Measured less expected [m].
    """
    noise = config.position_variance
    spread = variance + noise
    accepted = np.hypot(innovation[..., 0], innovation[..., 1]) <= config.largest_offset
    gain = np.where(accepted[..., None], variance / spread, 0.0)
    left = (1.0 - gain) ** 2 * variance + gain**2 * noise
    return Weighed(gain * innovation, left, spread, accepted)


class Kf(RangeByRange):
    """Kalman filter on odometry and positions."""

    name = 'kf'
    takes_positions = True
    state_names = STATE_NAMES

    def __init__(
        self,
        config: EstimatorConfig,
        anchors: tuple[Anchor, ...],  # noqa: ARG002 - all estimators are made alike
        lever_arm: Point3,  # noqa: ARG002
    ) -> None:
        self.config = config

    def start(self, start: Start) -> Estimate:
        """Return the first estimate: the given pose without its correlations."""
        return Estimate(
            start.stamp,
            np.array(start.pose, dtype=float),
            np.diag(np.diagonal(start.pose_covariance)),
        )

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion (Sun 20, 23)."""
        x, y, heading = estimate.mean.tolist()
        direction = heading + 0.5 * motion.turn_rad
        moved = np.array(
            [
                x + motion.distance_m * math.cos(direction),
                y + motion.distance_m * math.sin(direction),
                wrap(heading + motion.turn_rad),
            ]
        )
        _, turned = self.config.motion.variances(motion)
        grown = self.config.sun.process_variance * motion.distance_m**2
        return Estimate(stamp, moved, estimate.covariance + np.diag([grown, grown, turned]))

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a position (Sun 21, 22, 24), and what happened.

        The variance of a position is the filter's own (R of the paper), not the fix's; a heading
        that a pose may have is left alone. A position far from where odometry has the robot is
        not believed: Sun's check that UWB operates properly (section 2.6).
        """
        if not isinstance(measurement, PoseSample):
            return no_use(estimate, measurement, 'kf takes positions only')
        expected, _ = predict_position(estimate.mean, measurement.point)
        innovation = np.array([measurement.pose.x, measurement.pose.y]) - expected
        weighed = weigh(self.config.sun, np.diagonal(estimate.covariance)[:2], innovation)
        accepted = bool(weighed.accepted)
        after = estimate
        if accepted:
            mean = estimate.mean.copy()
            mean[:2] += weighed.moved
            covariance = np.diag([*weighed.variance, estimate.covariance[2, 2]])
            after = estimate._replace(stamp=measurement.stamp, mean=mean, covariance=covariance)
        return after, Innovation(
            measurement.stamp,
            measurement.source,
            '',
            accepted,
            '' if accepted else 'UWB and odometry disagree',
            innovation,
            np.diag(weighed.spread),
            float(np.sum(innovation**2 / weighed.spread)),
            math.inf,
        )
