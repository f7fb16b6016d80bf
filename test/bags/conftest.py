"""A recorded run, the labyrinth recording, and bags played over DDS into fresh nodes."""

from __future__ import annotations

import functools
import itertools
import math
import os
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from tablerunner.bags.labyrinth import convert_labyrinth
from tablerunner.bags.reader import BagReader
from tablerunner.bags.replay import Estimates, ReplayResult, replay
from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.geometry.angles import wrap
from tablerunner.scenario import Scenario, load_scenario
from tablerunner_bringup import parameters
from tablerunner_bringup.nodes import NODES
from tablerunner_bringup.run_options import RunOptions
from tablerunner_ros.conversions.odometry import odometry_from_message
from tablerunner_ros.conversions.pose import pose2_from_message
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Process, executable

COMMAND = (sys.executable, '-m', 'tablerunner.cli.main')
ROOT = Path(__file__).parents[2]
ROOM = Path(__file__).with_name('room.yaml')
ROUTE = ((4.2, 1.8), (6.8, 1.8), (7.0, 3.6), (4.4, 3.9), (2.0, 3.4), (1.6, 2.2))
STANDING_S, DRIVING_S = 2.0, 28.0
PIPELINE = ('uwb_driver', 'odom_node', 'fusion_node')
PARAMETERS = {spec.name: spec.parameters for spec in NODES}
SILENT = 'imu silent: heading from the wheels'
BESIDE = (SILENT, 'wheels slip')
"""What odom_node counts among its refusals beside the messages, all of which it took."""
LATE = ('ahead of odometry', 'older than the history')
"""Why ranges are refused when a node was not scheduled in time."""
TRIES = 4
ALLOWED = 0.004
"""Share of the messages of one stream that may get lost or be too late: five of some 1200 ranges.

Best effort promises nothing, and at the very start, before the first odometry, a range or two may
go either way. What these change is within the bounds of the tests.
"""


@dataclass(frozen=True)
class Drive:
    """A bag, with what is needed to run it through the nodes and through `replay`."""

    bag: Path
    scenario: Scenario
    inputs: tuple[str, ...]  # what is played
    known_start: bool

    def node_parameters(self, node: str) -> parameters.Parameters:
        """Return the parameters by which the launcher would start a node for this scenario."""
        options = RunOptions(
            scenario=str(self.bag.parent / 'scenario.yaml'),
            seed=3,
            unknown_start=not self.known_start,
            real_time_factor=2.0,
        )
        return PARAMETERS[node](self.scenario, options)

    def replay(self) -> ReplayResult:
        """Run the bag through `replay` with the settings of the same scenario."""
        config = ReplayConfig.from_scenario(self.scenario)
        if self.known_start:
            start = self.scenario.start_pose
            config = config.replace(
                localizer=config.localizer.replace(initial_pose=(start.x, start.y, start.heading))
            )
        with BagReader(self.bag) as bag:
            return replay(bag, config)

    @functools.cached_property
    def counts(self) -> Counter[str]:
        """How many messages of each topic the bag holds."""
        with BagReader(self.bag) as bag:
            return Counter({topic.name: topic.count for topic in bag.topics})

    @functools.cached_property
    def refusals(self) -> Counter[str]:
        """How often `replay` refuses for each reason: a busy machine leaves gaps in the bag."""
        found: Counter[str] = Counter()
        for (_, reason), count in self.replay().refusals.items():
            found[reason] += count
        return found


@dataclass(frozen=True)
class Played:
    """What fusion_node published while a bag was played.

    Attributes
    ----------
    initialised : int
        First stamp of map to odom, by which fusion_node says that it knows the start [ns].
    poses : dict of int to (x, y, heading)
        The last word on odometry/filtered for each stamp from then on [ns; m, m, rad].
    losses : tuple of str
        What did not reach the estimate because a process was not scheduled in time.
    rate : float
        The rate at which the bag was played.
    """

    initialised: int
    poses: dict[int, tuple[float, float, float]]
    losses: tuple[str, ...]
    rate: float


@dataclass(frozen=True)
class Difference:
    """Poses of two runs at the stamps that both have.

    Attributes
    ----------
    stamps : ndarray of int64, shape (n,)
        Common stamps [ns].
    distances, turns : ndarray, shape (n,)
        Distance [m] and absolute difference of heading [rad].
    deviations : ndarray, shape (n, 2)
        Standard deviation of position [m] and heading [rad] as the replay gives them.
    """

    stamps: np.ndarray
    distances: np.ndarray
    turns: np.ndarray
    deviations: np.ndarray

    def since(self, stamp: int) -> Difference:
        """Return the part that is later than a stamp [ns]."""
        rows = self.stamps > stamp
        columns = (self.stamps, self.distances, self.turns, self.deviations)
        return Difference(*(column[rows] for column in columns))

    def in_deviations(self) -> tuple[float, float]:
        """Return the largest differences of position and heading in standard deviations."""
        position, heading = self.deviations.T
        return float((self.distances / position).max()), float((self.turns / heading).max())

    def __str__(self) -> str:
        """Return the percentiles in one line."""
        words = []
        for share in (50, 90, 99, 100):
            metres, radians = (np.percentile(v, share) for v in (self.distances, self.turns))
            words.append(f'{share} %: {metres:.2g} m {radians:.2g} rad')
        position, heading = self.in_deviations()
        words.append(f'at most {position:.2f} and {heading:.2f} standard deviations')
        return f'{len(self.stamps)} stamps; ' + ', '.join(words)


@pytest.fixture(scope='session')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    """Return half a minute of driving among people, recorded beside the real nodes."""
    home = tmp_path_factory.mktemp('recorded')
    room = home / 'scenario.yaml'
    shutil.copyfile(ROOM, room)
    inputs = ('/joint_states', '/imu/data', '/uwb/exchanges')
    drive = Drive(home / 'bag', load_scenario(room), inputs, known_start=True)
    with lease_domain() as domain:
        arguments = ('record', '-o', drive.bag, '--use-sim-time')
        with (
            Process([*COMMAND, *arguments], domain) as recorder,
            Pipeline(drive, ('sim_bridge', *PIPELINE), domain, home) as probe,
        ):
            for topic in (*inputs, '/uwb/anchors', '/odometry/filtered', '/ground_truth'):
                probe.wait_for(
                    lambda topic=topic: f'{topic} [' in recorder.output,
                    f'the recording of {topic}:\n{recorder.output}',
                    90.0,
                )
            drive_around(probe)
            assert recorder.end() == 0, recorder.output
    with BagReader(drive.bag) as bag:
        assert not bag.damage
        assert {*inputs, '/uwb/anchors'} <= {item.name for item in bag.topics if item.count}
    return drive


def drive_around(probe: Probe) -> None:
    """Steer the simulated robot by the truth along `ROUTE`; it stands at first and at the end.

    As a controller would, this commands at each message of where the robot is. Where the machine
    is so busy that it falls silent, the base stops for a while, and no harm is done.
    """
    truth = probe.listen(Odometry, 'ground_truth')
    probe.speak(Twist, 'cmd_vel')
    probe.connected('cmd_vel', 60.0)
    probe.wait_for(lambda: truth, 'the robot to be somewhere', 60.0)
    begun = stamp_from_message(truth[-1].header.stamp)
    goals = itertools.cycle(ROUTE)
    goal = next(goals)
    seen = 0

    def step() -> bool:
        nonlocal goal, seen
        if len(truth) == seen:
            return False
        seen = len(truth)
        elapsed_s = (stamp_from_message(truth[-1].header.stamp) - begun) * 1e-9
        at = pose2_from_message(truth[-1].pose.pose)
        if math.hypot(goal[0] - at.x, goal[1] - at.y) < 0.4:
            goal = next(goals)
        command = Twist()
        if STANDING_S < elapsed_s < DRIVING_S:
            turn = wrap(math.atan2(goal[1] - at.y, goal[0] - at.x) - at.heading)
            command.linear.x = 0.6 * max(0.0, math.cos(turn)) ** 3
            command.angular.z = max(-1.2, min(1.2, 2.0 * turn))
        probe.publish('cmd_vel', command)
        return elapsed_s > DRIVING_S + STANDING_S

    probe.wait_for(step, 'the end of the drive', 300.0)
    places = np.array([(item.pose.pose.position.x, item.pose.pose.position.y) for item in truth])
    driven = float(np.hypot(*np.diff(places, axis=0).T).sum())
    assert driven > 4.0, f'the robot drove {driven:.1f} m only'


@pytest.fixture(scope='session')
def labyrinth(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    """Return the labyrinth recording as a bag, or skip."""
    given = os.environ.get('TABLERUNNER_DATA')
    source = (Path(given) if given else ROOT.parent / 'shared' / 'data') / 'labyrinth_tuc'
    if not source.is_dir():
        pytest.skip(
            f'the labyrinth recording is not at {source} (TABLERUNNER_DATA names its parent)'
        )
    bag = tmp_path_factory.mktemp('labyrinth') / 'bag'
    convert_labyrinth(source, bag)
    inputs = ('/uwb/anchors', '/joint_states', '/uwb/ranges')
    return Drive(bag, load_scenario(bag / 'scenario.yaml'), inputs, known_start=False)


@pytest.fixture
def play(tmp_path: Path) -> Callable[..., Played]:
    """Return a player of bags into fresh nodes.

    Everything is judged by measurement time, so that the rate is free: where the machine was too
    busy for all messages to be used, the bag is played again, into fresh nodes, at half the rate.
    """

    def play_slower(drive: Drive, rate: float) -> Played:
        for number in range(TRIES):
            folder = tmp_path / f'played_{number}'
            folder.mkdir()
            result = play_once(drive, rate / 2**number, folder)
            if not result.losses:
                return result
            print(f'played at rate {result.rate:g}: ' + '; '.join(result.losses))
        return result

    return play_slower


def play_once(drive: Drive, rate: float, folder: Path) -> Played:
    """Play the raw topics of a bag into nodes started for it, and listen to the estimate."""
    exchanges = '/uwb/exchanges' in drive.inputs
    nodes = PIPELINE if exchanges else PIPELINE[1:]
    with lease_domain() as domain, Pipeline(drive, nodes, domain, folder) as probe:
        heard = probe.listen(Odometry, 'odometry/filtered')
        transforms = probe.listen(TFMessage, 'tf')
        for node in nodes:
            probe.wait_for(lambda name=node: probe.diagnostic(name), f'{node} to be up', 60.0)
        if exchanges:  # uwb_driver says where the anchors are; otherwise the bag does
            probe.wait_diagnostic('fusion_node: uwb/anchors', 'taken', '1', 60.0)
        arguments = [drive.bag, '--rate', f'{rate:g}']
        for topic in drive.inputs:
            arguments += ['--topics', topic, '--wait-for', topic]
        with Process([*COMMAND, 'play', *arguments], domain) as player:
            probe.wait_for(lambda: not player.running, 'the end of the bag', 60.0 + 60.0 / rate)
            assert player.wait() == 0, player.output
        tally = Tally(probe, drive, nodes)
        for _ in range(5):
            before = len(heard)
            probe.spin(1.2)  # nodes report once a second
            if tally.is_complete() and len(heard) == before:
                break
        losses = tally.losses()
    placed = [
        stamp_from_message(item.header.stamp)
        for message in transforms
        for item in message.transforms
        if item.header.frame_id == 'map'
    ]
    assert placed, 'fusion_node never said where odom is in map'
    poses = {}
    for message in heard:
        sample = odometry_from_message(message, 'map', 'base_link', source='odometry/filtered')
        if sample.stamp >= min(placed):
            poses[sample.stamp] = (sample.pose.x, sample.pose.y, sample.pose.heading)
    return Played(min(placed), poses, losses, rate)


class Pipeline:
    """Nodes in a domain and a probe beside them; all of it ends with the block."""

    def __init__(self, drive: Drive, nodes: Sequence[str], domain: int, folder: Path) -> None:
        self._probe = Probe(domain)
        self._processes = []
        for node in nodes:
            file = folder / f'{node}.yaml'
            parameters.write(file, node, drive.node_parameters(node))
            command = [executable(node, node), '--ros-args', '--params-file', file]
            self._processes.append(Process(command, domain))

    def __enter__(self) -> Probe:
        return self._probe

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.__exit__(None, None, None)
        self._probe.close()


class Tally:
    """What the nodes say on diagnostics they have done with the messages of a bag."""

    def __init__(self, probe: Probe, drive: Drive, nodes: Sequence[str]) -> None:
        self._probe = probe
        self._due = {'odom_node: joint_states': drive.counts['/joint_states']}
        self._drive = drive
        self._imu = drive.counts['/imu/data']
        if self._imu:
            self._due['odom_node: imu/data'] = self._imu
        self._ranges = drive.counts['/uwb/ranges']
        if 'uwb_driver' in nodes:
            self._due['uwb_driver: uwb/exchanges'] = drive.counts['/uwb/exchanges']
            self._ranges = 0  # known when the driver has handled the exchanges

    def _values(self, name: str) -> dict[str, str]:
        status = self._probe.diagnostic(name)
        return {} if status is None else {item.key: item.value for item in status.values}

    def _handled(self, name: str) -> int:
        """Return how many messages were taken or refused."""
        values = self._values(name)
        beside = sum(
            int(value)
            for key, value in values.items()
            if any(key.startswith(f'refused: {reason}') for reason in BESIDE)
        )
        return int(values.get('taken', 0)) + int(values.get('refused', 0)) - beside

    def lost(self) -> dict[str, tuple[int, int]]:
        """Return how many messages of each stream were lost, and of how many."""
        exchanges = self._values('uwb_driver: uwb/exchanges').get('taken', self._ranges)
        due = {**self._due, 'fusion_node: uwb/ranges': int(exchanges)}
        return {name: (count - self._handled(name), count) for name, count in due.items()}

    def is_complete(self) -> bool:
        """Whether all messages have been handled; never, where best effort lost some."""
        return not any(missing for missing, _ in self.lost().values())

    def _refused(self, name: str, reason: str) -> int:
        """Return how often a stream was refused for a reason more than `replay` refuses."""
        key = f'refused: {reason}'
        told = sum(int(v) for k, v in self._values(name).items() if k.startswith(key))
        expected = sum(n for k, n in self._drive.refusals.items() if k.startswith(reason))
        return max(told - expected, 0)

    def losses(self) -> tuple[str, ...]:
        """Return in words what more was lost, or came too late, than `ALLOWED`."""
        found = []
        for name, (missing, count) in self.lost().items():
            late = sum(self._refused(name, reason) for reason in LATE)
            if missing + late > ALLOWED * count:
                found.append(f'{name}: {missing} of {count} lost, {late} too late')
        fallbacks = self._refused('odom_node: imu/data', SILENT)
        if self._imu and fallbacks:
            found.append(f'{SILENT}, {fallbacks} times')
        return tuple(found)


@pytest.fixture(scope='session')
def compare() -> Callable[[Estimates, Played], Difference]:
    """Return a comparison of estimates of a replay with what was published of a played bag."""

    def at_common_stamps(estimates: Estimates, played: Played) -> Difference:
        settled = estimates.settled()
        rows = [row for row, stamp in enumerate(settled.stamps) if int(stamp) in played.poses]
        ours = settled.poses[rows]
        theirs = np.array([played.poses[int(settled.stamps[row])] for row in rows])
        apart = (theirs - ours).reshape(len(rows), 3)
        turns = np.abs((apart[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        variances = np.diagonal(settled.covariances[rows], axis1=1, axis2=2)
        deviations = np.sqrt(
            np.stack([variances[:, 0] + variances[:, 1], variances[:, 2]], axis=1)
        )
        distances = np.hypot(apart[:, 0], apart[:, 1])
        return Difference(settled.stamps[rows], distances, turns, deviations)

    return at_common_stamps
