"""The way that is gathered, and the moments of the swarm, against the `ekf` and against draws."""

import math

import numpy as np
import pytest

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.particles.swarm import Swarm, Way, carried, rotation
from tablerunner.odometry.motion import Motion

MOTIONS = [Motion(0.05, 0.03 * math.sin(0.4 * k), 0.1) for k in range(40)]
ERRORS = np.array([0.01, -0.02, 0.005])


def way_of(errors, motions=MOTIONS, variances=(0.0, 0.0)):
    way = Way.none()
    for motion in motions:
        way = way.then(errors, motion, variances, np.zeros(3))
    return way


def test_by_errors_is_the_difference():
    way = way_of(ERRORS)
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-6
        found = (way_of(ERRORS + step).moved - way_of(ERRORS - step).moved) / 2e-6
        assert way.by_errors[:, axis] == pytest.approx(found, abs=1e-8)


def test_particles_are_carried_as_if_each_had_driven_by_itself():
    """Two metres with errors of two per cent: linear to the square of that."""
    rng = np.random.default_rng(0)
    poses = rng.uniform((0.0, 0.0, -3.0), (9.0, 9.0, 3.0), size=(20, 3))
    off = rng.normal(0.0, (0.02, 0.02, 0.005), size=(20, 3))
    found = carried(poses, off, way_of(ERRORS))
    for row in range(len(poses)):
        x, y, heading = poses[row]
        errors = ERRORS + off[row]
        for motion in MOTIONS:
            turn = (1.0 + errors[1]) * motion.turn_rad - errors[2] * motion.dt_s
            middle = heading + 0.5 * turn
            x += (1.0 + errors[0]) * motion.distance_m * math.cos(middle)
            y += (1.0 + errors[0]) * motion.distance_m * math.sin(middle)
            heading += turn
        assert found[row] == pytest.approx((x, y, heading), abs=2e-3)


def test_moments_on_the_way_are_the_ekfs():
    """From one pose, before any measurement, both predict the same mean and covariance."""
    config = EstimatorConfig()
    ekf = Ekf(config, (), (0.0, 0.0, 1.0))
    pose, spread = np.array([2.0, 3.0, 2.5]), np.diag([0.04, 0.01, 0.02])
    spread[0, 2] = spread[2, 0] = 0.01
    estimate = ekf.start(Start(1, pose, spread))
    from tablerunner.estimation.particles.robot import RobotParticleFilter

    particles = RobotParticleFilter(config, (), (0.0, 0.0, 1.0))
    cloud = particles.start(Start(1, pose, spread))
    assert cloud.pose_covariance == pytest.approx(spread)
    for k, motion in enumerate(MOTIONS):
        estimate = ekf.predict(estimate, motion, k + 2)
        cloud = particles.predict(cloud, motion, k + 2)
    assert cloud.mean == pytest.approx(estimate.mean[:6], abs=1e-9)
    # What the errors walk on the way is not led back to the places before: a thousandth.
    assert cloud.covariance == pytest.approx(estimate.covariance[:6, :6], rel=2e-3, abs=1e-7)
    assert cloud.twist == pytest.approx(estimate.twist)


def test_mean_heading_is_that_of_the_directions():
    """Half of the particles look left of pi, half right of it."""
    poses = np.zeros((4, 3))
    poses[:, 2] = (math.pi - 0.1, math.pi - 0.2, -math.pi + 0.1, -math.pi + 0.2)
    even = np.full(4, -math.log(4.0))
    swarm = Swarm(
        poses, np.zeros((4, 3)), np.zeros((4, 0)), even, np.eye(3), np.empty((0, 0)), Way.none()
    )
    mean, covariance = swarm.moments(swarm.now())
    assert abs(mean[2]) == pytest.approx(math.pi)
    assert covariance[2, 2] == pytest.approx(0.025)


def test_rotation_turns_counter_clockwise():
    turned = rotation(np.array([math.pi / 2.0])) @ np.array([1.0, 0.0, 5.0])
    assert turned[0] == pytest.approx([0.0, 1.0, 5.0])
