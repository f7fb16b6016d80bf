"""A short piece of driving: arc length and turn, and how uncertain both are.

The robot is taken to drive an arc of constant curvature: with arc length ds and turn dtheta,
x' = x + ds cos(theta + dtheta/2), y' = y + ds sin(theta + dtheta/2), theta' = theta + dtheta
(Sun 5-10 with the signs of the errata). The chord is shorter than the arc by dtheta^2/24 of it:
below 1e-5 at 50 Hz.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2


@dataclass(frozen=True, slots=True)
class Motion:
    """Arc length [m], forward positive, and turn [rad], counter-clockwise, over dt [s].

    `told_variance` is what odometry itself says of the arc length [m^2]: more than usual where
    wheels slip.
    """

    distance_m: float
    turn_rad: float
    dt_s: float
    told_variance: float = 0.0


@dataclass(frozen=True)
class MotionNoise(Config):
    """How fast dead reckoning loses certainty. Variances add up over distance, turn and time."""

    distance: float = parameter(
        0.02,
        unit='m/sqrt(m)',
        description='Noise of the distance driven',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    heading_per_turn: float = parameter(
        0.02,
        unit='rad/sqrt(rad)',
        description='Noise of the heading from turning',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    heading_per_distance: float = parameter(
        0.005,
        unit='rad/sqrt(m)',
        description='Noise of the heading from driving',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    heading_per_time: float = parameter(
        0.001,
        unit='rad/sqrt(s)',
        description='Noise of the heading from time passing',
        low=0.0,
        high=1.0,
        dynamic=True,
    )

    def variances(self, motion: Motion) -> tuple[float, float]:
        """Return the variances of distance [m^2] and turn [rad^2] of one motion.

        Odometry's own word on the distance counts where it is worse, up to the whole distance.
        """
        length = abs(motion.distance_m)
        turn = abs(motion.turn_rad)
        distance = self.distance**2 * length
        told = motion.told_variance
        if told > distance:
            distance = max(distance, min(told, length * length))
        return (
            distance,
            self.heading_per_turn**2 * turn
            + self.heading_per_distance**2 * length
            + self.heading_per_time**2 * motion.dt_s,
        )


def advance(pose: Pose2, motion: Motion) -> Pose2:
    """Return the pose after a motion (Sun 5-9)."""
    direction = pose.heading + 0.5 * motion.turn_rad
    return Pose2(
        pose.x + motion.distance_m * math.cos(direction),
        pose.y + motion.distance_m * math.sin(direction),
        wrap(pose.heading + motion.turn_rad),
    )


def between_poses(start: Pose2, end: Pose2, dt_s: float) -> Motion:
    """Return the motion that `advance` takes to lead from `start` to `end`.

    A part of the way that lies across the mean heading cannot come from a differential drive; it
    is left out.
    """
    turn = wrap(end.heading - start.heading)
    direction = start.heading + 0.5 * turn
    distance = (end.x - start.x) * math.cos(direction) + (end.y - start.y) * math.sin(direction)
    return Motion(distance, turn, dt_s)
