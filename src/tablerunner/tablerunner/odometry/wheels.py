"""Drive wheels: from encoder angles to distances, with jumps and wraps told apart from driving."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.odometry.motion import Motion
from tablerunner.stream import Order, StampOrder
from tablerunner.types import Refusal, WheelSample, seconds

SOURCE = 'joint_states'


@dataclass(frozen=True)
class WheelsConfig(Config):
    """Geometry of the drive and what its encoders may plausibly say."""

    wheel_radius: float = parameter(
        0.06, unit='m', description='Radius of both drive wheels', above=0.0, high=1.0
    )
    track: float = parameter(
        0.34,
        unit='m',
        description='Distance between the contact points of the drive wheels',
        above=0.0,
        high=5.0,
    )
    max_wheel_speed: float = parameter(
        50.0,
        unit='rad/s',
        description='Wheel speed above which an encoder step counts as a jump',
        above=0.0,
        high=1000.0,
    )
    max_gap: float = parameter(
        1.0,
        unit='s',
        description='Longest silence of the encoders that is bridged',
        above=0.0,
        high=60.0,
    )


class Wheels:
    """Turns encoder angles into motions.

    A step too large for the wheels is refused. If the next sample fits what came before the
    jump, it was one bad sample and no distance is lost; if it fits the jumped values, the
    encoders were reset and counting goes on from there.
    """

    def __init__(self, config: WheelsConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget the last angles, as after a jump back in time."""
        self._order = StampOrder()
        self._base: WheelSample | None = None
        self._suspect: WheelSample | None = None

    def add(self, sample: WheelSample) -> Motion | Refusal | None:
        """Return the motion since the last good sample; None for the first one.

        Refused are a zero stamp, angles that are not finite, a stamp that does not advance, a
        silence longer than `max_gap` (counting starts again) and a jump. A stream that began again
        from an earlier time starts from its own first sample.
        """
        order = self._order.judge(sample.stamp)
        if order is Order.RESTARTED:
            self._base = self._suspect = None
        elif order is not Order.NEWEST:
            return self._refuse(sample, order.value)
        if not (math.isfinite(sample.left_angle_rad) and math.isfinite(sample.right_angle_rad)):
            return self._refuse(sample, 'wheel angle not finite')
        base = self._base
        if base is None:
            self._base = sample
            return None
        if seconds(sample.stamp - base.stamp) > self.config.max_gap:
            self._base, self._suspect = sample, None
            return self._refuse(sample, 'encoders were silent')
        motion = self._motion(base, sample)
        if motion is None and self._suspect is not None:
            base = self._suspect
            motion = self._motion(base, sample)
        if motion is None:
            self._suspect = sample
            return self._refuse(sample, 'encoder jump')
        self._base, self._suspect = sample, None
        return motion

    def _motion(self, start: WheelSample, end: WheelSample) -> Motion | None:
        config = self.config
        dt = seconds(end.stamp - start.stamp)
        left = end.left_angle_rad - start.left_angle_rad
        right = end.right_angle_rad - start.right_angle_rad
        if max(abs(left), abs(right)) > config.max_wheel_speed * dt:
            return None
        radius = config.wheel_radius
        # Sun (2), and (4) with its sign turned: counter-clockwise positive.
        return Motion(0.5 * radius * (left + right), radius * (right - left) / config.track, dt)

    @staticmethod
    def _refuse(sample: WheelSample, reason: str) -> Refusal:
        return Refusal(sample.stamp, SOURCE, '', reason)
