"""Settings that fit the simulated sensors: what somebody would tune who knew how they err.

Estimators are judged by bounds and by their consistency with these, so that what is found is the
estimator's own and not a wrong guess of noise. The simulation draws its errors from
`SensorErrors`; here each becomes the noise or prior of the model that the filter has for it:

| error of the simulation | setting |
|---|---|
| noise of the floor, slip, encoder ticks | `MotionNoise.distance`, per root metre |
| the same, and noise of the yaw rate | `SlipConfig.rate`, where the shipped one is too small |
| radii of the wheels | `scale_std` (mean of two wheels) |
| noise of the yaw rate | `MotionNoise.heading_per_time` |
| scale of the gyroscope | `turn_scale_std` |
| bias of the gyroscope, its walk | `gyro_bias_std`, `gyro_bias_walk` |
| noise of ranges, ticks of the timestamps | `RangerConfig.range_std` |
| constant error of each anchor | `range_bias_std` |
| error in proportion to the range | `range_scale_std` |
| none: all stamps are exact | `range_delay_std` is zero |
| powers in and out of sight | `nlos_gap_centre`, `nlos_gap_width` |
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.estimation.ekf import bias_covariance
from tablerunner.estimation.estimator import EstimatorConfig
from tablerunner.estimation.models.state import (
    GYRO_BIAS,
    RANGE_BIAS,
    RANGE_DELAY,
    SCALE,
    TURN_SCALE,
)
from tablerunner.evaluation.bound import BoundModel
from tablerunner.odometry.motion import MotionNoise
from tablerunner.scenario import Scenario, SensorErrors
from tablerunner.simulation.radio import GAP_DB
from tablerunner.types import Matrix
from tablerunner.uwb.ranging import SPEED_OF_LIGHT_M_S, TICK_S

BLOCKED_SHARE = 0.1
"""How many ranges are taken to be blocked before anything is known of them."""

_SELDOM = 4.5
"""Deviations beyond which noise hardly ever is."""

_RANGE_WEIGHTS = (0.25, 0.5, 0.25)
"""What each of the three receptions of an exchange weighs in its range."""


def matched(scenario: Scenario, speed: float) -> ReplayConfig:
    """Return the settings of odometry, ranging and localisation that fit a scenario."""
    config = ReplayConfig.from_scenario(scenario)
    noise = motion_noise(scenario, speed)
    ranging = replace(config.ranger, range_std=range_std(scenario.sensors))
    if is_clear(scenario):
        ranging = replace(ranging, nlos_test='none')
    else:
        centre, width = nlos_gap(scenario.sensors)
        ranging = replace(ranging, nlos_gap_centre=centre, nlos_gap_width=width)
    return replace(
        config,
        ranger=ranging,
        odometer=replace(
            config.odometer,
            noise=noise,
            slip=replace(
                config.odometer.slip,
                rate=max(config.odometer.slip.rate, slip_rate(scenario, speed)),
            ),
        ),
        localizer=replace(
            config.localizer,
            filter=estimator_config(config.localizer.filter, scenario, noise),
        ),
    )


def is_clear(scenario: Scenario) -> bool:
    """Whether nothing can stand between tag and anchors."""
    inside = [wall for wall in scenario.walls if not wall.closed]
    return not (scenario.people or scenario.tables or scenario.boxes or inside)


def motion_noise(scenario: Scenario, speed: float) -> MotionNoise:
    """Return the noise of odometry.

    The way is the mean of two wheels, each with the noise of the floor f per root metre: f^2/2. A
    slip of rate l, mean length t (exponential) and largest share s (uniform) loses a way of mean
    square 2 t^2 v^2 s^2/3 of one wheel: over both, l t^2 s^2 v / 3 for each metre at speed v. It
    comes in rare jumps; only its variance is matched. A tick of q metres adds q^2/12 however long
    the way, which is given to the first metre. Readings of the yaw rate with deviation g add up to
    g^2/rate in a second.
    """
    wheels, imu = scenario.sensors.wheels, scenario.sensors.imu
    slip = wheels.slip_rate * (wheels.slip_duration * wheels.slip_share) ** 2 * speed / 3.0
    tick = 0.0
    if wheels.ticks_per_turn:
        tick = 2.0 * math.pi * scenario.robot.wheel_radius / wheels.ticks_per_turn
    return MotionNoise(
        distance=math.sqrt(0.5 * wheels.floor_noise**2 + slip + tick**2 / 12.0),
        heading_per_turn=0.0,
        heading_per_distance=0.0,
        heading_per_time=imu.gyro_std / math.sqrt(imu.rate),
    )


def slip_rate(scenario: Scenario, speed: float) -> float:
    """Return what the turn rates of wheels and gyroscope differ by without any slip [rad/s].

    `_SELDOM` deviations of the noise of the floor under both wheels, of a tick at both ends of a
    step, and of the readings of the gyroscope in it, the one at its end held.
    """
    wheels, imu = scenario.sensors.wheels, scenario.sensors.imu
    track, step_s = scenario.robot.track, 1.0 / wheels.rate
    floor = 2.0 * wheels.floor_noise**2 * speed * step_s
    ticks = 0.0
    if wheels.ticks_per_turn:
        tick = 2.0 * math.pi * scenario.robot.wheel_radius / wheels.ticks_per_turn
        ticks = 4.0 * tick**2 / 12.0
    turned = (floor + ticks) / (track * step_s) ** 2
    held = 1.0 / (imu.rate * step_s)
    read = imu.gyro_std**2 * (held + held**2)
    return _SELDOM * math.sqrt(turned + read)


def range_std(errors: SensorErrors) -> float:
    """Return the noise of a range in plain sight, rounding of three receptions included [m]."""
    tick = TICK_S * SPEED_OF_LIGHT_M_S
    rounding = tick**2 / 12.0 * sum(weight**2 for weight in _RANGE_WEIGHTS)
    return math.sqrt(errors.uwb.range_std**2 + rounding)


def nlos_gap(errors: SensorErrors) -> tuple[float, float]:
    """Return centre and width of the curve from power gap to NLOS probability [dB].

    In sight the gap is normal about the one value, with a deviation p; behind somebody at least
    about the other, and uniform above. The log odds of normal against normal are linear in the
    gap: the width is p^2 over the distance of both. What is uniform is less dense there by the
    factor p sqrt(2 pi) / spread, and blocked ranges are fewer: both move the centre.
    """
    clear, (thin, thick) = GAP_DB[''][0], GAP_DB['person']
    deviation = max(errors.uwb.power_std, 0.2)
    width = deviation**2 / (thin - clear)
    rarer = (1.0 - BLOCKED_SHARE) / BLOCKED_SHARE
    rarer *= (thick - thin) / (deviation * math.sqrt(2.0 * math.pi))
    return 0.5 * (clear + thin) + width * math.log(rarer), width


def estimator_config(
    config: EstimatorConfig, scenario: Scenario, noise: MotionNoise
) -> EstimatorConfig:
    """Return priors and walks of the filters.

    A slip only ever loses: its mean share is put into the prior of the scale.
    """
    wheels, imu, uwb = scenario.sensors.wheels, scenario.sensors.imu, scenario.sensors.uwb
    lost = 0.5 * wheels.slip_rate * wheels.slip_duration * wheels.slip_share
    return replace(
        config,
        motion=noise,
        scale_std=math.hypot(wheels.radius_scale_std / math.sqrt(2.0), lost),
        scale_walk=0.0,
        turn_scale_std=imu.gyro_scale_std,
        turn_scale_walk=0.0,
        gyro_bias_std=imu.gyro_bias_std,
        gyro_bias_walk=imu.gyro_bias_walk,
        range_delay_std=0.0,
        range_delay_walk=0.0,
        range_bias_common_std=0.0,
        range_bias_std=uwb.bias_std,
        range_bias_walk=0.0,
        range_scale_std=uwb.scale_std,
    )


def bound_model(scenario: Scenario, speed: float, start_std: tuple[float, ...]) -> BoundModel:
    """Return what the bound knows of a scenario: the same variances, and the model of the ranges.

    Parameters
    ----------
    scenario : Scenario
    speed : float
        [m/s].
    start_std : tuple
        Deviations of x, y [m], heading [rad] at the start.
    """
    noise = motion_noise(scenario, speed)
    config = estimator_config(EstimatorConfig(), scenario, noise)
    count = len(scenario.anchors)
    prior: Matrix = np.zeros((RANGE_BIAS + 2 * count,) * 2)
    prior[:3, :3] = np.diag(np.square(start_std))
    prior[SCALE, SCALE] = config.scale_std**2
    prior[TURN_SCALE, TURN_SCALE] = config.turn_scale_std**2
    prior[RANGE_DELAY, RANGE_DELAY] = config.range_delay_std**2
    prior[GYRO_BIAS, GYRO_BIAS] = config.gyro_bias_std**2
    biases = slice(RANGE_BIAS, RANGE_BIAS + count)
    prior[biases, biases] = bias_covariance(config, count)
    scales = slice(RANGE_BIAS + count, RANGE_BIAS + 2 * count)
    prior[scales, scales] = np.eye(count) * config.range_scale_std**2
    walk = np.zeros(len(prior))
    walk[GYRO_BIAS] = config.gyro_bias_walk**2
    return BoundModel(
        tuple(anchor.position for anchor in scenario.anchors),
        scenario.robot.tag_position,
        prior,
        noise,
        walk,
        range_std(scenario.sensors),
    )
