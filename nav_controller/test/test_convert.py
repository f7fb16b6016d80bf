from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nav_controller.convert import (
    deviations,
    plan_to_message,
    safety_from_message,
    safety_to_message,
)
from nav_controller.params import SafetyNodeConfig
from tablerunner.control import Path, SafetyDecision, SafetyState, sensor_mounts
from tablerunner.scenario import RobotGeometry
from tablerunner.types import Velocity


@given(st.floats(0.01, 2.0), st.floats(0.01, 2.0), st.floats(-3.0, 3.0))
def test_largest_deviation_is_that_of_the_ellipse(a: float, b: float, angle: float) -> None:
    """However the ellipse is turned, its long half axis is found."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    covariance = np.eye(3) * 0.04
    covariance[:2, :2] = turn @ np.diag([a**2, b**2]) @ turn.T
    position, heading = deviations(covariance)
    assert position == pytest.approx(max(a, b))
    assert heading == pytest.approx(0.2)


@pytest.mark.parametrize('state', list(SafetyState))
@pytest.mark.parametrize('blocked', [True, False])
def test_safety_state_survives_the_message(state: SafetyState, blocked: bool) -> None:
    decision = SafetyDecision(
        Velocity(0.1, 0.0), state, ('because',), blocked, 0.5, 0.2, (0.4, -0.1)
    )
    told = safety_from_message(safety_to_message(decision, emergency=False))
    stopped = state is SafetyState.STOP
    assert told == (stopped and blocked, stopped and not blocked, (0.4, -0.1))


def test_plan_looks_along_the_path_and_ends_with_the_heading_asked_for() -> None:
    path = Path(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), heading=3.0)
    message = plan_to_message(path, 5, 'map')
    assert message.header.frame_id == 'map'
    assert message.poses[0].pose.orientation.z == pytest.approx(0.0)
    assert message.poses[-2].pose.orientation.z == pytest.approx(math.sin(math.pi / 4))
    assert message.poses[-1].pose.orientation.z == pytest.approx(math.sin(1.5))
    assert plan_to_message(None, 5, 'map').poses == []


def test_default_sensors_are_those_of_the_default_robot() -> None:
    """A safety stop without a scenario and one with agree on where the sensors sit."""
    mounts = sensor_mounts(RobotGeometry())
    own = SafetyNodeConfig().mounts
    assert list(own) == list(mounts)
    for frame, pose in mounts.items():
        assert own[frame].x == pytest.approx(pose.x, abs=1e-3)
        assert own[frame].y == pytest.approx(pose.y, abs=1e-3)
        assert own[frame].heading == pytest.approx(pose.heading, abs=1e-3)
