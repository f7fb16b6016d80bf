"""Matched settings against what the simulation draws."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.estimation.models.state import RANGE_BIAS, TURN_SCALE
from tablerunner.experiments.matched import (
    bound_model,
    is_clear,
    matched,
    motion_noise,
    nlos_gap,
    range_std,
    slip_rate,
)
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion
from tablerunner.scenario import (
    AnchorPlace,
    ImuErrors,
    Person,
    RobotGeometry,
    Scenario,
    SensorErrors,
    Wall,
    WheelErrors,
)
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.radio import GAP_DB
from tablerunner.types import Velocity
from tablerunner.uwb.ranging import nlos_probability

SPEED = 0.5
WALLS = (Wall(((-1.0, -1.0), (9.0, -1.0), (9.0, 7.0), (-1.0, 7.0)), 'outer', closed=True),)
ROOM = Scenario(name='room', walls=WALLS, anchors=(AnchorPlace('A', (3.0, 4.0, 1.1)),))


def of(**sensors):
    return ROOM.replace(sensors=SensorErrors(**sensors))


def test_variance_of_the_way_is_that_of_drawn_drives():
    """Noise of the floor and slips; 250 drives of 4 m: the variance is known to about 15 %."""
    wheels = WheelErrors(
        radius_scale_std=0.0, track_scale_std=0.0, slip_rate=0.5, floor_noise=0.005
    )
    lost = []
    for seed in range(250):
        drive = Drive(RobotGeometry(), wheels, Pose2(), np.random.default_rng(seed))
        way = 0.0
        for step in range(850):
            drive.command(step * 10_000_000, Velocity(0.5, 0.0))
            drive.step((step + 1) * 10_000_000, 0.01)
            way += drive.linear_m_s * 0.01
        rolled = 0.03 * (drive.left_angle_rad + drive.right_angle_rad)
        lost.append((way - rolled) / math.sqrt(rolled))
    noise = motion_noise(of(wheels=wheels), 0.5).distance
    assert np.var(lost) == pytest.approx(noise**2, rel=0.45)


def test_noise_of_the_heading_is_that_of_summed_readings():
    """100 readings a second of 0.01 s each: sqrt(100) 0.005 0.01."""
    noise = motion_noise(of(imu=ImuErrors(rate=100.0, gyro_std=0.005)), 0.5)
    variance = noise.variances(Motion(0.5, 0.3, 1.0))[1]
    assert math.sqrt(variance) == pytest.approx(0.0005)


def test_slip_is_beyond_what_the_noise_of_drawn_drives_explains():
    """Turn of the robot whose wheels go straight on, in steps of 0.05 s, without slips."""
    wheels = WheelErrors(
        rate=20.0,
        radius_scale_std=0.0,
        track_scale_std=0.0,
        slip_rate=0.0,
        floor_noise=0.01,
        ticks_per_turn=0,
    )
    drive = Drive(RobotGeometry(), wheels, Pose2(), np.random.default_rng(3))
    apart = []
    for step in range(2000):
        drive.command(step * 10_000_000, Velocity(0.5, 0.0))
        drive.step((step + 1) * 10_000_000, 0.01)
        apart.append(drive.angular_rad_s * 0.01)  # the wheels are told to go straight on
    rates = np.sum(np.reshape(apart, (-1, 5)), axis=1) / 0.05
    believed = slip_rate(of(wheels=wheels, imu=ImuErrors(gyro_std=0.0)), 0.5) / 4.5
    # 400 steps, the first few slower: the deviation is known to 4 %.
    assert np.std(rates) == pytest.approx(believed, rel=0.12)


def test_ideal_sensors_leave_no_noise_but_the_rounding_of_timestamps():
    ideal = of().sensors.ideal()
    noise = motion_noise(ROOM.replace(sensors=ideal), 0.5)
    assert noise.variances(Motion(1.0, 1.0, 1.0)) == (0.0, 0.0)
    assert 0.0 < range_std(ideal) < 0.001


def test_nlos_curve_is_the_odds_of_the_simulated_powers():
    """At its centre blocked and clear are equally likely, given one in ten is blocked."""
    errors = of().sensors
    centre, width = nlos_gap(errors)
    clear, (thin, thick) = GAP_DB[''][0], GAP_DB['person']
    deviation = errors.uwb.power_std

    def odds(gap):
        rng = np.linspace(thin, thick, 2001)
        blocked = np.mean(np.exp(-0.5 * ((gap - rng) / deviation) ** 2))
        return 0.1 * blocked / (0.9 * math.exp(-0.5 * ((gap - clear) / deviation) ** 2))

    # The uniform part is not a normal at its end: a few tenths of a dB.
    equal = next(gap for gap in np.arange(3.0, 9.0, 0.01) if odds(gap) > 1.0)
    assert centre == pytest.approx(equal, abs=0.5)
    assert nlos_probability(-80.0, -80.0 - 4.0, centre, width) < 0.001
    assert nlos_probability(-80.0, -80.0 - 8.0, centre, width) > 0.99


def test_priors_are_the_spreads_of_the_scenario():
    config = matched(of(), SPEED).localizer.filter
    errors = SensorErrors()
    assert config.turn_scale_std == errors.imu.gyro_scale_std
    assert config.gyro_bias_std == errors.imu.gyro_bias_std
    assert config.scale_std == pytest.approx(
        errors.wheels.radius_scale_std / math.sqrt(2), rel=0.1
    )
    assert config.range_bias_std == errors.uwb.bias_std
    assert config.range_scale_std == errors.uwb.scale_std


def test_bound_knows_the_prior_of_every_state_and_no_more():
    model = bound_model(of(), SPEED, (0.05, 0.06, 0.02))
    errors = SensorErrors()
    deviations = np.sqrt(np.diag(model.prior))
    np.testing.assert_allclose(deviations[:3], [0.05, 0.06, 0.02])
    assert deviations[TURN_SCALE] == pytest.approx(errors.imu.gyro_scale_std)
    np.testing.assert_allclose(
        deviations[RANGE_BIAS:], [errors.uwb.bias_std, errors.uwb.scale_std]
    )


def test_clear_room_is_told_so():
    """Where nothing can block, nothing is looked for; elsewhere powers are judged."""
    assert is_clear(ROOM)
    assert matched(ROOM, SPEED).ranger.nlos_test == 'none'
    peopled = ROOM.replace(people=(Person('somebody', ((4.0, 3.0),)),))
    assert not is_clear(peopled)
    assert matched(peopled, SPEED).ranger.nlos_test == ReplayConfig().ranger.nlos_test
    screen = Wall(((0.0, 3.0), (4.0, 3.0)), 'screen')
    assert not is_clear(replace(ROOM, walls=(*WALLS, screen)))
