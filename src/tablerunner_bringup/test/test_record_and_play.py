"""Recording and playing over DDS: what goes in comes out, byte for byte."""

from __future__ import annotations

import itertools
import signal
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import String

from tablerunner.bags.reader import BagReader
from tablerunner_interfaces.msg import UwbExchange
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Process, Processes

COMMAND = (sys.executable, '-m', 'tablerunner.cli.main')
RELIABLE = QoSProfile(depth=1000)
SENSOR = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LATE = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPICS: dict[str, tuple[type[Any], QoSProfile]] = {
    '/odom': (Odometry, RELIABLE),
    '/imu/data': (Imu, SENSOR),
    '/uwb/exchanges': (UwbExchange, SENSOR),
    '/map_name': (String, LATCHED),
}


class Speaker:
    """Publishes numbered messages on all topics and remembers their bytes."""

    def __init__(self, probe: Probe) -> None:
        self._probe = probe
        self.sent: dict[str, list[bytes]] = defaultdict(list)
        self._publishers = {
            topic: probe.node.create_publisher(type_, topic, profile)
            for topic, (type_, profile) in TOPICS.items()
        }
        self._say('/map_name', String(data='restaurant'))  # before anybody listens

    def wait_for_listeners(self) -> None:
        """Wait until every topic has a subscriber."""
        for topic, publisher in self._publishers.items():
            self._probe.wait_for(
                lambda p=publisher: p.get_subscription_count() > 0, f'a subscriber of {topic}'
            )

    def talk(self, count: int) -> None:
        """Publish `count` messages on each of the moving topics, 200 a second."""
        for number in range(count):
            odometry = Odometry()
            odometry.header.stamp.sec = number
            odometry.pose.pose.position.x = 0.1 * number
            self._say('/odom', odometry)
            imu = Imu()
            imu.angular_velocity.z = float(number)
            self._say('/imu/data', imu)
            self._say('/uwb/exchanges', UwbExchange(anchor_id=f'A{number % 4}', sequence=number))
            self._probe.spin(0.005)

    def _say(self, topic: str, message: Any) -> None:
        # Published as bytes: padding inside a message is whatever was in memory, and each call of
        # the serialiser finds something else there. On the wire it is padded to four bytes.
        data = serialize_message(message)
        data += bytes(-len(data) % 4)
        self.sent[topic].append(data)
        self._publishers[topic].publish(data)


class Listener:
    """Keeps the bytes of what it hears, all topics in one order."""

    def __init__(self, probe: Probe, topics: tuple[str, ...] = tuple(TOPICS)) -> None:
        self.heard: dict[str, list[bytes]] = defaultdict(list)
        self.order: list[str] = []
        for topic in topics:
            type_, profile = TOPICS[topic]
            wanted = LATE if profile is LATCHED else profile
            probe.node.create_subscription(
                type_, topic, lambda data, topic=topic: self._keep(topic, data), wanted, raw=True
            )

    def _keep(self, topic: str, data: bytes) -> None:
        self.heard[topic].append(data)
        self.order.append(topic)


@pytest.fixture
def record(processes: Processes, tmp_path: Path) -> Callable[..., tuple[Process, Path]]:
    """Return a starter of `tablerunner record`."""

    def start(*arguments: str) -> tuple[Process, Path]:
        folder = tmp_path / 'bag'
        return processes.start(*COMMAND, 'record', '-o', folder, *arguments), folder

    return start


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, list[bytes]]]:
    """Return a recorded bag and what was published meanwhile; nobody speaks any more."""
    folder = tmp_path_factory.mktemp('recorded') / 'bag'
    with lease_domain() as number:
        speaking = Probe(number, 'speaker')
        speaker = Speaker(speaking)
        with Process([*COMMAND, 'record', '-o', folder], number) as recorder:
            speaker.wait_for_listeners()
            speaker.talk(100)
            assert recorder.end() == 0, recorder.output
        speaking.close()
    return folder, dict(speaker.sent)


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_record_all_topics_bag_holds_every_byte(record, probe, storage):
    """Both storages hold all messages in order, with definitions; `rosbags` opens them."""
    speaker = Speaker(probe)
    recorder, folder = record('--format', storage)
    speaker.wait_for_listeners()
    speaker.talk(60)
    assert recorder.end() == 0, recorder.output
    with Reader(folder) as reader:
        found: dict[str, list[bytes]] = defaultdict(list)
        for connection, _, data in reader.messages():
            found[connection.topic].append(bytes(data))
        definitions = {item.msgtype: item.msgdef.data for item in reader.connections}
    for topic in TOPICS:
        assert found[topic] == speaker.sent[topic], topic
    assert 'uint64 poll_tx' in definitions['tablerunner_interfaces/msg/UwbExchange']


def test_record_chosen_topics_leaves_out_others(record, probe):
    """Only what was asked for is in the bag; a star stands for any name."""
    speaker = Speaker(probe)
    recorder, folder = record('--topics', '/uwb/*', '--topics', 'odom')
    probe.wait_for(lambda: '/odom [' in recorder.output, 'the recording of odom')
    probe.wait_for(lambda: '/uwb/exchanges [' in recorder.output, 'that of uwb')
    probe.spin(0.3)
    speaker.talk(20)
    assert recorder.end() == 0
    with BagReader(folder) as reader:
        assert {topic.name for topic in reader.topics} == {'/odom', '/uwb/exchanges'}


def test_record_killed_bag_is_readable(record, probe):
    """A recorder that is killed loses no more than its last seconds."""
    speaker = Speaker(probe)
    recorder, folder = record()
    speaker.wait_for_listeners()
    speaker.talk(50)
    probe.spin(1.5)  # it writes to disk once a second
    recorder.send(signal.SIGKILL)
    recorder.wait()
    with BagReader(folder) as reader:
        found = [message.data for message in reader.raw(['/odom'])]
        assert reader.damage  # it says so
    assert found == speaker.sent['/odom']


def test_record_sim_time_stamps_with_clock(record, probe):
    """Under simulated time the stamps are those of /clock, also of what came before it."""
    speaker = Speaker(probe)
    clock = probe.node.create_publisher(Clock, '/clock', QoSProfile(depth=1))
    recorder, folder = record('--use-sim-time', '--topics', '/map_name', '--topics', '/odom')
    probe.wait_for(lambda: '/map_name [' in recorder.output, 'the recording to begin')
    probe.wait_for(lambda: '/odom [' in recorder.output, 'the recording to begin')
    probe.spin(0.5)  # the latched message comes now, before any clock
    for second in (100, 200):
        message = Clock()
        message.clock.sec = second
        clock.publish(message)
        probe.spin(0.2)
        speaker.talk(1)
        probe.spin(0.2)
    assert recorder.end() == 0, recorder.output
    with BagReader(folder) as reader:
        stamps = [(item.topic, item.stamp // 10**9) for item in reader.raw()]
    assert stamps == [('/map_name', 100), ('/odom', 100), ('/odom', 200)]


def test_record_existing_folder_is_refused(record, processes, tmp_path):
    """A bag is never written over."""
    (tmp_path / 'bag').mkdir()
    recorder, _ = record()
    assert recorder.wait() == 2
    assert 'exists' in recorder.output


def test_play_bag_listener_gets_every_byte_in_order(bag, probe, processes):
    """All messages arrive, reliable ones and latched ones included, in the order recorded."""
    folder, sent = bag
    listener = Listener(probe)
    player = processes.start(*COMMAND, 'play', folder, '--wait-for', '/odom')
    probe.wait_for(lambda: not player.running, 'the end of the bag', 30.0)
    probe.spin(0.3)
    assert player.wait() == 0, player.output
    for topic in TOPICS:
        assert listener.heard[topic] == sent[topic], topic


def test_play_rate_start_topics_and_remap_are_obeyed(bag, probe, processes):
    """Half the bag, one topic under a new name, and the latched past all the same."""
    folder, sent = bag
    heard: list[bytes] = []
    probe.node.create_subscription(Odometry, '/other', heard.append, RELIABLE, raw=True)
    listener = Listener(probe)
    with BagReader(folder) as reader:
        middle_s = (reader.end - reader.start) * 0.5e-9
    player = processes.start(
        *(*COMMAND, 'play', folder, '--start', f'{middle_s:.3f}', '--rate', '4'),
        *('--topics', '/odom', '--topics', '/map_name', '--remap', 'odom:=other'),
        *('--wait-for', '/other', '--wait-for', 'map_name'),
    )
    probe.wait_for(lambda: not player.running, 'the end of the bag', 30.0)
    probe.spin(0.3)
    assert player.wait() == 0, player.output
    assert sent['/odom'][-len(heard) :] == heard
    assert 30 < len(heard) < 70
    assert listener.heard['/map_name'] == sent['/map_name']
    assert not listener.heard['/odom']
    assert not listener.heard['/imu/data']


def test_play_clock_runs_with_the_bag(bag, probe, processes):
    """The clock goes from the first stamp to the last and is never behind by more than 30 ms."""
    folder, _ = bag
    with BagReader(folder) as reader:
        start, end = reader.start, reader.end
    times = []
    probe.node.create_subscription(
        Clock,
        '/clock',
        lambda message: times.append(message.clock.sec * 10**9 + message.clock.nanosec),
        RELIABLE,
    )
    player = processes.start(*COMMAND, 'play', folder, '--wait-for', '/clock')
    probe.wait_for(lambda: not player.running, 'the end', 30.0)
    assert player.wait() == 1  # the clock is the player's own
    assert 'waited for' in player.output
    player = processes.start(*COMMAND, 'play', folder)
    probe.wait_for(lambda: not player.running, 'the end of the bag', 30.0)
    assert player.wait() == 0, player.output
    probe.spin(0.2)
    assert times, player.output
    assert times == sorted(times)
    assert times[0] == start
    assert end - times[-1] < 30_000_000
    steps = [later - earlier for earlier, later in itertools.pairwise(times)]
    assert len(steps) > (end - start) / 30_000_000


def test_play_nobody_listens_fails_in_time(bag, processes):
    """Whoever has to listen and does not is named, and the exit code is 1."""
    folder, _ = bag
    player = processes.start(*COMMAND, 'play', folder, '--wait-for', '/odom', '--wait-limit', '1')
    assert player.wait() == 1
    assert '/odom' in player.output


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('nowhere',), 'no bag'),
        (('nowhere', '--rate', '0'), 'rate'),
        (('nowhere', '--remap', 'odom=other'), 'OLD:=NEW'),
    ],
)
def test_play_bad_input_is_refused(processes, arguments, words):
    """What cannot be used is said in one line, with exit code 2."""
    player = processes.start(*COMMAND, 'play', *arguments)
    assert player.wait() == 2
    assert words in player.output
