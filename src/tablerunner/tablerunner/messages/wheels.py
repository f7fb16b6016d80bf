"""Wheel encoders: sensor_msgs/JointState as WheelSample."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tablerunner.messages.stamp import stamp_from_message
from tablerunner.types import Refusal, WheelSample

SOURCE = 'joint_states'
LEFT_JOINT = 'left_wheel_joint'
RIGHT_JOINT = 'right_wheel_joint'
"""Names of the drive wheels' joints unless a parameter says otherwise."""

OTHER_JOINTS = 'of other joints'
"""Reason to leave out a message that holds no drive wheel, as of an arm; nothing is wrong."""


def wheels_from_message(
    message: Any, left_joints: str | Sequence[str], right_joints: str | Sequence[str]
) -> WheelSample | Refusal:
    """Return angles and speeds of the drive wheels, found by the names of their joints.

    The order of the joints may differ from message to message. An angle or a speed that a joint
    does not measure is NaN, as joint_state_broadcaster writes it, or the whole array is left out.

    Parameters
    ----------
    message : sensor_msgs.msg.JointState
        With other joints too, or with others only.
    left_joints, right_joints : str or sequence of str
        As many on the left as on the right.
    """
    stamp = stamp_from_message(message.header.stamp)
    left = (left_joints,) if isinstance(left_joints, str) else tuple(left_joints)
    right = (right_joints,) if isinstance(right_joints, str) else tuple(right_joints)
    joints = [joint for pair in zip(left, right, strict=True) for joint in pair]
    names = list(message.name)
    missing = [joint for joint in joints if joint not in names]
    if names and len(missing) == len(joints):
        return Refusal(stamp, SOURCE, '', OTHER_JOINTS)
    if missing:
        return Refusal(stamp, SOURCE, missing[0], 'joint is missing')
    where = [names.index(joint) for joint in joints]
    found = []
    for what, numbers in (('positions', message.position), ('velocities', message.velocity)):
        if len(numbers) not in (0, len(names)):
            return Refusal(stamp, SOURCE, '', f'names and {what} differ in number')
        found.append([float(numbers[k]) if len(numbers) else math.nan for k in where])
    angles, speeds = found
    fault = 'neither angle nor speed is finite' if len(message.velocity) else 'angle is not finite'
    for joint, angle, speed in zip(joints, angles, speeds, strict=True):
        if not (math.isfinite(angle) or math.isfinite(speed)):
            return Refusal(stamp, SOURCE, joint, f'wheel {fault}')
    further = tuple(
        (angles[k], angles[k + 1], speeds[k], speeds[k + 1]) for k in range(2, len(joints), 2)
    )
    return WheelSample(stamp, angles[0], angles[1], speeds[0], speeds[1], further)
