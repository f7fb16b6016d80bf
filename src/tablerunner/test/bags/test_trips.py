"""Trips as the nodes published them: trusted estimates only, and where the robot was stopped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.reader import BagReader
from tablerunner.bags.trips import trip_of_bag
from tablerunner.bags.writer import BagWriter
from tablerunner.evaluation.trip import Trip
from tablerunner.geometry.pose import Pose2
from tablerunner.types import (
    Anchor,
    Innovation,
    LosState,
    OdometrySample,
    PoseSample,
    RangeSample,
    Velocity,
    nanoseconds,
)

TOPICS = (
    'odometry/filtered', 'ground_truth', 'uwb/pose', 'uwb/ranges', 'uwb/anchors', 'innovations',
    'tf', 'cmd_vel', 'cmd_vel_nav',
)  # fmt: skip


def emergency_message() -> object:
    """Return what the safety stop says while an emergency stop holds."""
    value = messages.make('diagnostic_msgs/msg/KeyValue', key='emergency', value='true')
    return messages.make(
        'diagnostic_msgs/msg/DiagnosticStatus',
        level=2,
        name='safety_stop',
        message='emergency stop',
        hardware_id='',
        values=[value],
    )


def people_message(stamp: int, x: float) -> object:
    """Return where two people are, one of them far away."""
    poses = [messages.goal_message(Pose2(place, 1.0, 0.0), stamp, 'map').pose for place in (x, 50)]
    return messages.make(
        'geometry_msgs/msg/PoseArray', header=messages.header(stamp, 'map'), poses=poses
    )


def write_bag(
    path: Path,
    namespace: str = '',
    transforms: bool = True,
    crowd_x: float = 4.0,
    emergency_s: float | None = None,
) -> None:
    """Write ten seconds of driving along x; the start is known after two, a halt is at five."""
    with BagWriter(path) as bag:
        for topic in TOPICS:
            bag.add_topic(f'{namespace}/{topic}', CONTRACT[topic].msgtype)
        bag.add_topic(f'{namespace}/people', 'geometry_msgs/msg/PoseArray')
        bag.add_topic(f'{namespace}/safety_state', 'diagnostic_msgs/msg/DiagnosticStatus')

        def write(topic: str, stamp: int, message: object) -> None:
            bag.write(f'{namespace}/{topic}', stamp, message)

        write('uwb/anchors', 1, messages.anchors_message([Anchor('A0', (0, 0, 2))], 1, 'map'))
        for step in range(1, 101):
            time, stamp = 0.1 * step, nanoseconds(0.1 * step)
            truth = OdometrySample(stamp, Pose2(0.5 * time, 0.0, 0.0), 0.5, 0.0)
            estimate = OdometrySample(
                stamp, Pose2(0.5 * time, 0.2, 0.0), 0.5, 0.0, np.eye(3) * 0.01
            )
            write('ground_truth', stamp, messages.odometry_message(truth, 'map', 'base_link'))
            write(
                'odometry/filtered',
                stamp,
                messages.odometry_message(estimate, 'map', 'base_link'),
            )
            if transforms and time > 2.0:
                place = [(stamp, 'map', 'odom', Pose2())]
                write('tf', stamp, messages.transforms_message(place))
            if time == emergency_s:
                write('safety_state', stamp, emergency_message())
            held = 5.0 <= time < 6.5 or time == pytest.approx(8.0)
            write('cmd_vel_nav', stamp, messages.twist_message(Velocity(0.5, 0.0)))
            write('cmd_vel', stamp, messages.twist_message(Velocity(0.0 if held else 0.5, 0.3)))
            write('people', stamp, people_message(stamp, crowd_x - (time - 5.0)))
            los = LosState.NLOS if step % 4 == 0 else LosState.LOS
            sample = RangeSample(stamp, 'A0', 'tag', step, 1.0, 0.01, los=los)
            write('uwb/ranges', stamp, messages.range_message(sample, 'uwb_tag'))
            fix = PoseSample(stamp, Pose2(0.5 * time, 0.3, 0.0), np.eye(3) * 0.1)
            write('uwb/pose', stamp, messages.pose_message(fix, 'map'))
            record = Innovation(
                stamp, 'uwb/ranges', 'A0', True, '', np.ones(1), np.eye(1), 1.0, 9.0
            )
            write('innovations', stamp, messages.innovation_message(record, 'map', 'ekf'))


def read(path: Path, namespace: str = '') -> Trip:
    """Return the trip of a bag."""
    with BagReader(path) as bag:
        trip = trip_of_bag(bag, 'A trip', namespace)
    assert trip is not None
    return trip


def test_trip_of_bag_takes_estimates_from_when_the_start_is_known(tmp_path: Path) -> None:
    """What is published before there is a transform from map to odom is not yet a claim."""
    write_bag(tmp_path / 'bag')
    trip = read(tmp_path / 'bag')
    assert trip.stamps[0] == pytest.approx(1.9e9, abs=0.11e9)
    assert trip.stamps[-1] == nanoseconds(10.0)
    summary = trip.errors().summary()
    assert summary.rmse == pytest.approx(0.2)
    assert len(trip.truth) == 100
    assert trip.estimator == 'ekf'
    assert len(trip.fixes) == len(trip.ranges) == len(trip.innovations) == 100
    assert len(trip.nlos()) == 25
    assert trip.anchors == (Anchor('A0', (0.0, 0.0, 2.0)),)


def test_trip_of_bag_without_transforms_takes_all_estimates(tmp_path: Path) -> None:
    write_bag(tmp_path / 'bag', transforms=False)
    assert len(read(tmp_path / 'bag').stamps) == 100


def test_trip_of_bag_finds_where_the_robot_was_stopped(tmp_path: Path) -> None:
    """One halt of 1.5 s; a single zero command is none, and turning is no driving."""
    write_bag(tmp_path / 'bag')
    (halt,) = read(tmp_path / 'bag').halts
    assert halt.stamp == nanoseconds(5.0)
    assert halt.duration_s == pytest.approx(1.5)
    assert (halt.x, halt.y) == pytest.approx((2.5, 0.0))
    # Somebody came along from x = 4 m at y = 1 m, and was nearest when the robot went on.
    assert halt.person == pytest.approx((2.5, 1.0), abs=0.11)


def test_trip_of_bag_halt_with_nobody_near_is_for_a_thing(tmp_path: Path) -> None:
    write_bag(tmp_path / 'bag', crowd_x=20.0)
    (halt,) = read(tmp_path / 'bag').halts
    assert halt.person is None


@pytest.mark.parametrize(('at_s', 'emergency'), [(5.5, True), (9.0, False)])
def test_trip_of_bag_halt_of_an_emergency_is_told_apart(
    tmp_path: Path, at_s: float, emergency: bool
) -> None:
    """Whoever stands near: it was not for them."""
    write_bag(tmp_path / 'bag', emergency_s=at_s)
    (halt,) = read(tmp_path / 'bag').halts
    assert halt.emergency is emergency
    assert (halt.person is None) is emergency


def test_trip_of_bag_in_a_namespace(tmp_path: Path) -> None:
    write_bag(tmp_path / 'bag', '/robot1')
    assert len(read(tmp_path / 'bag', 'robot1').halts) == 1
    with BagReader(tmp_path / 'bag') as bag:
        assert trip_of_bag(bag, 'A trip') is None
