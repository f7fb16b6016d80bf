"""Replay: the same every time, from the rawest topics, right against the truth."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace as changed
from pathlib import Path

import numpy as np
import pytest

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.labyrinth import convert_labyrinth
from tablerunner.bags.reader import BagReader
from tablerunner.bags.replay import ReplayResult, replay
from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.bags.writer import BagWriter
from tablerunner.errors import BagError
from tablerunner.estimation import LocalizerState
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario, load_scenario
from tablerunner.types import ImuSample, PoseSample, RangeSample, WheelSample

BOUND_LABYRINTH_M = 0.18


def run(bag: Path, config: ReplayConfig) -> ReplayResult:
    """Replay a bag."""
    with BagReader(bag) as reader:
        return replay(reader, config)


def as_bytes(result: ReplayResult) -> bytes:
    """Return everything that a replay found, byte for byte."""
    estimates = result.estimates
    arrays = (estimates.stamps, estimates.poses, estimates.covariances, estimates.trusted)
    innovations = [
        (
            item.stamp,
            item.source,
            item.key,
            item.accepted,
            item.reason,
            item.innovation.tobytes(),
            item.covariance.tobytes(),
            item.nis,
        )
        for item in result.innovations
    ]
    fixes = [(fix.stamp, fix.pose, fix.covariance.tobytes()) for fix in result.fixes]
    return pickle.dumps(
        ([array.tobytes() for array in arrays], innovations, fixes, result.refusals)
    )


def copy_bag(
    source: Path,
    target: Path,
    change: Callable[[str, int, bytes], list[tuple[str, int, bytes]]],
    storage: str = 'mcap',
) -> Path:
    """Copy a bag message by message; `change` returns what to write for each."""
    with BagReader(source) as reader, BagWriter(target, storage) as writer:
        for topic in reader.topics:
            writer.add_topic(topic.name, topic.msgtype)
        for raw in reader.raw():
            for topic_name, stamp, data in change(raw.topic, raw.stamp, raw.data):
                writer.write_raw(topic_name, stamp, data)
    return target


@pytest.fixture(scope='module')
def config(restaurant: Scenario) -> ReplayConfig:
    return ReplayConfig.from_scenario(restaurant)


@pytest.fixture(scope='module')
def first(simulated_bag: Path, config: ReplayConfig) -> ReplayResult:
    """Return one replay of the simulated drive, with fixes."""
    return run(simulated_bag, changed(config, fixes=True))


def test_replay_config_is_what_the_scenario_says(restaurant: Scenario) -> None:
    robot = changed(restaurant.robot, wheel_radius=0.07, track=0.3, tag_position=(0.1, -0.02, 0.9))
    config = ReplayConfig.from_scenario(changed(restaurant, robot=robot))
    assert config.odometer.wheels.wheel_radius == 0.07
    assert config.odometer.wheels.track == 0.3
    assert config.localizer.tag_position == (0.1, -0.02, 0.9)
    assert config.positioner.tag_height == 0.9
    assert config.ranger.anchors == tuple(place.anchor for place in restaurant.anchors)


def test_replay_twice_is_identical_byte_for_byte(
    simulated_bag: Path, config: ReplayConfig, first: ReplayResult
) -> None:
    assert as_bytes(run(simulated_bag, changed(config, fixes=True))) == as_bytes(first)


def test_replay_other_storage_is_identical_byte_for_byte(
    simulated_bag: Path, config: ReplayConfig, first: ReplayResult, tmp_path: Path
) -> None:
    """How a bag is stored does not change what comes out of it."""
    copy = copy_bag(
        simulated_bag, tmp_path / 'copy', lambda *message: [message], storage='sqlite3'
    )
    assert as_bytes(run(copy, changed(config, fixes=True))) == as_bytes(first)


def test_replay_simulated_drive_finds_its_start_and_follows(first: ReplayResult) -> None:
    """From no known pose to a few decimetres, from exchanges, wheels and IMU."""
    assert first.sources == ('joint_states', 'imu/data', 'uwb/exchanges', 'ground_truth')
    assert first.state is LocalizerState.TRACKING
    assert first.initialised is not None
    assert (first.initialised - first.first_stamp) * 1e-9 < 15.0
    assert first.initialised == first.estimates.settled().stamps[0]
    summary = first.errors.summary()
    assert summary.count > 500
    assert summary.rmse < 0.4
    assert first.by_source()['uwb/ranges'].accepted > 0.8
    assert first.data_s == pytest.approx(30.0, abs=0.1)
    assert len(first.fixes) > 100
    assert first.damage == ()


def test_replay_start_given_is_trusted_at_once(
    simulated_bag: Path, config: ReplayConfig, restaurant: Scenario
) -> None:
    start = restaurant.start_pose
    given = changed(
        config,
        localizer=changed(config.localizer, initial_pose=(start.x, start.y, start.heading)),
    )
    result = run(simulated_bag, given)
    assert result.initialised is not None
    assert (result.initialised - result.first_stamp) * 1e-9 < 0.1
    assert result.errors.distances[0] < 0.05


def test_replay_takes_the_compass_only_when_asked(
    simulated_bag: Path, config: ReplayConfig, first: ReplayResult
) -> None:
    """Fields that are plausible become headings; the others are refused with a reason."""
    assert 'imu/mag' not in first.by_source()
    compass = config.localizer.compass.replace(use=True, north=np.pi / 2)
    asked = changed(config, localizer=changed(config.localizer, compass=compass))
    result = run(simulated_bag, asked)
    assert result.by_source()['imu/mag'].accepted > 0.5
    assert set(result.refusals) >= {('imu/mag', 'start not known yet')}


def test_replay_dead_reckoning_accepts_no_range(
    simulated_bag: Path, config: ReplayConfig, restaurant: Scenario
) -> None:
    start = restaurant.start_pose
    result = run(
        simulated_bag,
        changed(
            config,
            localizer=changed(
                config.localizer,
                estimator='dead_reckoning',
                initial_pose=(start.x, start.y, start.heading),
            ),
        ),
    )
    assert result.estimator == 'dead_reckoning'
    assert all(not item.accepted for item in result.innovations)


def test_replay_settled_takes_last_of_equal_stamps(first: ReplayResult) -> None:
    """Of several estimates at one time the last counts, and only trusted ones."""
    settled = first.estimates.settled()
    assert (np.diff(settled.stamps) > 0).all()
    trusted = first.estimates.trusted
    for row in (0, len(settled.stamps) // 2, -1):
        same = np.flatnonzero(trusted & (first.estimates.stamps == settled.stamps[row]))
        np.testing.assert_array_equal(settled.poses[row], first.estimates.poses[same[-1]])


def test_replay_without_scenario_uses_anchors_of_the_bag(
    simulated_bag: Path, config: ReplayConfig, restaurant: Scenario
) -> None:
    unknown = changed(config, ranger=changed(config.ranger, anchor_ids=(), anchor_positions=()))
    result = run(simulated_bag, unknown)
    assert result.anchors == tuple(place.anchor for place in restaurant.anchors)
    assert result.initialised is not None


def test_replay_no_anchors_anywhere_raises(simulated_bag: Path, tmp_path: Path) -> None:
    copy = copy_bag(
        simulated_bag,
        tmp_path / 'copy',
        lambda topic, stamp, data: [] if topic == '/uwb/anchors' else [(topic, stamp, data)],
    )
    with pytest.raises(BagError, match='does not say where the anchors are'):
        run(copy, ReplayConfig())


def test_replay_no_odometry_raises(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic('clock', CONTRACT['clock'].msgtype)
    with pytest.raises(BagError, match='neither joint_states nor odom'):
        run(tmp_path / 'bag', ReplayConfig())
    with pytest.raises(BagError, match='in namespace robot1'):
        run(tmp_path / 'bag', ReplayConfig(namespace='robot1'))


def test_replay_late_messages_come_late(
    simulated_bag: Path, config: ReplayConfig, first: ReplayResult, tmp_path: Path
) -> None:
    """Exchanges that arrive 0.2 s late are put in their place; half a minute late ones are not."""
    late = copy_bag(
        simulated_bag,
        tmp_path / 'late',
        lambda topic, stamp, data: [
            (topic, stamp + (200_000_000 if topic == '/uwb/exchanges' else 0), data)
        ],
    )
    result = run(late, config)
    assert result.initialised is not None
    final = result.errors.errors[-1, :2] - first.errors.errors[-1, :2]
    assert np.hypot(*final) < 0.05
    stale = copy_bag(
        simulated_bag,
        tmp_path / 'stale',
        lambda topic, stamp, data: [
            (topic, stamp + (30_000_000_000 if topic == '/uwb/exchanges' else 0), data)
        ],
    )
    refused = run(stale, config)
    assert not any(item.accepted for item in refused.innovations)


def test_replay_stamp_of_the_future_is_refused(
    simulated_bag: Path, config: ReplayConfig, tmp_path: Path
) -> None:
    """A stamp a second ahead of the reception is refused as the nodes refuse it."""
    early = copy_bag(
        simulated_bag,
        tmp_path / 'early',
        lambda topic, stamp, data: [
            (topic, stamp - (1_000_000_000 if topic == '/imu/data' else 0), data)
        ],
    )
    result = run(early, config)
    assert result.refusals['imu/data', 'stamp in the future'] > 2000


def test_replay_broken_values_are_refused_and_counted(tmp_path: Path) -> None:
    """NaN, unknown anchors and missing joints reach the counts, not the estimate."""
    nan = float('nan')
    bag = tmp_path / 'bag'
    with BagWriter(bag) as writer:
        for topic in ('joint_states', 'imu/data', 'uwb/ranges', 'uwb/anchors'):
            writer.add_topic(topic, CONTRACT[topic].msgtype)
        for step in range(100):
            stamp = 1_000_000_000 + step * 20_000_000
            wheels = WheelSample(stamp, 0.1 * step, 0.1 * step)
            joints = ('left_wheel_joint', 'right_wheel_joint' if step % 10 else 'other')
            writer.write('joint_states', stamp, messages.wheels_message(wheels, *joints))
            imu = messages.imu_message(ImuSample(stamp, nan if step % 5 == 0 else 0.0), 'imu')
            writer.write('imu/data', stamp, imu)
            sample = RangeSample(stamp, 'A9', 'tag', step, 1.0, 0.01)
            writer.write('uwb/ranges', stamp, messages.range_message(sample, 'uwb_tag'))
    config = ReplayConfig().with_anchors(
        tuple(changed(anchor) for anchor in load_scenario_anchors(tmp_path))
    )
    refusals = run(bag, config).refusals
    assert refusals['joint_states', 'joint is missing'] == 10
    assert refusals['imu/data', 'turn rate is not finite'] == 20
    assert sum(count for (source, _), count in refusals.items() if source == 'uwb/ranges') == 100


def load_scenario_anchors(folder: Path) -> tuple[object, ...]:
    """Return three anchors by way of a scenario file."""
    file = folder / 'scenario.yaml'
    file.write_text(
        'name: three\nanchors:\n'
        '- {id: A0, position: [0, 0, 2]}\n'
        '- {id: A1, position: [9, 0, 2]}\n'
        '- {id: A2, position: [0, 9, 2]}\n'
    )
    return tuple(place.anchor for place in load_scenario(file).anchors)


def test_replay_initial_pose_of_the_bag_is_used(
    simulated_bag: Path, config: ReplayConfig, restaurant: Scenario, tmp_path: Path
) -> None:
    """Whoever clicked in RViz while recording has clicked in the replay too."""
    start = restaurant.start_pose
    bag = tmp_path / 'bag'
    with BagReader(simulated_bag) as reader, BagWriter(bag) as writer:
        for topic in reader.topics:
            writer.add_topic(topic.name, topic.msgtype)
        writer.add_topic('initialpose', CONTRACT['initialpose'].msgtype)
        for raw in reader.raw():
            if raw.stamp == reader.start + 300_000_000 and raw.topic == '/joint_states':
                click = PoseSample(
                    raw.stamp, Pose2(start.x, start.y, start.heading), np.eye(3) * 0.01
                )
                writer.write('initialpose', raw.stamp, messages.pose_message(click, 'map'))
            writer.write_raw(raw.topic, raw.stamp, raw.data)
    result = run(bag, config)
    assert result.initialised is not None
    assert (result.initialised - result.first_stamp) * 1e-9 == pytest.approx(0.3, abs=0.05)


def test_replay_damaged_bag_says_so(
    simulated_bag: Path, config: ReplayConfig, tmp_path: Path
) -> None:
    bag = copy_bag(simulated_bag, tmp_path / 'bag', lambda *message: [message])
    file = next(bag.glob('*.mcap'))
    with file.open('r+b') as stream:
        stream.truncate(file.stat().st_size * 6 // 10)
    result = run(bag, config)
    assert result.damage
    assert result.initialised is not None
    assert 10.0 < result.data_s < 25.0


def test_replay_labyrinth_position_is_within_its_bound(
    labyrinth_folder: Path, tmp_path: Path
) -> None:
    """A real run with a start at unknown heading, nothing fitted to the truth."""
    convert_labyrinth(labyrinth_folder, tmp_path / 'bag')
    scenario = load_scenario(tmp_path / 'bag' / 'scenario.yaml')
    result = run(tmp_path / 'bag', ReplayConfig.from_scenario(scenario))
    assert result.sources == ('joint_states', 'uwb/ranges', 'ground_truth')
    assert result.initialised is not None
    # Ranges alone give no heading: whoever trusts the pose before the robot has moved is wrong.
    assert 1.0 < (result.initialised - result.first_stamp) * 1e-9 < 10.0
    assert not result.estimates.trusted[0]
    summary = result.errors.summary()
    assert summary.count > 150
    assert summary.rmse <= BOUND_LABYRINTH_M
    assert np.isnan(summary.heading_rmse)
