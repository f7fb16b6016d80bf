"""`tablerunner drive`: a velocity for a while, and what odometry says of it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node

from tablerunner.cli.console import Progress
from tablerunner.errors import TablerunnerError
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
_SETTLE_S = 1.0
_STAMPED = 'geometry_msgs/msg/TwistStamped'


class NobodyDrivesError(TablerunnerError):
    """Nobody listens to the command, or somebody else gives commands as well."""


@dataclass(frozen=True)
class DriveOptions:
    """A velocity, for how long, and to whom."""

    velocity: Velocity
    seconds: float
    topic: str = 'cmd_vel'
    namespace: str = ''
    domain: int | None = None


@dataclass(frozen=True)
class Driven:
    """What odometry says: the way along the robot and to its left [m], the turn [rad]."""

    forward_m: float = math.nan
    left_m: float = math.nan
    turn_rad: float = math.nan


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
        _wait(lambda: publisher.get_subscription_count() and odometry.poll(), 2.0)
        start, turned = _pose(odometry), 0.0
        last = start

        def send(velocity: Velocity, duration_s: float) -> None:
            nonlocal last, turned
            end = time.monotonic() + duration_s
            while time.monotonic() < end and not (interrupts.asked and velocity != STANDING):
                publisher.publish(_message(velocity, stamped))
                time.sleep(PERIOD_S)
                odometry.poll()
                pose = _pose(odometry)
                if last is not None and pose is not None:
                    turned += math.remainder(pose.heading - last.heading, math.tau)
                last = pose or last
                progress.show(f'{max(end - time.monotonic(), 0.0):.1f} s more')

        send(options.velocity, options.seconds)
        send(STANDING, _SETTLE_S)
        if start is None or last is None:
            return Driven()
        moved = start.inverse() @ last
        return Driven(moved.x, moved.y, turned)


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
