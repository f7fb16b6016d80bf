"""Datagrams: every field, and everything that a datagram may not be."""

import json
import math

import pytest
from device_writers import datagram
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.uwb.protocol.udp import LONGEST_DATAGRAM, Udp

ONE = {'anchor': 'A1', 'range': 3.21}
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=12,
)


def reason(data):
    """Return why a datagram is refused, with the part."""
    parsed = Udp().feed(data, 1)
    assert not parsed.records
    (refusal,) = parsed.refusals
    return refusal.reason, refusal.key


def test_datagram_every_field_is_read():
    full = {**ONE, 'quality': 0.8, 'rx': -79.5, 'fp': -84.0}
    data = datagram([full, {'anchor': 'A2', 'range': 7}], tag='T1', seq=17, time_us=123_456)
    first, second = Udp().feed(data, 42).ranges
    assert (first.anchor, first.range_m, first.device) == ('A1', 3.21, 'T1')
    assert (first.quality, first.rx_power_dbm, first.first_path_power_dbm) == (0.8, -79.5, -84.0)
    assert (first.sequence, first.ticks, first.stamp) == (17, 123_456, 42)
    assert (second.anchor, second.range_m) == ('A2', 7.0)
    assert math.isnan(second.quality)
    assert math.isnan(second.rx_power_dbm)


def test_example_of_the_page_is_read():
    """The shortest datagram that docs/protocols.md shows."""
    data = b'{"v": 1, "ranges": [{"anchor": "A1", "range": 3.21}]}'
    (item,) = Udp().feed(data, 1).ranges
    assert (item.device, item.sequence, item.ticks) == ('', None, None)


@pytest.mark.parametrize(
    ('data', 'expected'),
    [
        (b'', ('no JSON', '')),
        (b'{"v":1,"ranges":[', ('no JSON', '')),
        (b'\xff\xfe{}', ('no JSON', '')),
        (b'[' * 5000, ('no JSON', '')),
        (b'[]', ('not an object', '')),
        (b'{"v":1,"ranges":[],"v":1}', ('key named twice', '')),
        (b'{"v":1,"ranges":[{"anchor":"A","range":NaN}]}', ('no JSON', '')),
        (b'{"v":1,"ranges":[{"anchor":"A","range":1e999}]}', ('impossible number', 'range 0')),
        (b' ' * (LONGEST_DATAGRAM + 1), ('datagram too long', '')),
        (json.dumps({'ranges': []}).encode(), ('unknown version', 'v')),
        (json.dumps({'v': True, 'ranges': []}).encode(), ('unknown version', 'v')),
        (json.dumps({'v': 2, 'ranges': []}).encode(), ('unknown version', 'v')),
        (json.dumps({'v': 1}).encode(), ('not a list', 'ranges')),
        (datagram([ONE], rage=1), ('unknown field', 'rage')),
        (datagram([{**ONE, 'rnage': 1}]), ('unknown field', 'range 0')),
        (datagram([ONE, {'anchor': 'A2'}]), ('not a number', 'range 1')),
        (datagram([{'anchor': 'A1', 'range': '3.2'}]), ('not a number', 'range 0')),
        (datagram([{'anchor': 'A1', 'range': True}]), ('not a number', 'range 0')),
        (datagram([{'anchor': 'A1', 'range': 10**400}]), ('impossible number', 'range 0')),
        (datagram([{'anchor': '', 'range': 1}]), ('not a name', 'range 0')),
        (datagram([{'anchor': 'x' * 65, 'range': 1}]), ('not a name', 'range 0')),
        (datagram([{'anchor': 'A\n', 'range': 1}]), ('not a name', 'range 0')),
        (datagram([{**ONE, 'quality': 1.5}]), ('quality is not between 0 and 1', 'range 0')),
        (datagram([ONE, ONE]), ('anchor named twice', 'ranges')),
        (datagram([5]), ('not an object', 'range 0')),
        (datagram([ONE], seq=-1), ('not a whole number', 'seq')),
        (datagram([ONE], seq=1.5), ('not a whole number', 'seq')),
        (datagram([ONE], time_us=True), ('not a whole number', 'time_us')),
        (datagram([ONE], tag=7), ('not a name', 'tag')),
        (datagram([{'anchor': 'A1', 'range': -1}]), ('range is not positive', 'A1')),
        (datagram([{'anchor': 'A1', 'range': 301}]), ('range beyond max_range', 'A1')),
    ],
)
def test_datagram_that_is_wrong_is_refused_by_its_reason(data, expected):
    assert reason(data) == expected


def test_repeated_and_late_datagrams_are_refused_and_a_restart_is_not():
    parser = Udp()
    seen = [
        bool(parser.feed(datagram([ONE], tag='T', seq=number), 1).ranges)
        for number in [1000, 1001, 1001, 999, 1003, 1002, 0, 1]
    ]
    assert seen == [True, True, False, False, True, False, True, True]
    assert parser.counts == {'repeated sequence number': 1, 'late datagram': 2}
    assert parser.feed(datagram([ONE], tag='other', seq=1), 1).ranges


@given(st.binary(max_size=200))
def test_any_bytes_are_survived(data):
    parsed = Udp().feed(data, 1)
    assert not parsed.ranges
    assert parsed.refusals


@given(json_values)
def test_any_json_is_survived(value):
    assert not Udp().feed(json.dumps(value).encode(), 1).ranges


@given(st.dictionaries(st.sampled_from(['v', 'tag', 'seq', 'time_us', 'ranges']), json_values))
def test_any_values_in_the_right_fields_are_survived(body):
    Udp().feed(json.dumps({'v': 1, **body}).encode(), 1)


@given(st.integers(0, 200), st.integers(0, 200))
def test_piece_of_a_datagram_is_never_a_range(begin, length):
    """What is cut off a datagram, or lost inside, leaves no JSON, or no known field."""
    good = datagram([{'anchor': 'A1', 'range': 3.5}, {'anchor': 'A2', 'range': 4.5}], seq=5)
    begin %= len(good)
    cut = good[:begin]
    assert not Udp().feed(cut, 1).ranges
    assert not Udp().feed(good[begin + 1 :], 1).ranges
