"""The path controllers by name."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tablerunner.control import (
    CONTROLLERS,
    ControllerSettings,
    FollowerConfig,
    Path,
    VelocityLimits,
    configure_controller,
    make_controller,
)
from tablerunner.control.fuzzy import Readings, TrackConfig
from tablerunner.control.fuzzy_controller import DetourConfig
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


def test_fuzzy_explains_what_its_rules_decide_only_when_asked() -> None:
    """Off its track the rule base of the track decides; nobody else ever has reasons to give."""
    path = Path(np.array([[0.0, 0.0], [5.0, 0.0]]))
    aside = Pose2(1.0, 0.2)
    for name in CONTROLLERS:
        controller = make_controller(name, VelocityLimits(), RobotGeometry())
        controller.follow(path)
        controller.step(aside, 0.05)
        assert controller.traces == ()
        controller.explain(True)
        controller.step(aside, 0.05)
        assert [trace.base for trace in controller.traces] == ['sun_track'] * (name == 'fuzzy')
        controller.halt(0.05)
        assert controller.traces == ()


def test_fuzzy_explains_its_way_round_something() -> None:
    """On the way round it is corner and speed that decide."""
    controller = make_controller('fuzzy', VelocityLimits(), RobotGeometry())
    controller.explain(True)
    controller.follow(Path(np.array([[0.0, 0.0], [5.0, 0.0]])))
    bases = set()
    wait = round(DetourConfig().wait / 0.05)
    for number in range(wait + 40):
        near = number < wait + 5
        controller.hear(Readings((np.inf, np.inf, 0.5 if near else np.inf, np.inf, np.inf)))
        controller.step(Pose2(1.0, 0.0, 0.0 if near else 1.2), 0.05)
        bases |= {trace.base for trace in controller.traces}
    assert {'lv_corner', 'lv_speed'} <= bases


def test_settings_of_the_track_change_at_once() -> None:
    """A wider corridor: what was to be corrected is not any more."""
    controller = make_controller('fuzzy', VelocityLimits(), RobotGeometry())
    controller.follow(Path(np.array([[0.0, 0.0], [5.0, 0.0]])))
    controller.explain(True)
    controller.step(Pose2(1.0, 0.1), 0.05)
    assert controller.traces
    wide = ControllerSettings(track=TrackConfig(half_width=0.5))
    configure_controller(controller, VelocityLimits(max_speed=0.2), wide)
    controller.step(Pose2(0.9, 0.1), 0.05)
    assert not controller.traces
    for _ in range(60):
        speed = controller.step(Pose2(1.0, 0.1), 0.05).velocity.linear_m_s
    assert speed == pytest.approx(0.2)


def test_sensors_may_have_other_names() -> None:
    robot = RobotGeometry()
    mounts = tuple(
        dataclasses.replace(mount, frame=f'sonar_{number}')
        for number, mount in enumerate(robot.ultrasonics)
    )
    other = dataclasses.replace(robot, ultrasonics=mounts)
    frames = tuple(mount.frame for mount in mounts)
    assert make_controller('fuzzy', VelocityLimits(), other, frames=frames)
    with pytest.raises(ConfigError, match='ultrasonic_left'):
        make_controller('fuzzy', VelocityLimits(), other)
