"""Our own datagrams: one JSON object each, for modules that no other protocol here reads.

The format is documented, with examples, in docs/protocols.md.
"""

from __future__ import annotations

import json
import math
from typing import Any, NoReturn

from tablerunner.uwb.protocol.parser import MAX_RANGE_M, Parser
from tablerunner.uwb.protocol.record import DeviceRange, Record

VERSION = 1

LONGEST_DATAGRAM = 8192
"""Longer ones are refused [bytes]."""

MOST_RANGES = 256
LATE = 64
"""A sequence number this little behind the last belongs to a late datagram, not to a restart."""

_LONGEST_NAME = 64
_MOST_TAGS = 256
_KEYS = frozenset({'v', 'tag', 'seq', 'time_us', 'ranges'})
_RANGE_KEYS = frozenset({'anchor', 'range', 'quality', 'rx', 'fp'})


class _DatagramError(Exception):
    """What is wrong with a datagram; never leaves this module."""

    def __init__(self, reason: str, part: str = '') -> None:
        super().__init__(reason)
        self.reason = reason
        self.part = part


class Udp(Parser):
    """Reads datagrams: every call of `feed` takes one, whole."""

    source = 'udp'
    tick_ns = 1e3
    counter_bits = 63

    def __init__(self, max_range_m: float = MAX_RANGE_M) -> None:
        super().__init__(max_range_m)
        self._sequences: dict[str, int] = {}  # the last of each tag

    @property
    def buffered(self) -> int:
        """Nothing is kept between datagrams."""
        return 0

    def reset(self) -> None:
        """Forget the sequence numbers; counts stay."""
        self._sequences.clear()

    def _take(self, data: bytes) -> None:
        try:
            records = self._read(data)
        except _DatagramError as wrong:
            self._refuse(wrong.reason, wrong.part)
            return
        self._frames += 1
        for record in records:
            self._give(record)

    def _read(self, data: bytes) -> list[Record]:
        body = _object(data)
        if body.get('v') is True or body.get('v') != VERSION:
            raise _DatagramError('unknown version', 'v')
        if not body.keys() <= _KEYS:
            raise _DatagramError('unknown field', _shown(min(body.keys() - _KEYS)))
        tag = _name(body, 'tag') if 'tag' in body else ''
        ticks = _whole(body, 'time_us')
        sequence = _whole(body, 'seq')
        ranges = body.get('ranges')
        if not isinstance(ranges, list):
            raise _DatagramError('not a list', 'ranges')
        if len(ranges) > MOST_RANGES:
            raise _DatagramError('too many ranges', 'ranges')
        records: list[Record] = [
            self._range(item, index, tag, ticks, sequence) for index, item in enumerate(ranges)
        ]
        names = {record.anchor for record in records if isinstance(record, DeviceRange)}
        if len(names) < len(records):
            raise _DatagramError('anchor named twice', 'ranges')
        if sequence is not None:
            self._order(tag, sequence)
        return records

    def _order(self, tag: str, sequence: int) -> None:
        """Refuse what was there before; a number far back is that of a tag that started again."""
        last = self._sequences.get(tag)
        if last is not None and last - LATE < sequence <= last:
            same = sequence == last
            raise _DatagramError('repeated sequence number' if same else 'late datagram', 'seq')
        if last is None and len(self._sequences) == _MOST_TAGS:
            self._sequences.clear()
        self._sequences[tag] = sequence

    def _range(
        self, item: Any, index: int, tag: str, ticks: int | None, sequence: int | None
    ) -> DeviceRange:
        part = f'range {index}'
        if not isinstance(item, dict):
            raise _DatagramError('not an object', part)
        if not item.keys() <= _RANGE_KEYS:
            raise _DatagramError('unknown field', part)
        anchor = _name(item, 'anchor', part)
        quality = _number(item, 'quality', part)
        if not math.isnan(quality) and not 0.0 <= quality <= 1.0:
            raise _DatagramError('quality is not between 0 and 1', part)
        if 'range' not in item:
            raise _DatagramError('not a number', part)
        return DeviceRange(
            self._stamp,
            tag,
            anchor,
            _number(item, 'range', part),
            quality,
            rx_power_dbm=_number(item, 'rx', part),
            first_path_power_dbm=_number(item, 'fp', part),
            ticks=ticks,
            sequence=sequence,
        )


def _object(data: bytes) -> dict[str, Any]:
    """Return the JSON object, as strictly as RFC 8259 has it: no NaN, no key twice."""
    if len(data) > LONGEST_DATAGRAM:
        raise _DatagramError('datagram too long')
    try:
        body = json.loads(
            data.decode('utf-8'), parse_constant=_no_constant, object_pairs_hook=_pairs
        )
    except (ValueError, RecursionError) as error:
        raise _DatagramError('no JSON') from error
    if not isinstance(body, dict):
        raise _DatagramError('not an object')
    return body


def _no_constant(text: str) -> NoReturn:
    raise ValueError(text)


def _pairs(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise _DatagramError('key named twice')
    return found


def _name(body: dict[str, Any], key: str, part: str = '') -> str:
    value = body.get(key)
    if not isinstance(value, str) or not 0 < len(value) <= _LONGEST_NAME:
        raise _DatagramError('not a name', part or key)
    if not value.isprintable():
        raise _DatagramError('not a name', part or key)
    return value


def _whole(body: dict[str, Any], key: str) -> int | None:
    value = body.get(key)
    if value is None and key not in body:
        return None
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 63:
        raise _DatagramError('not a whole number', key)
    return value


def _number(body: dict[str, Any], key: str, part: str) -> float:
    """Return a number, NaN where there is none."""
    if key not in body:
        return math.nan
    value = body[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _DatagramError('not a number', part)
    if not abs(value) <= 1e6:
        raise _DatagramError('impossible number', part)
    return float(value)


def _shown(key: str) -> str:
    return key[:_LONGEST_NAME] if key.isprintable() else ''
