"""`tablerunner drive`: a velocity for a while, and what odometry says of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node

from tablerunner.cli.console import Progress
from tablerunner.errors import TablerunnerError
from tablerunner.geometry.angles import difference
from tablerunner.geometry.pose import Pose2
from tablerunner.messages.odometry import odometry_from_message
from tablerunner.types import Refusal, Velocity
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.polling import Newest, bare_node
from tablerunner_ros.conversions.velocity import velocity_to_twist, velocity_to_twist_stamped
from tablerunner_ros.qos import qos_for

PERIOD_S = 0.05
STANDING = Velocity(0.0, 0.0)
_FIND_S = 10.0
_OTHERS_S = 1.0
_NAMES_S = 0.3
_ODOMETRY_S = 3.0
_SETTLE_S = 1.0
_STAMPED = 'geometry_msgs/msg/TwistStamped'


class NobodyDrivesError(TablerunnerError):
    """Nobody listens to the command, or somebody else gives commands as well."""


@dataclass(frozen=True)
class DriveOptions:
    """A velocity, until when, and to whom.

    It ends after `seconds`, or when odometry has come as far as one of `distance_m` and
    `angle_rad` says; infinite: that does not end it.
    """

    velocity: Velocity
    seconds: float
    distance_m: float = math.inf
    angle_rad: float = math.inf
    topic: str = 'cmd_vel'
    namespace: str = ''
    domain: int | None = None


@dataclass(frozen=True)
class Driven:
    """What odometry says: the way along the robot and to its left [m], the turn [rad]."""

    forward_m: float = math.nan
    left_m: float = math.nan
    turn_rad: float = math.nan


class Log:
    """Adds up what odometry says."""

    def __init__(self) -> None:
        self._start: Pose2 | None = None
        self._last: Pose2 | None = None
        self.way_m = 0.0
        self.turn_rad = 0.0

    def take(self, pose: Pose2 | None) -> None:
        """Take the newest pose in odom, if there is one."""
        if pose is None:
            return
        if self._last is not None:
            self.way_m += pose.distance_to(self._last)
            self.turn_rad += difference(pose.heading, self._last.heading)
        self._start = self._start or pose
        self._last = pose

    @property
    def driven(self) -> Driven:
        """From the first pose to the last."""
        if self._start is None or self._last is None:
            return Driven()
        moved = self._start.inverse() @ self._last
        return Driven(moved.x, moved.y, self.turn_rad)


def drive(options: DriveOptions, progress: Progress) -> Driven:
    """Publish a velocity, then zeros; return what odometry made of it, NaN where it is silent.

    Raises
    ------
    NobodyDrivesError
        Before anything was sent.
    """
    with (
        Interrupts() as interrupts,
        bare_node('tablerunner_drive', options.domain, options.namespace) as node,
        progress,
    ):
        stamped = _listener(node, options.topic)
        kind = TwistStamped if stamped else Twist
        publisher = node.create_publisher(kind, options.topic, qos_for('cmd_vel'))
        odometry = Newest(node, Odometry, 'odom', qos_for('odom', subscriber=True))
        _wait(lambda: publisher.get_subscription_count() and odometry.poll(), _ODOMETRY_S)
        log = Log()
        log.take(_pose(odometry))

        def send(velocity: Velocity, duration_s: float, done: Callable[[], bool]) -> None:
            end = time.monotonic() + duration_s
            while time.monotonic() < end and not done():
                publisher.publish(_message(velocity, stamped))
                time.sleep(PERIOD_S)
                odometry.poll()
                log.take(_pose(odometry))
                progress.show(f'{log.way_m:.2f} m, {math.degrees(log.turn_rad):.0f} degrees')

        send(
            options.velocity,
            options.seconds,
            lambda: (
                interrupts.asked
                or log.way_m >= options.distance_m
                or abs(log.turn_rad) >= options.angle_rad
            ),
        )
        send(STANDING, _SETTLE_S, lambda: False)
        return log.driven


def _listener(node: Node, topic: str) -> bool:
    """Return whether whoever listens wants TwistStamped.

    Raises
    ------
    NobodyDrivesError
        Nobody listens, or somebody publishes already.
    """
    name = node.resolve_topic_name(topic)
    _wait(lambda: bool(node.get_subscriptions_info_by_topic(name)), _FIND_S)
    listeners = node.get_subscriptions_info_by_topic(name)
    if not listeners:
        raise NobodyDrivesError(f'nobody listens to {name}: start the driver of the base')
    _wait(lambda: bool(node.get_publishers_info_by_topic(name)), _OTHERS_S)
    time.sleep(_NAMES_S)  # the name of a node comes after its publishers
    others = [info.node_name for info in node.get_publishers_info_by_topic(name)]
    if others:
        raise NobodyDrivesError(f'{", ".join(others)} drives on {name} already: end it first')
    return any(info.topic_type == _STAMPED for info in listeners)


def _wait(condition: Any, limit_s: float) -> None:
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(PERIOD_S)


def _message(velocity: Velocity, stamped: bool) -> Twist | TwistStamped:
    if stamped:
        return velocity_to_twist_stamped(velocity, time.time_ns(), 'base_link')
    return velocity_to_twist(velocity)


def _pose(newest: Newest) -> Pose2 | None:
    if newest.message is None:
        return None
    sample = odometry_from_message(newest.message)
    return None if isinstance(sample, Refusal) else sample.pose
