"""Trips of bags: as the nodes published it, or as a replay found it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from tablerunner.bags.reader import BagReader
from tablerunner.bags.replay import ReplayResult
from tablerunner.bags.streams import bag_records, full_name
from tablerunner.evaluation.trip import Halt, Trip
from tablerunner.evaluation.truth import Stamps, Truth
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.messages.truth import TruePose
from tablerunner.types import (
    Innovation,
    OdometrySample,
    PoseSample,
    RangeSample,
    nanoseconds,
    seconds,
)

MOVING = 0.02
"""Speeds below this count as standing [m/s]."""

SHORTEST_HALT_S = 0.4
"""Shorter interventions of the safety stop are not shown."""

MAP_FRAME, ODOM_FRAME = 'map', 'odom'

_JOINED_S = 1.0
_NEAR_S = 0.25
_NEAR_M = 1.8  # between the middles of robot and person
_TOPICS = (
    'odometry/filtered',
    'ground_truth',
    'uwb/pose',
    'uwb/ranges',
    'uwb/anchors',
    'innovations',
)


def trip_of_replay(result: ReplayResult, title: str) -> Trip:
    """Return the trip as a replay found it."""
    settled = result.estimates.settled()
    return Trip(
        title,
        result.estimator,
        settled.stamps,
        settled.poses,
        settled.covariances,
        result.truth,
        _positions(result.fixes),
        np.array([fix.stamp for fix in result.fixes], dtype=np.int64),
        result.ranges,
        result.anchors,
        result.innovations,
    )


def trip_of_bag(bag: BagReader, title: str, namespace: str = '') -> Trip | None:
    """Return the trip as the nodes published it; None when the bag has no odometry/filtered."""
    present = [topic for topic in _TOPICS if bag.topic(full_name(topic, namespace))]
    if _TOPICS[0] not in present:
        return None
    poses: dict[int, OdometrySample] = {}
    truth: list[TruePose] = []
    fixes: list[PoseSample] = []
    ranges: list[RangeSample] = []
    innovations: list[Innovation] = []
    anchors = ()
    for _, _, record in bag_records(bag, present, namespace):
        if isinstance(record, OdometrySample):
            poses[record.stamp] = record
        elif isinstance(record, TruePose):
            truth.append(record)
        elif isinstance(record, PoseSample):
            fixes.append(record)
        elif isinstance(record, RangeSample):
            ranges.append(record)
        elif isinstance(record, Innovation):
            innovations.append(record)
        elif isinstance(record, tuple):
            anchors = record
    stamps = _trusted(np.array(sorted(poses), dtype=np.int64), _transform_stamps(bag, namespace))
    chosen = [poses[int(stamp)] for stamp in stamps]
    trip = Trip(
        title,
        _estimator(bag, namespace),
        stamps,
        np.array([_row(item) for item in chosen]).reshape(-1, 3),
        np.array([item.pose_covariance for item in chosen]).reshape(-1, 3, 3),
        Truth.from_poses(truth),
        _positions(fixes),
        np.array([fix.stamp for fix in fixes], dtype=np.int64),
        tuple(ranges),
        anchors,
        tuple(innovations),
    )
    return replace(trip, halts=_halts(bag, trip, namespace))


def _transform_stamps(bag: BagReader, namespace: str) -> Stamps:
    """Return the stamps of the transform from map to odom, which is known while tracking only."""
    topic = full_name('tf', namespace)
    found = [
        stamp_from_message(transform.header.stamp)
        for item in bag.messages([topic, '/tf'])
        for transform in item.message.transforms
        if transform.header.frame_id == MAP_FRAME and transform.child_frame_id == ODOM_FRAME
    ]
    return np.array(sorted(found), dtype=np.int64)


def _trusted(stamps: Stamps, transforms: Stamps) -> Stamps:
    """Return the stamps at which the estimator had declared itself initialised.

    odometry/filtered is published before that too, with the variance of a heading that is not
    known, so that the robot can find its heading by driving. A bag without transforms says
    nothing about it: all are taken.
    """
    if not len(transforms):
        return stamps
    right = np.searchsorted(transforms, stamps)
    before = transforms[(right - 1).clip(0)]
    after = transforms[right.clip(max=len(transforms) - 1)]
    nearest = np.minimum(abs(stamps - before), abs(stamps - after))
    near: Stamps = stamps[nearest <= nanoseconds(_NEAR_S)]
    return near


def _row(item: OdometrySample) -> tuple[float, float, float]:
    return item.pose.x, item.pose.y, item.pose.heading


def _positions(fixes: Iterable[PoseSample]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([(fix.pose.x, fix.pose.y) for fix in fixes]).reshape(-1, 2)


def _estimator(bag: BagReader, namespace: str) -> str:
    """Return the name in the first message of innovations."""
    for item in bag.messages([full_name('innovations', namespace)]):
        return str(item.message.estimator)
    return ''


def _halts(bag: BagReader, trip: Trip, namespace: str) -> tuple[Halt, ...]:
    """Find where the controller wanted to drive and the safety stop held the robot.

    Commands have no stamp of their own, so that the time of reception stands in for it; the bag
    must have been recorded on the same clock. Turning on the spot is not held.
    """
    spans = [
        span
        for span in _joined(_held(bag, namespace))
        if span[1] - span[0] >= nanoseconds(SHORTEST_HALT_S)
    ]
    places = trip.places(begin for begin, _ in spans)
    people = _people(bag, namespace)
    emergencies = _emergencies(bag, namespace)
    halts = []
    for (begin, end), (x, y) in zip(spans, places, strict=True):
        emergency = any(begin <= stamp <= end for stamp in emergencies)
        person = None if emergency else _nearest(people, begin, end, x, y)
        if math.isfinite(x):
            halts.append(Halt(begin, seconds(end - begin), float(x), float(y), person, emergency))
    return tuple(halts)


def _emergencies(bag: BagReader, namespace: str) -> list[int]:
    """Return when the safety stop said that an emergency stop held the robot [ns]."""
    topic = full_name('safety_state', namespace)
    return [
        received
        for _, received, _, message in bag.messages([topic] if bag.topic(topic) else [])
        if any(item.key == 'emergency' and item.value == 'true' for item in message.values)
    ]


def _held(bag: BagReader, namespace: str) -> Iterator[tuple[int, int]]:
    """Yield from when to when a speed was wanted and none was given [ns]."""
    wanted, given = (full_name(topic, namespace) for topic in ('cmd_vel_nav', 'cmd_vel'))
    speed = {wanted: 0.0, given: 0.0}
    began: int | None = None
    received = 0
    for topic, received, _, message in bag.messages([wanted, given]):
        twist = message.twist if hasattr(message, 'twist') else message
        speed[topic] = abs(twist.linear.x)
        held = speed[wanted] > MOVING >= speed[given]
        if held and began is None and topic == given:
            began = received
        elif not held and began is not None:
            yield began, received
            began = None
    if began is not None:
        yield began, received


def _joined(spans: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return spans with those made one that follow each other closely."""
    joined: list[tuple[int, int]] = []
    for begin, end in spans:
        if joined and begin - joined[-1][1] < nanoseconds(_JOINED_S):
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return joined


def _people(bag: BagReader, namespace: str) -> list[tuple[int, list[tuple[float, float]]]]:
    """Return where everybody was, by stamp; only a simulation knows (topic people)."""
    return [
        (
            stamp_from_message(item.message.header.stamp),
            [(pose.position.x, pose.position.y) for pose in item.message.poses],
        )
        for item in bag.messages([full_name('people', namespace)])
    ]


def _nearest(
    people: list[tuple[int, list[tuple[float, float]]]], begin: int, end: int, x: float, y: float
) -> tuple[float, float] | None:
    """Return who stood nearest during a halt, if anybody stood near."""
    near = [
        (math.hypot(place[0] - x, place[1] - y), place)
        for stamp, places in people
        if begin <= stamp <= end
        for place in places
    ]
    distance, place = min(near, default=(math.inf, (0.0, 0.0)))
    return place if distance < _NEAR_M else None
