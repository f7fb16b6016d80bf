"""Velocity commands: Twist or TwistStamped and Velocity."""

from __future__ import annotations

import math

from geometry_msgs.msg import Twist, TwistStamped

from tablerunner.types import Refusal, Velocity
from tablerunner_ros.conversions.stamp import fill_stamp, stamp_from_message


def velocity_from_message(
    message: Twist | TwistStamped, source: str = 'cmd_vel', frame: str = ''
) -> Velocity | Refusal:
    """Return a command for a differential drive; what it cannot do (sideways) is refused.

    `frame` is that expected of a stamped command, which may leave its own empty; empty for any.
    """
    stamp = 0
    if isinstance(message, TwistStamped):
        stamp = stamp_from_message(message.header.stamp)
        if frame and message.header.frame_id not in ('', frame):
            return Refusal(stamp, source, '', f'not in frame {frame}')
        message = message.twist
    linear, angular = message.linear.x, message.angular.z
    if not (math.isfinite(linear) and math.isfinite(angular)):
        return Refusal(stamp, source, '', 'velocity is not finite')
    if message.linear.y != 0.0:
        return Refusal(stamp, source, '', 'sideways velocity')
    return Velocity(linear, angular)


def velocity_to_twist(velocity: Velocity) -> Twist:
    """Return a command as a Twist."""
    message = Twist()
    message.linear.x = velocity.linear_m_s
    message.angular.z = velocity.angular_rad_s
    return message


def velocity_to_twist_stamped(velocity: Velocity, stamp: int, frame: str) -> TwistStamped:
    """Return a command as a TwistStamped in the robot's frame."""
    message = TwistStamped()
    fill_stamp(message.header.stamp, stamp)
    message.header.frame_id = frame
    message.twist.linear.x = velocity.linear_m_s
    message.twist.angular.z = velocity.angular_rad_s
    return message
