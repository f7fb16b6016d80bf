"""Three robots over DDS: one simulation, one camera, a stack of nodes for each."""

from __future__ import annotations

import signal
from bisect import bisect_left
from pathlib import Path
from typing import Any

import psutil
import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry

from tablerunner.geometry.pose import Pose2
from tablerunner_ros.qos import qos_for

pytestmark = pytest.mark.slow

ROOM = """\
name: three
walls:
  - {name: hull, closed: true, points: [[0, 0], [7, 0], [7, 5], [0, 5]]}
anchors:
  - {id: A0, position: [0.2, 0.2, 2.25]}
  - {id: A1, position: [6.8, 0.2, 2.25]}
  - {id: A2, position: [6.8, 4.8, 2.25]}
  - {id: A3, position: [0.2, 4.8, 2.25]}
camera: {position: [3.5, 2.5, 4.4], width: 320, height: 240, focal: [150, 150], rate: 4.0,
         distortion: [0, 0, 0, 0, 0]}
robot: {marker: {disc_radius: 0.1, front_radius: 0.075, disc_x: -0.08, front_x: 0.14}}
robots:
  - {name: robot_1, start: [2.5, 4.0, 0.0]}
  - {name: robot_2, start: [2.5, 2.5, 0.0], colour: [30, 190, 60]}
  - {name: robot_3, start: [2.5, 1.0, 0.0], colour: [30, 90, 220]}
"""
NAMES = ('robot_1', 'robot_2', 'robot_3')
FACTOR = '0.4'
"""Of real time: 17 processes on two cores that others use as well."""

UP_LIMIT_S, LIMIT_S = 180.0, 60.0
POSE_M, CAMERA_M = 0.15, 0.06
"""What estimates and the camera may be off; the robots stand 1.5 m apart."""


class Robot:
    """What the test hears of one robot."""

    def __init__(self, probe: Any, name: str) -> None:
        self.truth: list[Odometry] = []
        self.believed: list[Odometry] = []
        self.seen: list[PoseWithCovarianceStamped] = []
        for type_, topic, messages in (
            (Odometry, 'ground_truth', self.truth),
            (Odometry, 'odometry/filtered', self.believed),
            (PoseWithCovarianceStamped, 'camera/pose', self.seen),
        ):
            profile = qos_for(topic, subscriber=True)
            profile.depth = 1000
            probe.node.create_subscription(type_, f'{name}/{topic}', messages.append, profile)
        self.goals = probe.node.create_publisher(
            PoseStamped, f'{name}/goal_pose', qos_for('goal_pose')
        )

    def at(self, stamp: float) -> Pose2:
        """Return where it was at the truth next to a stamp [s]."""
        stamps = [seconds(message) for message in self.truth]
        return pose(self.truth[min(bisect_left(stamps, stamp), len(stamps) - 1)])

    def moved_m(self) -> float:
        """Return how far it is from where it began."""
        return pose(self.truth[-1]).distance_to(pose(self.truth[0]))


def seconds(message: Any) -> float:
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def pose(message: Any) -> Pose2:
    return Pose2(message.pose.pose.position.x, message.pose.pose.position.y)


def off_m(messages: list[Any], robot: Robot) -> float:
    """Return the largest distance of poses to where a robot was [m]."""
    return max(pose(message).distance_to(robot.at(seconds(message))) for message in messages)


def participants(pid: int) -> list[str]:
    """Return the event threads of a process's DDS participants."""
    names = [path.read_text().strip() for path in Path(f'/proc/{pid}/task').glob('*/comm')]
    return [name for name in names if name.startswith('dds.ev')]


def test_launch_three_robots_keep_apart_what_is_each_ones(start, tmp_path, domain, probe):
    """A goal moves only its robot; each one's pose and camera pose are its own; all ends."""
    room = tmp_path / 'three.yaml'
    room.write_text(ROOM, encoding='utf-8')
    robots = {name: Robot(probe, name) for name in NAMES}
    arguments = ('--scenario', str(room), '--robots', '3', '--real-time-factor', FACTOR)
    run = start(*arguments, '--domain', str(domain), domain=domain)
    try:
        probe.wait_for(lambda: 'everything is up' in run.process.output, 'all nodes', UP_LIMIT_S)
    except AssertionError as error:
        raise AssertionError(f'{error}; the launcher says:\n{run.process.output}') from None
    goal = PoseStamped()
    goal.header.frame_id = 'map'
    goal.pose.position.x, goal.pose.position.y, goal.pose.orientation.w = 4.5, 2.5, 1.0
    driver = robots['robot_2']
    probe.wait_for(
        lambda: driver.goals.get_subscription_count() and all(r.truth for r in robots.values()),
        'robot_2 to listen',
        LIMIT_S,
    )
    driver.goals.publish(goal)
    probe.wait_for(lambda: driver.moved_m() > 0.8, 'robot_2 to drive', LIMIT_S)
    probe.wait_for(
        lambda: all(len(robot.seen) > 4 and robot.believed for robot in robots.values()),
        'poses of all',
        LIMIT_S,
    )
    for name, robot in robots.items():
        assert off_m(robot.believed, robot) < POSE_M, name
        assert off_m(robot.seen, robot) < CAMERA_M, name
        if robot is not driver:
            assert robot.moved_m() < 0.01, name
    # One participant of DDS: several in one process can lock up when they end (Fast DDS 2.14).
    assert len(participants(run.process.pid)) == 1
    children = psutil.Process(run.process.pid).children(recursive=True)
    assert len(children) == 2 + 3 * 5
    run.process.send(signal.SIGINT)
    assert run.wait_end(LIMIT_S) == 0, run.process.output
    assert not [child for child in children if child.is_running()]
