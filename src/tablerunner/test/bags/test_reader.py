"""Round trips of every contract topic, and the order of messages."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.definitions import known_types
from tablerunner.bags.reader import BagReader
from tablerunner.bags.streams import bag_records, converters
from tablerunner.bags.writer import STORAGES, BagWriter, OfferedQuality
from tablerunner.errors import BagError
from tablerunner.geometry.pose import Pose2
from tablerunner.messages.truth import TruePose
from tablerunner.messages.wheels import LEFT_JOINT, RIGHT_JOINT
from tablerunner.types import (
    Anchor,
    ExchangeSample,
    ImuSample,
    Innovation,
    LosState,
    MagneticSample,
    OdometrySample,
    PoseSample,
    RangeSample,
    UltrasonicSample,
    Velocity,
    WheelSample,
)

STAMP = 1_700_000_000_123_456_789
COVARIANCE = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 0.02]])
TWIST_COVARIANCE = np.array([[0.1, 0.01], [0.01, 0.2]])
ODOMETRY = OdometrySample(STAMP, Pose2(1.5, -2.5, 0.7), 0.4, -0.2, COVARIANCE, TWIST_COVARIANCE)
RECORDS: dict[str, Any] = {
    'uwb/exchanges': ExchangeSample(
        STAMP, 'A0', 'tag', 7, 2**40 - 1, 12, 13, 14, 15, 2**39, -80.5, -82.25
    ),
    'uwb/ranges': RangeSample(
        STAMP, 'A1', 'tag', 8, 4.25, 0.01, 4.5, -80.5, -82.25, LosState.NLOS, 0.75
    ),
    'uwb/anchors': (
        Anchor('A0', (0.0, 1.0, 2.25), 0.1, 0.04),
        Anchor('A1', (5.0, 1.0, 2.25), -0.1, 0.0),
    ),
    'joint_states': WheelSample(STAMP, 1.25, -3.5, 2.0, 2.5),
    'imu/data': ImuSample(STAMP, 0.3, 0.1, -0.2, 0.5, 1e-4),
    'imu/mag': MagneticSample(STAMP, 2e-5, -1e-5, 4e-5),
    'ultrasonic/left': UltrasonicSample(STAMP, 'ultrasonic_left', math.inf, 0.03125, 4.0, 0.5),
    'odom': ODOMETRY,
    'odometry/filtered': ODOMETRY,
    'ground_truth': TruePose(STAMP, Pose2(1.5, -2.5, 0.7), True),
    'innovations': Innovation(
        STAMP, 'uwb/ranges', 'A0', True, '', np.array([0.1]), np.array([[0.02]]), 0.5, 9.0
    ),
    **{
        topic: PoseSample(STAMP, Pose2(3.0, 4.0, -1.0), COVARIANCE, topic)
        for topic in ('uwb/pose', 'camera/pose', 'pose', 'initialpose')
    },
}


def example_message(topic: str) -> Any:
    """Return a message of a contract topic that has no default value where it can have another."""
    record = RECORDS.get(topic)
    builders: dict[type, Any] = {
        ExchangeSample: lambda: messages.exchange_message(record, 'uwb_tag'),
        RangeSample: lambda: messages.range_message(record, 'uwb_tag'),
        tuple: lambda: messages.anchors_message(record, STAMP, 'map'),
        WheelSample: lambda: messages.wheels_message(record, LEFT_JOINT, RIGHT_JOINT),
        ImuSample: lambda: messages.imu_message(record, 'imu_link'),
        MagneticSample: lambda: messages.magnetic_message(record, 'imu_link'),
        UltrasonicSample: lambda: messages.ultrasonic_message(record),
        OdometrySample: lambda: messages.odometry_message(record, 'odom', 'base_link'),
        TruePose: lambda: messages.odometry_message(ODOMETRY, 'map', 'base_link'),
        Innovation: lambda: messages.innovation_message(record, 'map', 'ekf'),
        PoseSample: lambda: messages.pose_message(record, 'map'),
    }
    if type(record) in builders:
        return builders[type(record)]()
    path = (Pose2(1.0, 2.0, 3.0), Pose2(2.0, 2.0, 3.0))
    return {
        'clock': lambda: messages.clock_message(STAMP),
        'goal_pose': lambda: messages.goal_message(path[0], STAMP, 'map'),
        'waypoints': lambda: messages.path_message(path, STAMP, 'map'),
        'cmd_vel': lambda: messages.twist_message(Velocity(0.5, -0.25)),
        'cmd_vel_nav': lambda: messages.twist_message(Velocity(0.5, 0.25)),
        'tf': lambda: messages.transforms_message([(STAMP, 'map', 'odom', path[0])]),
        'tf_static': lambda: messages.transforms_message([(STAMP, 'base_link', 'tag', path[0])]),
        'diagnostics': _diagnostics,
        **{
            f'ultrasonic/{name}': lambda: messages.ultrasonic_message(RECORDS['ultrasonic/left'])
            for name in ('left_front', 'front', 'right_front', 'right')
        },
    }[topic]()


def _diagnostics() -> Any:
    return messages.make(
        'diagnostic_msgs/msg/DiagnosticArray',
        header=messages.header(STAMP, ''),
        status=[
            messages.make(
                'diagnostic_msgs/msg/DiagnosticStatus',
                level=1,
                name='fusion',
                message='aligning',
                hardware_id='',
                values=[messages.make('diagnostic_msgs/msg/KeyValue', key='a', value='b')],
                OK=0,
                WARN=1,
                ERROR=2,
                STALE=3,
            )
        ],
    )


def same(left: Any, right: Any) -> bool:
    """Return whether two messages or records hold the same, NaN equal to NaN."""
    if dataclasses.is_dataclass(left):
        names = [field.name for field in dataclasses.fields(left)]
        return all(same(getattr(left, name), getattr(right, name)) for name in names)
    if isinstance(left, (list, tuple)):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, np.ndarray):
        return bool(np.array_equal(left, np.asarray(right), equal_nan=left.dtype.kind == 'f'))
    if isinstance(left, float) and math.isnan(left):
        return math.isnan(right)
    return bool(left == right)


def close(left: Any, right: Any) -> bool:
    """Return whether two records hold the same, headings to the rounding of a quaternion."""
    if dataclasses.is_dataclass(left) or isinstance(left, TruePose):
        names = (
            left._fields
            if isinstance(left, TruePose)
            else [field.name for field in dataclasses.fields(left)]
        )
        return all(close(getattr(left, name), getattr(right, name)) for name in names)
    if isinstance(left, tuple):
        return all(map(close, left, right))
    if isinstance(left, float):
        return left == pytest.approx(right, abs=1e-12)
    return same(left, right)


@pytest.fixture(params=STORAGES)
def full_bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a bag with one message of each contract topic."""
    path = tmp_path / 'full'
    with BagWriter(path, request.param) as bag:
        for topic, contract in CONTRACT.items():
            bag.add_topic(topic, contract.msgtype, contract.quality)
        for number, topic in enumerate(CONTRACT):
            bag.write(topic, STAMP + number, example_message(topic))
    return path


def test_bag_round_trip_every_topic_gives_equal_messages(full_bag: Path) -> None:
    """Every field of every contract topic comes back as it was written, in order."""
    with BagReader(full_bag) as bag:
        found = list(bag.messages())
        assert bag.damage == ()
    assert [item.topic for item in found] == [f'/{topic}' for topic in CONTRACT]
    assert [item.stamp for item in found] == [STAMP + number for number in range(len(CONTRACT))]
    for item in found:
        assert item.msgtype == CONTRACT[item.topic[1:]].msgtype
        assert same(example_message(item.topic[1:]), item.message), item.topic


def test_bag_records_every_record_topic_gives_equal_records(full_bag: Path) -> None:
    """Records come back through message, bytes and disk."""
    with BagReader(full_bag) as bag:
        found = {item.topic: item.record for item in bag_records(bag, list(converters()))}
    assert set(RECORDS) <= set(found)
    for topic, record in RECORDS.items():
        assert close(record, found[topic]), topic


def test_bag_plain_rosbags_opens_it_with_own_definitions(full_bag: Path) -> None:
    """A reader that has never heard of Tablerunner reads it by the definitions inside."""
    with AnyReader([full_bag]) as reader:
        found = {
            connection.topic: reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
        }
        quality = {
            connection.topic: connection.ext.offered_qos_profiles[0]
            for connection in reader.connections
        }
    assert found['/uwb/ranges'].nlos_probability == 0.75
    assert found['/uwb/anchors'].anchors[1].anchor_id == 'A1'
    assert found['/innovations'].estimator == 'ekf'
    assert quality['/imu/data'].reliability.name == 'BEST_EFFORT'
    assert quality['/uwb/anchors'].durability.name == 'TRANSIENT_LOCAL'
    assert quality['/odom'].depth == 10


@pytest.mark.parametrize('storage', STORAGES)
def test_bag_equal_stamps_keep_order_of_writing(tmp_path: Path, storage: str) -> None:
    """At one time the order of writing decides; late messages go to their time."""
    with BagWriter(tmp_path / 'bag', storage) as bag:
        for topic in ('b', 'a'):
            bag.add_topic(topic, 'rosgraph_msgs/msg/Clock')
        for value, (topic, stamp) in enumerate([('b', 5), ('a', 5), ('b', 5), ('a', 3), ('b', 4)]):
            bag.write(topic, stamp, messages.clock_message(value))
    with BagReader(tmp_path / 'bag') as reader:
        found = [
            (item.stamp, item.topic, item.message.clock.nanosec) for item in reader.messages()
        ]
    assert found == [(3, '/a', 3), (4, '/b', 4), (5, '/b', 0), (5, '/a', 1), (5, '/b', 2)]


@pytest.mark.parametrize('storage', STORAGES)
def test_bag_chosen_topics_only_those_come(full_bag: Path, storage: str) -> None:
    with BagReader(full_bag) as bag:
        assert {item.topic for item in bag.raw(['/odom', '/clock'])} == {'/odom', '/clock'}


@pytest.mark.parametrize(
    ('storage', 'mode'),
    [
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
    ],
)
def test_bag_compressed_reads_as_rosbags_does(
    tmp_path: Path, storage: StoragePlugin, mode: CompressionMode
) -> None:
    """Compressed bags of others: chunks, messages or whole files; several chunks."""
    types, path = known_types(), tmp_path / 'bag'
    writer = Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    random = np.random.default_rng(3)
    with writer:
        topic = writer.add_connection('/odom', 'nav_msgs/msg/Odometry', typestore=types)
        for number in range(4000):
            record = dataclasses.replace(ODOMETRY, linear_m_s=float(random.normal()))
            message = messages.odometry_message(record, 'odom', 'base_link')
            writer.write(topic, number, types.serialize_cdr(message, 'nav_msgs/msg/Odometry'))
    with BagReader(path) as bag:
        ours = [(item.stamp, item.message.twist.twist.linear.x) for item in bag.messages()]
        assert bag.damage == ()
    with AnyReader([path]) as reader:
        theirs = [
            (stamp, reader.deserialize(data, connection.msgtype).twist.twist.linear.x)
            for connection, stamp, data in reader.messages()
        ]
    assert len(ours) == 4000
    assert ours == theirs


def test_bag_single_file_reads_without_folder(full_bag: Path) -> None:
    """An .mcap or .db3 file alone is a bag."""
    file = next(file for file in full_bag.iterdir() if file.suffix in ('.mcap', '.db3'))
    with BagReader(file) as bag:
        assert bag.message_count == len(CONTRACT)
        assert bag.damage == ()


def test_reader_nothing_there_raises(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='there is no bag'):
        BagReader(tmp_path / 'missing')
    with pytest.raises(BagError, match=r'holds no \.mcap'):
        BagReader(tmp_path)
    (tmp_path / 'notes.txt').write_text('hello')
    with pytest.raises(BagError, match='not a bag'):
        BagReader(tmp_path / 'notes.txt')


def test_writer_existing_folder_raises(full_bag: Path) -> None:
    with pytest.raises(BagError, match='never written over'):
        BagWriter(full_bag)


def test_writer_wrong_use_raises(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='known are mcap, sqlite3'):
        BagWriter(tmp_path / 'a', 'rosbag1')
    with BagWriter(tmp_path / 'b') as bag:
        bag.add_topic('odom', 'nav_msgs/msg/Odometry', OfferedQuality(keep_all=True))
        with pytest.raises(BagError, match='announced twice'):
            bag.add_topic('/odom', 'nav_msgs/msg/Odometry')
        with pytest.raises(BagError, match='no definition of nowhere/msg/Nothing'):
            bag.add_topic('x', 'nowhere/msg/Nothing')
        with pytest.raises(BagError, match='was not announced'):
            bag.write_raw('y', 1, b'')


@pytest.mark.parametrize('storage', STORAGES)
def test_writer_flush_leaves_what_was_written(tmp_path: Path, storage: str) -> None:
    """What was flushed is there although the bag was never closed."""
    bag = BagWriter(tmp_path / 'bag', storage)
    bag.add_topic('clock', CONTRACT['clock'].msgtype)
    for stamp in range(1, 11):
        bag.write('clock', stamp, messages.clock_message(stamp))
    bag.flush()
    with BagReader(tmp_path / 'bag') as reader:
        assert [item.stamp for item in reader.messages()] == list(range(1, 11))
        assert any('metadata' in str(item) for item in reader.damage)
    bag.discard()
    assert not (tmp_path / 'bag').exists()
