"""The path controllers by name."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tablerunner.control import CONTROLLERS, FollowerConfig, Path, VelocityLimits, make_controller
from tablerunner.control.fuzzy import Readings
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import RobotGeometry

CLEAR = Readings((np.inf,) * 5)


@pytest.mark.parametrize('name', CONTROLLERS)
def test_every_controller_drives_a_free_path_and_keeps_its_limits(name: str) -> None:
    limits = VelocityLimits(max_speed=0.3)
    controller = make_controller(name, limits, RobotGeometry())
    controller.follow(Path(np.array([[0.0, 0.0], [5.0, 0.0]])))
    pose, speeds = Pose2(), []
    for _ in range(100):
        controller.hear(CLEAR)
        velocity = controller.step(pose, 0.05).velocity
        speeds.append(velocity.linear_m_s)
        pose = pose @ Pose2(0.05 * velocity.linear_m_s, 0.0, 0.05 * velocity.angular_rad_s)
    assert max(speeds) <= 0.3 + 1e-12
    assert pose.x > 1.0
    assert abs(pose.y) < 0.05


@pytest.mark.parametrize('name', CONTROLLERS)
def test_configure_changes_the_limits_at_once(name: str) -> None:
    controller = make_controller(name, VelocityLimits(), RobotGeometry())
    controller.follow(Path(np.array([[0.0, 0.0], [5.0, 0.0]])))
    for _ in range(60):
        controller.hear(CLEAR)
        before = controller.step(Pose2(1.0), 0.05).velocity.linear_m_s
    controller.configure(FollowerConfig(), dataclasses.replace(VelocityLimits(), max_speed=0.2))
    for _ in range(60):
        controller.hear(CLEAR)
        after = controller.step(Pose2(1.0), 0.05).velocity.linear_m_s
    assert before > 0.5
    assert after == pytest.approx(0.2)


def test_unknown_controller_is_named() -> None:
    with pytest.raises(ConfigError, match=r'magnetic.*fuzzy, pure_pursuit'):
        make_controller('magnetic', VelocityLimits(), RobotGeometry())


def test_fuzzy_wants_all_five_sensors_and_names_the_missing() -> None:
    robot = RobotGeometry()
    four = dataclasses.replace(robot, ultrasonics=robot.ultrasonics[1:])
    with pytest.raises(ConfigError, match='ultrasonic_left'):
        make_controller('fuzzy', VelocityLimits(), four)
