"""Measured and true ranges of a bag, for calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tablerunner.bags.reader import BagReader
from tablerunner.bags.streams import Names, bag_records, converters, full_name
from tablerunner.errors import BagError
from tablerunner.evaluation.truth import Truth
from tablerunner.messages.truth import TruePose
from tablerunner.types import Anchor, ExchangeSample, RangeSample
from tablerunner.uwb import Ranger, RangerConfig
from tablerunner.uwb.slant import tag_in_map

Array = NDArray[np.float64]

_TRUTH = 'ground_truth'
_BLOCKED_ABOVE = 0.5


@dataclass(frozen=True)
class RangePairs:
    """What an anchor measured, and what it should have.

    Attributes
    ----------
    anchor : Anchor
    stamps : ndarray of int64, shape (k,)
        [ns].
    true, raw : ndarray, shape (k,)
        Distance between the antennas, and the uncalibrated range [m].
    blocked : int
        Ranges left out since their signal says that they are not line of sight: what walls and
        people add is no property of the anchor, and would come out as one.
    """

    anchor: Anchor
    stamps: NDArray[np.int64]
    true: Array
    raw: Array
    blocked: int


def range_pairs(
    bag: BagReader,
    anchors: tuple[Anchor, ...],
    tag_position: tuple[float, float, float],
    at: tuple[float, float] | None = None,
    namespace: str = '',
) -> tuple[RangePairs, ...]:
    """Return the pairs of every anchor that answered where the truth is known.

    Parameters
    ----------
    bag : BagReader
        Holds uwb/exchanges or uwb/ranges and, unless `at` is given, ground_truth.
    anchors : tuple of Anchor
        Where they are; empty: as uwb/anchors of the bag says.
    tag_position : tuple
        Tag in base_link [m].
    at : tuple of 2 floats, optional
        Where the tag stood all the time, in map [m].
    namespace : str
        Namespace of the robot in the bag.

    Raises
    ------
    BagError
        The bag has no ranges, no truth, no anchors, or none of it at the same time.
    """

    def present(topic: str) -> bool:
        found = bag.topic(full_name(topic, namespace))
        return found is not None and found.count > 0

    table = converters(Names())
    if not anchors:
        anchors = next(
            (
                item.record
                for item in bag_records(bag, ['uwb/anchors'], namespace, table)
                if isinstance(item.record, tuple) and item.record
            ),
            (),
        )
    if not anchors:
        raise BagError(
            f'{bag.path} does not say where the anchors are (no uwb/anchors): give a scenario file'
        )
    source = 'uwb/exchanges' if present('uwb/exchanges') else 'uwb/ranges'
    if not present(source):
        raise BagError(f'{bag.path} holds neither uwb/exchanges nor uwb/ranges')
    if at is None and not present(_TRUTH):
        raise BagError(
            f'{bag.path} holds no {_TRUTH}: for a robot that stood still, say where (--at X,Y)'
        )
    ranger = Ranger(_plain(anchors))
    ranges: list[RangeSample] = []
    poses: list[TruePose] = []
    topics = [source] if at is not None else [source, _TRUTH]
    for item in bag_records(bag, topics, namespace, table):
        record = item.record
        if isinstance(record, ExchangeSample):
            record = ranger.add(record)
        if isinstance(record, RangeSample):
            ranges.append(record)
        elif isinstance(record, TruePose):
            poses.append(record)
    return _pairs(bag, ranges, anchors, tag_position, at, Truth.from_poses(poses))


def _pairs(
    bag: BagReader,
    ranges: list[RangeSample],
    anchors: tuple[Anchor, ...],
    tag_position: tuple[float, float, float],
    at: tuple[float, float] | None,
    truth: Truth,
) -> tuple[RangePairs, ...]:
    found = []
    for anchor in anchors:
        every = [item for item in ranges if item.anchor_id == anchor.anchor_id]
        own = [item for item in every if not item.nlos_probability > _BLOCKED_ABOVE]
        stamps = np.array([item.stamp for item in own], dtype=np.int64)
        raw = np.array(
            [item.raw_range_m if item.raw_range_m > 0.0 else item.range_m for item in own]
        )
        if at is not None:
            tag = np.broadcast_to([*at, tag_position[2]], (len(own), 3))
        else:
            places, headings = truth.at(stamps)
            if not any(tag_position[:2]):
                headings = np.zeros(len(own))  # a tag over the centre needs none
            tag = tag_in_map(places, headings, tag_position)
        true = np.linalg.norm(tag - np.array(anchor.position), axis=-1)
        sound = np.isfinite(true)
        if sound.any():
            found.append(
                RangePairs(anchor, stamps[sound], true[sound], raw[sound], len(every) - len(own))
            )
    if not found:
        raise BagError(f'{bag.path} has no range of a known anchor while the truth is known')
    return tuple(found)


def _plain(anchors: tuple[Anchor, ...]) -> RangerConfig:
    """Return the settings of a ranger that calibrates nothing."""
    return replace(
        RangerConfig(),
        anchor_ids=tuple(anchor.anchor_id for anchor in anchors),
        anchor_positions=tuple(float(value) for anchor in anchors for value in anchor.position),
    )
