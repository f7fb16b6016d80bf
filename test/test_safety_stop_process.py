"""The real safety_stop between a controller that always commands full speed and a simulated base.

People, a wall, the emergency stop, over DDS; nothing is touched by the robot's fault.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger

from tablerunner.control import SafetyConfig, stopping_distance
from tablerunner_ros.conversions.quaternion import heading_from_quaternion
from tablerunner_ros.testing.fixtures import domain, probe, processes
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes

__all__ = ['domain', 'probe', 'processes']

ROOM = """\
name: room
walls:
  - {name: hull, closed: true, points: [[0, 0], [5.5, 0], [5.5, 5], [0, 5]]}
people:
  - name: guest
    route: [[3.3, 0.5], [3.3, 4.5], [0.4, 4.5]]
    speed: 0.9
    yield_probability: 0.0
    pause_probability: 0.0
start: [1.0, 2.5, 0.0]
"""
WALL_M, RADIUS_M = 5.5, 0.25
LIMIT_S = 90.0
"""For one part of the drive on a busy machine."""


def test_full_speed_at_people_and_a_wall_touches_nothing(
    probe: Probe, processes: Processes, tmp_path: Path
) -> None:
    room = tmp_path / 'room.yaml'
    room.write_text(ROOM, encoding='utf-8')
    # Localisation is not the question: the robot is told where it is.
    truth = ('-r', 'ground_truth:=odometry/filtered')
    poses = probe.listen(Odometry, 'odometry/filtered')
    states = probe.listen(DiagnosticStatus, 'safety_state')
    probe.speak(Twist, 'cmd_vel_nav')
    command = Twist()
    command.linear.x = 5.0
    probe.node.create_timer(0.05, lambda: probe.publish('cmd_vel_nav', command))
    processes.node('nav_controller', 'safety_stop', {'use_sim_time': True})
    processes.node('sim_bridge', 'sim_bridge', {'scenario': str(room), 'seed': 3}, truth)

    def x() -> float:
        return poses[-1].pose.pose.position.x

    def speed() -> float:
        return poses[-1].twist.twist.linear.x

    probe.wait_for(lambda: poses and x() > 1.2 and speed() > 0.3, 'driving', LIMIT_S)
    assert probe.call(Trigger, 'emergency_stop', Trigger.Request()).success
    at = x()
    probe.wait_for(lambda: abs(speed()) < 0.005, 'a stand', LIMIT_S)
    config = SafetyConfig()
    # A third of a second more: on a busy machine the newest pose known here is as old.
    assert x() - at <= stopping_distance(0.6, config.delay + 0.3, config.deceleration)
    stood = x()
    probe.spin(0.5)
    assert x() == pytest.approx(stood, abs=0.01)
    assert 'emergency stop' in states[-1].message
    assert probe.call(Trigger, 'release', Trigger.Request()).success

    def before_the_wall() -> bool:
        # It may stand for a moment farther away, where two echoes disagree, and then come nearer.
        stopped = states[-1].values[0].value == 'stop' and 'obstacle' in states[-1].message
        return stopped and x() > WALL_M - RADIUS_M - 0.4 and abs(speed()) < 0.005

    probe.wait_for(before_the_wall, 'a stop before the wall', LIMIT_S)
    assert WALL_M - RADIUS_M - x() > 0.0
    words = [state.values[0].value for state in states]
    assert 'slow' in words[words.index('clear') : len(words) - words[::-1].index('slow')]
    command.linear.x, command.angular.z = 0.0, 0.5
    heading = heading_from_quaternion(poses[-1].pose.pose.orientation)
    probe.wait_for(
        lambda: abs(heading_from_quaternion(poses[-1].pose.pose.orientation) - heading) > 0.5,
        'a turn away from the wall',
        LIMIT_S,
    )
    status = probe.wait_diagnostic('sim_bridge', 'contacts at fault', '0')
    assert status.level == DiagnosticStatus.OK
