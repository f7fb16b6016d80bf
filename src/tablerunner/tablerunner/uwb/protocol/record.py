"""What a device says, as records: ranges, positions, and facts about the device itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from tablerunner.types import RangeSample, Refusal

Place = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class DeviceRange:
    """A distance that a device reports, with ids in the device's own form."""

    stamp: int  # when the last byte of it arrived at the host [ns]
    device: str  # who reports; empty where the protocol does not say
    anchor: str  # the other end
    range_m: float
    quality: float = math.nan  # 0 to 1, as the device judges it
    rx_power_dbm: float = math.nan
    first_path_power_dbm: float = math.nan
    ticks: int | None = None  # the device's own time, in ticks of the parser's `tick_ns`
    sequence: int | None = None
    anchor_place: Place | None = None  # where the device believes the anchor to be [m]


@dataclass(frozen=True, slots=True)
class DevicePosition:
    """Where a device believes itself to be, in the frame of its anchors [m]."""

    stamp: int
    device: str
    place: Place
    quality: float = math.nan


@dataclass(frozen=True, slots=True)
class DeviceFact:
    """Something a device says of itself: version, mode, update rate, state."""

    stamp: int
    name: str
    value: str | int


Record = DeviceRange | DevicePosition | DeviceFact


class Parsed(NamedTuple):
    """What came out of some bytes.

    The `key` of a refusal is the anchor whose range was refused, or the part of the frame that
    was damaged (``checksum``, ``node 2``) or from which on it could not be read (``AN1``); it may
    be empty.
    """

    records: tuple[Record, ...] = ()
    refusals: tuple[Refusal, ...] = ()

    @property
    def ranges(self) -> tuple[DeviceRange, ...]:
        """The ranges among the records."""
        return tuple(record for record in self.records if isinstance(record, DeviceRange))


def to_sample(
    record: DeviceRange,
    names: Mapping[str, str],
    tag: str,
    stamp: int | None = None,
    sequence: int = 0,
) -> RangeSample | Refusal:
    """Return a device's range under the anchor's name in the map.

    Parameters
    ----------
    record : DeviceRange
        As parsed.
    names : mapping of str to str
        Name of each anchor by the device's id of it. Anchors that are not in it are refused; an
        empty mapping leaves the ids as they are.
    tag : str
        Name of the tag, where the device does not say its own.
    stamp : int or None
        Time of the measurement if it is known better than by arrival [ns].
    sequence : int
        Taken where the protocol has no sequence number.
    """
    at = record.stamp if stamp is None else stamp
    name = names.get(record.anchor, '') if names else record.anchor
    if not name:
        return Refusal(at, 'device', record.anchor, 'unknown anchor')
    return RangeSample(
        stamp=at,
        anchor_id=name,
        tag_id=record.device or tag,
        sequence=sequence if record.sequence is None else record.sequence,
        range_m=record.range_m,
        raw_range_m=record.range_m,
        rx_power_dbm=record.rx_power_dbm,
        first_path_power_dbm=record.first_path_power_dbm,
    )
