"""The topics of a bag as records of the core, in the order in which the nodes received them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from tablerunner.bags.reader import BagReader
from tablerunner.geometry.rotation import rotation_of_rpy
from tablerunner.messages.anchors import anchors_from_message
from tablerunner.messages.exchange import exchange_from_message
from tablerunner.messages.imu import imu_from_message, magnetic_from_message
from tablerunner.messages.innovation import innovation_from_message
from tablerunner.messages.odometry import odometry_from_message
from tablerunner.messages.pose import pose_from_message
from tablerunner.messages.truth import truth_from_message
from tablerunner.messages.ultrasonic import ultrasonic_from_message
from tablerunner.messages.uwb_range import range_from_message
from tablerunner.messages.wheels import LEFT_JOINT, RIGHT_JOINT, wheels_from_message

_DECODE_ERRORS = (AttributeError, TypeError, ValueError, IndexError)
Converter = Callable[[Any], Any]


class BagRecord(NamedTuple):
    """One message as a record of the core, or the refusal of a message that is none."""

    topic: str  # relative name as in the contract
    received: int  # [ns] time of reception
    record: Any  # record of tablerunner.types, TruePose, tuple of Anchor, or Refusal


@dataclass(frozen=True, slots=True)
class Names:
    """What messages are expected to be named; an empty frame stands for any.

    Attributes
    ----------
    left_joints, right_joints : tuple of str
        Joints of the drive wheels in joint_states, as many on the left as on the right.
    imu_heading, imu_tilt : float and tuple of float
        Heading, and roll and pitch, of the IMU's frame in base_link [rad].
    map_frame, odom_frame, base_frame : str
        Frames of poses and anchors, of odometry, and of the robot.
    """

    left_joints: tuple[str, ...] = (LEFT_JOINT,)
    right_joints: tuple[str, ...] = (RIGHT_JOINT,)
    imu_heading: float = 0.0
    map_frame: str = ''
    odom_frame: str = ''
    base_frame: str = ''
    imu_tilt: tuple[float, float] = (0.0, 0.0)


def converters(names: Names | None = None) -> dict[str, Converter]:
    """Return how the messages of each contract topic become records, by relative name."""
    use = names or Names()
    left, right, heading = use.left_joints, use.right_joints, use.imu_heading
    mount = rotation_of_rpy(*use.imu_tilt, heading)
    table: dict[str, Converter] = {
        'uwb/exchanges': exchange_from_message,
        'uwb/ranges': range_from_message,
        'uwb/anchors': lambda message: anchors_from_message(message, use.map_frame),
        'joint_states': lambda message: wheels_from_message(message, left, right),
        'imu/data': lambda message: imu_from_message(message, mount=mount),
        'imu/mag': lambda message: magnetic_from_message(message, heading),
        'innovations': innovation_from_message,
        'ground_truth': truth_from_message,
        'odom': _odometry('odom', use.odom_frame, use.base_frame),
        'odometry/filtered': _odometry('odometry/filtered', use.map_frame, use.base_frame),
    }
    for topic in ('uwb/pose', 'camera/pose', 'pose', 'initialpose'):
        table[topic] = _pose(topic, use.map_frame)
    for name in ('left', 'left_front', 'front', 'right_front', 'right'):
        table[f'ultrasonic/{name}'] = ultrasonic_from_message
    return table


def bag_records(
    bag: BagReader,
    topics: Collection[str],
    namespace: str = '',
    table: dict[str, Converter] | None = None,
) -> Iterator[BagRecord]:
    """Yield the records of some topics in the order of reception; other topics cost nothing.

    Parameters
    ----------
    bag : BagReader
        The bag; messages that lack a field are counted in its `damage`.
    topics : collection of str
        Relative names of the contract.
    namespace : str
        Namespace of the robot in the bag.
    table : dict, optional
        As returned by `converters`, which is used when not given.
    """
    table = converters() if table is None else table
    wanted = {full_name(topic, namespace): (topic, table[topic]) for topic in topics}
    for name, received, _, message in bag.messages(wanted):
        topic, convert = wanted[name]
        try:
            record = convert(message)
        except _DECODE_ERRORS as error:
            bag.refuse(name, received, f'not as this program knows the type ({error})')
            continue
        yield BagRecord(topic, received, record)


def full_name(topic: str, namespace: str = '') -> str:
    """Return the full name of a relative topic in a namespace."""
    return '/' + '/'.join(part for part in (namespace.strip('/'), topic.strip('/')) if part)


def _odometry(topic: str, frame: str, child: str) -> Converter:
    return lambda message: odometry_from_message(message, frame, child, topic)


def _pose(topic: str, frame: str) -> Converter:
    return lambda message: pose_from_message(message, frame, topic)
