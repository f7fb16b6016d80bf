"""Lv's reactive controller: towards the target, round what the ultrasonic sensors hear.

One step turns five readings, a pose and a target into a velocity by two rule bases, for the corner
(tables I to III) and for the speed (table IV). It plans nothing and remembers nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.control.fuzzy.base_file import load_base
from tablerunner.control.fuzzy.models import corner_model
from tablerunner.control.fuzzy.readings import SENSORS, Readings
from tablerunner.control.fuzzy.rule_base import RuleBase
from tablerunner.control.fuzzy.trace import Trace
from tablerunner.control.limits import VelocityLimits
from tablerunner.errors import ConfigError
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

CORNER_INPUTS = ('left_front', 'front', 'right_front', 'side_difference', 'target_angle')
SPEED_INPUTS = ('left_front', 'front', 'right_front', 'target_distance')

_HALF_TURN = math.pi  # k of (13): 180 degrees


@dataclass(frozen=True)
class ReactiveConfig(Config):
    """How Lv's controller drives."""

    steering: str = parameter(
        'rules',
        description='What decides where to turn: the rule base or the model (10)',
        choices=('rules', 'model'),
        dynamic=True,
    )
    turn_time: float = parameter(
        1.0,
        description='Time in which the angle that was decided on is turned',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    min_speed: float = parameter(
        0.1, description='Least speed of the range of (15)', unit='m/s', low=0.0, dynamic=True
    )
    target_gain: float = parameter(
        0.8, description='Speed over distance to the target, k_g (11)', unit='1/s', above=0.0
    )
    obstacle_gain: float = parameter(
        0.6, description='Speed over distance to an obstacle, k_ob (11)', unit='1/s', low=0.0
    )
    creep_speed: float = parameter(
        0.08, description='Speed right at an obstacle, v_0 (11)', unit='m/s', low=0.0
    )
    target_intensity: float = parameter(
        1.0, description='Turn towards the target of the model, lambda_g (10)', low=0.0
    )
    obstacle_intensity: float = parameter(
        2.0, description='Turn away from an obstacle of the model, lambda_ob (10)', low=0.0
    )
    side_offset: float = parameter(0.05, description='e_0 of the model (10)', unit='m', above=0.0)
    side_clearance: float = parameter(
        0.4,
        description='What is nearer to a side or slanting sensor than this is steered away from',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    side_turn: float = parameter(
        0.8,
        description='Turn away from something that touches a side or slanting sensor',
        unit='rad',
        low=0.0,
        high=math.pi / 2.0,
        dynamic=True,
    )
    reach: float = parameter(
        3.0, description='Distance that counts where nothing echoed', unit='m', above=0.0
    )
    closing_speed: float = parameter(
        0.6,
        description='How much nearer a reading counts for each second of its age',
        unit='m/s',
        low=0.0,
        dynamic=True,
    )
    stale_after: float = parameter(
        0.5,
        description='A reading older than this counts as an obstacle right before the sensor',
        unit='s',
        above=0.0,
        dynamic=True,
    )


@dataclass(frozen=True, slots=True)
class ReactiveStep:
    """One decision.

    Attributes
    ----------
    velocity : Velocity
        Within the limits of speed and turn rate.
    turn_rad : float
        Angle to turn by (13), to the left positive.
    speed_m_s : float
        Speed by (15) and (11), before the turn slows it.
    target_angle_rad : float
        phi of (7).
    target_distance_m : float
    distances_m : tuple of float
        The five readings as they were used, aged.
    stale : tuple of str
        Sensors whose readings were too old to use; the robot then creeps.
    traces : tuple of Trace
        Of the corner and the speed, where asked for.
    """

    velocity: Velocity
    turn_rad: float
    speed_m_s: float
    target_angle_rad: float
    target_distance_m: float
    distances_m: tuple[float, ...]
    stale: tuple[str, ...] = ()
    traces: tuple[Trace, ...] = ()


class ReactiveController:
    """Decides afresh in each step; the same inputs give the same velocity.

    Parameters
    ----------
    config : ReactiveConfig
    limits : VelocityLimits
        `max_speed` is also v_max of (11) and (15). Accelerations are the caller's to limit, by
        `VelocityLimits.approach`.
    corner, speed : RuleBase, optional
        ``lv_corner`` and ``lv_speed`` by default.

    Raises
    ------
    ConfigError
        A rule base has other inputs than those that are measured, or min_speed is above the limit.
    """

    def __init__(
        self,
        config: ReactiveConfig,
        limits: VelocityLimits,
        corner: RuleBase | None = None,
        speed: RuleBase | None = None,
    ) -> None:
        if config.min_speed > limits.max_speed:
            raise ConfigError('min_speed', config.min_speed, 'at most max_speed of the limits')
        self.config = config
        self.limits = limits
        self.corner = require_inputs(corner or load_base('lv_corner'), CORNER_INPUTS)
        self.speed = require_inputs(speed or load_base('lv_speed'), SPEED_INPUTS)

    def step(
        self, readings: Readings, pose: Pose2, target: tuple[float, float], traced: bool = False
    ) -> ReactiveStep:
        """Return what to do now.

        Parameters
        ----------
        readings : Readings
        pose : Pose2
            base_link in map.
        target : tuple of float
            x, y in map [m].
        traced : bool
            Whether to tell which rules fired.

        Raises
        ------
        ValueError
            Pose or target is not finite.
        """
        if not (pose.is_finite and math.isfinite(target[0]) and math.isfinite(target[1])):
            raise ValueError('pose and target must be finite')
        config = self.config
        east, north = target[0] - pose.x, target[1] - pose.y
        away = math.hypot(east, north)
        angle = difference(math.atan2(north, east), pose.heading) if away > 0.0 else 0.0
        used = readings.aged(config.closing_speed, config.reach, config.stale_after)
        ahead = used[1], used[2], used[3]
        corner = *ahead, used[1] - used[3], math.degrees(angle)
        speed = *ahead, away
        turn = self._beside(self._turn(corner, angle), used)
        stale = readings.stale(config.stale_after)
        forward = self._speed(speed)
        if stale:
            forward = min(forward, config.creep_speed)
        traces: tuple[Trace, ...] = ()
        if traced:
            traces = (
                self.corner.trace(dict(zip(CORNER_INPUTS, corner, strict=True))),
                self.speed.trace(dict(zip(SPEED_INPUTS, speed, strict=True))),
            )
        return ReactiveStep(
            self.limits.clamp(self._drive(turn, forward)),
            turn,
            forward,
            angle,
            away,
            tuple(used),
            stale,
            traces,
        )

    def _turn(self, values: tuple[float, ...], angle: float) -> float:
        """Return the angle to turn by (13), or by the model (10) within half a turn."""
        if self.config.steering == 'rules':
            return _HALF_TURN * self.corner.infer_one(*values)
        config = self.config
        nearness = max(1.0 - min(values[:3]) / config.reach, 0.0)
        intensity = config.obstacle_intensity * nearness
        model = corner_model(
            angle, values[3], config.target_intensity, intensity, config.side_offset
        )
        return min(max(float(model), -_HALF_TURN), _HALF_TURN)

    def _beside(self, turn: float, used: list[float]) -> float:
        """Return a turn that does not drive the robot into what is beside it.

        The tables look ahead only, and go straight on past what the right front sensor hears
        (situation II), however near it comes. A turn of less than a right angle, in which the
        robot rolls, shrinks with the room on its side and is bent away from the nearer side; on
        the spot a round robot can turn wherever it stands.
        """
        if abs(turn) >= math.pi / 2.0:
            return turn
        clearance = self.config.side_clearance
        left = max(1.0 - min(used[0], used[1]) / clearance, 0.0)
        right = max(1.0 - min(used[3], used[4]) / clearance, 0.0)
        turn *= 1.0 - (left if turn > 0.0 else right)
        return turn + self.config.side_turn * (right - left)

    def _speed(self, values: tuple[float, ...]) -> float:
        """Return the speed by (15), at most that of the model (11).

        The table does not slow down below `min_speed`, however near the target is; the model does.
        """
        config, top = self.config, self.limits.max_speed
        share = self.speed.infer_one(*values)
        by_rules = (top + config.min_speed) / 2.0 + (top - config.min_speed) * (share - 0.5)
        return min(
            by_rules,
            config.target_gain * values[3],
            config.obstacle_gain * min(values[:3]) + config.creep_speed,
        )

    def _drive(self, turn: float, forward: float) -> Velocity:
        """Return the velocity of a differential drive that turns by `turn` as it drives.

        A steered vehicle turns only as it rolls, on circles that (4) to (6) bound from below; this
        drive turns on the spot as well. So the angle is turned within `turn_time`, and of the
        speed the robot keeps what points where it is to go: nothing from a right angle on.
        """
        top = self.limits.max_turn_rate
        rate = min(max(turn / self.config.turn_time, -top), top)
        return Velocity(forward * max(math.cos(turn), 0.0), rate)


def require_inputs(base: RuleBase, names: tuple[str, ...]) -> RuleBase:
    """Return a rule base if it has the inputs that are measured, in their order.

    Raises
    ------
    ConfigError
    """
    if base.input_names != names:
        raise ConfigError(f'{base.name}.inputs', list(base.input_names), ', '.join(names))
    return base


__all__ = [
    'CORNER_INPUTS',
    'SENSORS',
    'SPEED_INPUTS',
    'ReactiveConfig',
    'ReactiveController',
    'ReactiveStep',
    'require_inputs',
]
