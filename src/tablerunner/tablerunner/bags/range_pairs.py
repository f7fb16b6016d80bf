"""Measured and true ranges of a bag, for calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tablerunner.bags.reader import BagReader
from tablerunner.bags.streams import bag_records, full_name
from tablerunner.errors import BagError
from tablerunner.evaluation.truth import Truth
from tablerunner.messages.truth import TruePose
from tablerunner.types import Anchor, ExchangeSample, RangeSample
from tablerunner.uwb import Ranger, RangerConfig
from tablerunner.uwb.slant import tag_in_map

Array = NDArray[np.float64]

_TRUTH = 'ground_truth'
_SOURCES = ('uwb/exchanges', 'uwb/ranges')
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
    at: tuple[float, float, float] | None = None,
    namespace: str = '',
    truth: Truth | None = None,
) -> tuple[RangePairs, ...]:
    """Return the pairs of every anchor; one that was not heard while the truth is known has none.

    Parameters
    ----------
    bag : BagReader
        Holds uwb/exchanges or uwb/ranges and, unless `at` or `truth` is given, ground_truth.
    anchors : tuple of Anchor
        Where they are; empty: as uwb/anchors of the bag says.
    tag_position : tuple
        Tag in base_link [m].
    at : tuple of 3 floats, optional
        Where the tag stood all the time, in map [m].
    namespace : str
        Namespace of the robot in the bag.
    truth : Truth, optional
        Where base_link was, instead of the bag's ground_truth.

    Raises
    ------
    BagError
        The bag has no ranges, no truth, no anchors, or none of it at the same time; an anchor
        answered of which nobody says where it is; a tag beside base_link needs headings that the
        truth does not have.
    """

    def present(topic: str) -> bool:
        found = bag.topic(full_name(topic, namespace))
        return found is not None and found.count > 0

    anchors = anchors or _anchors(bag, namespace)
    source = next((topic for topic in _SOURCES if present(topic)), None)
    if source is None:
        raise BagError(f'{bag.path} holds neither {" nor ".join(_SOURCES)}')
    topics = [source]
    if at is None and truth is None:
        topics.append(_TRUTH)
        if not present(_TRUTH):
            raise BagError(
                f'{bag.path} holds no {_TRUTH}: give a file of true positions (--truth FILE), or '
                'say where the tag stood still (--at X,Y)'
            )
    ranges, poses = _records(bag, topics, namespace, _plain(anchors))
    strange = {item.anchor_id for item in ranges} - {anchor.anchor_id for anchor in anchors}
    if strange:
        known = ', '.join(anchor.anchor_id for anchor in anchors)
        raise BagError(
            f'{bag.path} has ranges of unknown anchors ({", ".join(sorted(strange))}); known are '
            f'{known}'
        )
    path = Truth.from_poses(poses) if truth is None else truth
    found = tuple(_pairs(ranges, anchor, tag_position, at, path) for anchor in anchors)
    if not any(len(item.true) for item in found):
        turned = at is None and any(tag_position[:2]) and not np.isfinite(path.headings).any()
        raise BagError(
            f'{bag.path}: the truth has no headings, but the tag is beside the middle of the robot'
            if turned
            else f'{bag.path} has no range of a known anchor while the truth is known'
        )
    return found


def _anchors(bag: BagReader, namespace: str) -> tuple[Anchor, ...]:
    """Return what uwb/anchors of the bag says first."""
    for item in bag_records(bag, ['uwb/anchors'], namespace):
        if isinstance(item.record, tuple) and item.record:
            return item.record
    raise BagError(
        f'{bag.path} does not say where the anchors are (no uwb/anchors): give a scenario file'
    )


def _records(
    bag: BagReader, topics: list[str], namespace: str, plain: RangerConfig
) -> tuple[list[RangeSample], list[TruePose]]:
    """Return all ranges, uncalibrated where the bag holds exchanges, and true poses."""
    ranger = Ranger(plain)
    ranges: list[RangeSample] = []
    poses: list[TruePose] = []
    for item in bag_records(bag, topics, namespace):
        record = item.record
        if isinstance(record, ExchangeSample):
            if record.anchor_id not in plain.anchor_ids:
                raise BagError(
                    f'{bag.path} has exchanges with an unknown anchor ({record.anchor_id}); known '
                    f'are {", ".join(plain.anchor_ids)}'
                )
            record = ranger.add(record)
        if isinstance(record, RangeSample):
            ranges.append(record)
        elif isinstance(record, TruePose):
            poses.append(record)
    return ranges, poses


def _pairs(
    ranges: list[RangeSample],
    anchor: Anchor,
    tag_position: tuple[float, float, float],
    at: tuple[float, float, float] | None,
    truth: Truth,
) -> RangePairs:
    every = [item for item in ranges if item.anchor_id == anchor.anchor_id]
    own = [item for item in every if not item.nlos_probability > _BLOCKED_ABOVE]
    stamps = np.array([item.stamp for item in own], dtype=np.int64)
    raw = np.array([item.raw_range_m if item.raw_range_m > 0.0 else item.range_m for item in own])
    if at is not None:
        tag = np.broadcast_to(np.array(at), (len(own), 3))
    else:
        places, headings = truth.at(stamps)
        if not any(tag_position[:2]):
            headings = np.zeros(len(own))  # a tag over the centre needs none
        tag = tag_in_map(places, headings, tag_position)
    true = np.linalg.norm(tag - np.array(anchor.position), axis=-1)
    sound = np.isfinite(true)
    return RangePairs(anchor, stamps[sound], true[sound], raw[sound], len(every) - len(own))


def _plain(anchors: tuple[Anchor, ...]) -> RangerConfig:
    """Return the settings of a ranger that calibrates nothing."""
    return replace(
        RangerConfig(),
        anchor_ids=tuple(anchor.anchor_id for anchor in anchors),
        anchor_positions=tuple(float(value) for anchor in anchors for value in anchor.position),
        nlos_test='signal_quality',
    )
