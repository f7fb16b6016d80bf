"""Drive wheels: from angles or speeds of the wheels to motions; jumps and wraps are told apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.odometry.motion import Motion
from tablerunner.stream import Order, StampOrder
from tablerunner.types import Refusal, WheelSample, seconds

SOURCE = 'joint_states'
FEEDBACKS = ('auto', 'position', 'velocity')

_STUCK_RAD = 2.0
_TURNING_RAD_S = 0.5


@dataclass(frozen=True)
class WheelsConfig(Config):
    """Geometry of the drive and what its encoders may plausibly say."""

    wheel_radius: float = parameter(
        0.06, unit='m', description='Radius of the drive wheels', above=0.0, high=1.0
    )
    track: float = parameter(
        0.34,
        unit='m',
        description='Distance between the contact points of the drive wheels',
        above=0.0,
        high=5.0,
    )
    left_radius_multiplier: float = parameter(
        1.0,
        description='Radius of the left wheels over wheel_radius, as diff_drive_controller has it',
        low=0.5,
        high=2.0,
    )
    right_radius_multiplier: float = parameter(
        1.0, description='The same of the right wheels', low=0.5, high=2.0
    )
    left_reversed: bool = parameter(
        False, description='Whether the left joints count backwards when the robot drives forwards'
    )
    right_reversed: bool = parameter(False, description='The same of the right joints')
    feedback: str = parameter(
        'auto',
        description=(
            'What of the joints is used: position, velocity, or auto: velocity as long as no '
            'position has come'
        ),
        choices=FEEDBACKS,
    )
    wrap: float = parameter(
        0.0,
        unit='rad',
        description='Range after which the angles begin again, as 2 pi; 0: they go on for ever',
        low=0.0,
        high=1e9,
    )
    still_speed: float = parameter(
        0.01,
        unit='rad/s',
        description='Speeds below this are those of wheels that stand; for feedback by velocity',
        low=0.0,
        high=1.0,
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

    @property
    def radii_m(self) -> tuple[float, float]:
        """Radii of left and right wheels [m], negative where joints count backwards."""
        left = self.wheel_radius * self.left_radius_multiplier
        right = self.wheel_radius * self.right_radius_multiplier
        return -left if self.left_reversed else left, -right if self.right_reversed else right


class Wheels:
    """Turns encoder angles, or speeds where there are no angles, into motions.

    A step too large for the wheels is refused. If the next sample fits what came before the
    jump, it was one bad sample and no distance is lost; if it fits the jumped values, the
    encoders were reset and counting goes on from there. Angles that begin again after `wrap` are
    followed in the direction that is nearer, or that the speeds tell where there was time for
    more than half of a range; without speeds that is refused. Speeds are joined by straight lines.
    """

    def __init__(self, config: WheelsConfig) -> None:
        self.config = config
        self.reset()

    def reset(self) -> None:
        """Forget the last angles, as after a jump back in time."""
        self._order = StampOrder()
        self._base: WheelSample | None = None
        self._suspect: WheelSample | None = None
        self._has_angles = False
        self._stuck_rad = 0.0

    def add(self, sample: WheelSample) -> Motion | Refusal | None:
        """Return the motion since the last good sample; None for the first one.

        Refused are a zero stamp, angles or speeds that are not finite, a stamp that does not
        advance, a silence longer than `max_gap` (counting starts again), a jump, a silence in
        which angles may have wrapped more than once, and angles that stand while the speeds do
        not. A stream that began again from an earlier time starts from its own first sample.
        """
        order = self._order.judge(sample.stamp)
        if order is Order.RESTARTED:
            self._base = self._suspect = None
        elif order is not Order.NEWEST:
            return self._refuse(sample, order.value)
        fault = self._fault(sample)
        if fault:
            return self._refuse(sample, fault)
        base = self._base
        if base is None:
            self._base = sample
            return None
        if seconds(sample.stamp - base.stamp) > self.config.max_gap:
            self._base, self._suspect = sample, None
            return self._refuse(sample, 'encoders were silent')
        if not (self._has_angles and _finite(base.angles_rad)):
            self._base = sample
            # Angles that follow on speeds only: one step more by the speeds, if there are any.
            return self._by_speeds(base, sample)
        return self._by_angles(base, sample)

    def _fault(self, sample: WheelSample) -> str:
        """Return why a sample cannot be used; note whether it is one of angles."""
        feedback = self.config.feedback
        if feedback != 'velocity' and _finite(sample.angles_rad):
            self._has_angles = True
            return ''
        if feedback == 'position' or self._has_angles:
            return 'wheel angle not finite'
        if not _finite(sample.speeds_rad_s):
            return 'wheel speed not finite' if feedback == 'velocity' else 'wheel angle not finite'
        if max(map(abs, sample.speeds_rad_s)) > self.config.max_wheel_speed:
            return 'wheel speed beyond max_wheel_speed'
        return ''

    def _by_speeds(self, start: WheelSample, end: WheelSample) -> Motion | None:
        if not (_finite(start.speeds_rad_s) and _finite(end.speeds_rad_s)):
            return None
        dt, still = seconds(end.stamp - start.stamp), self.config.still_speed
        steps = [
            0.5
            * dt
            * ((first if abs(first) > still else 0.0) + (last if abs(last) > still else 0))
            for first, last in zip(start.speeds_rad_s, end.speeds_rad_s, strict=True)
        ]
        return self._motion(steps, dt)

    def _by_angles(self, base: WheelSample, sample: WheelSample) -> Motion | Refusal:
        steps = self._steps(base, sample)
        if steps is None:
            self._base, self._suspect = sample, None
            return self._refuse(sample, 'angles may have wrapped more than once')
        if not self._plausible(steps, base, sample) and self._suspect is not None:
            base = self._suspect
            steps = self._steps(base, sample)
        if steps is None or not self._plausible(steps, base, sample):
            self._suspect = sample
            return self._refuse(sample, 'encoder jump')
        self._base, self._suspect = sample, None
        dt = seconds(sample.stamp - base.stamp)
        if self._is_stuck(steps, sample, dt):
            return self._refuse(sample, 'angles stand while speeds do not: feedback by velocity?')
        return self._motion(steps, dt)

    def _steps(self, start: WheelSample, end: WheelSample) -> list[float] | None:
        """Return how far each wheel turned [rad]; None where that cannot be told."""
        wrap = self.config.wrap
        steps = [b - a for a, b in zip(start.angles_rad, end.angles_rad, strict=True)]
        if not wrap:
            return steps
        dt = seconds(end.stamp - start.stamp)
        expected = [0.0] * len(steps)
        if 2.0 * self.config.max_wheel_speed * dt >= wrap:
            if not (_finite(start.speeds_rad_s) and _finite(end.speeds_rad_s)):
                return None
            both = zip(start.speeds_rad_s, end.speeds_rad_s, strict=True)
            expected = [0.5 * dt * (a + b) for a, b in both]
        return [
            guess + math.remainder(step - guess, wrap)
            for step, guess in zip(steps, expected, strict=True)
        ]

    def _plausible(self, steps: list[float], start: WheelSample, end: WheelSample) -> bool:
        most = self.config.max_wheel_speed * seconds(end.stamp - start.stamp)
        return max(map(abs, steps)) <= most

    def _is_stuck(self, steps: list[float], sample: WheelSample, dt_s: float) -> bool:
        """Return whether the speeds tell of turns that no angle shows, for long."""
        fastest = max(map(abs, sample.speeds_rad_s))  # NaN compares as false
        if any(steps) or not fastest > _TURNING_RAD_S:
            self._stuck_rad = 0.0
        else:
            self._stuck_rad += fastest * dt_s
        return self._stuck_rad > _STUCK_RAD

    def _motion(self, steps: list[float], dt_s: float) -> Motion:
        left_radius, right_radius = self.config.radii_m
        pairs = len(steps) // 2
        left = left_radius * sum(steps[0::2]) / pairs
        right = right_radius * sum(steps[1::2]) / pairs
        # Sun (2), and (4) with its sign turned: counter-clockwise positive.
        return Motion(0.5 * (left + right), (right - left) / self.config.track, dt_s)

    @staticmethod
    def _refuse(sample: WheelSample, reason: str) -> Refusal:
        return Refusal(sample.stamp, SOURCE, '', reason)


def _finite(numbers: tuple[float, ...]) -> bool:
    return all(map(math.isfinite, numbers))
