"""Captures: what was written is read again, to the byte and the nanosecond, and damage is seen."""

import pytest
from device_writers import datagram, lec_line, node_frame3
from hypothesis import given
from hypothesis import strategies as st
from wire_damage import cuts, feed_all, pieces

from tablerunner.uwb.protocol import (
    PROTOCOLS,
    Replay,
    capture_chunk,
    capture_header,
    open_protocol,
)

NODES = [(1, 0, 3210, -81.5, -79.0), (1, 1, 12_345, -90.0, -84.5)]


def replay():
    """Return a replay that knows all protocols."""
    return Replay(open_protocol)


def crc(data):
    """Return the CRC-32 of ISO-HDLC, bit by bit."""
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xEDB88320 if register & 1 else 0)
    return register ^ 0xFFFFFFFF


def test_layout_by_hand():
    """The bytes as the table of docs/protocols.md has them."""
    written = capture_chunk(0x0102030405060708, b'ab')
    assert written[:4] == b'\xf5TRC'
    assert written[4:15] == bytes([1, 8, 7, 6, 5, 4, 3, 2, 1, 2, 0])
    assert written[19:] == b'ab'
    assert int.from_bytes(written[15:19], 'little') == crc(written[4:15] + b'ab')


@given(st.lists(st.tuples(st.integers(1, 2**62), st.integers(0, 400)), max_size=8), cuts)
def test_captured_stream_is_read_with_its_own_times(reads, places):
    """A stream cut at random into chunks and the file cut at random again."""
    stream = b''.join(node_frame3(NODES, system_time=index) for index in range(8))
    file, at = capture_header('linktrack', 1), 0
    for stamp, length in reads:
        file += capture_chunk(stamp, stream[at : at + length])
        at += length
    whole = len(stream[:at]) // len(node_frame3(NODES))
    parser = replay()
    records, refusals = feed_all(parser, pieces(file, places))
    assert [item.ticks for item in records] == [index for index in range(whole) for _ in NODES]
    assert {item.stamp for item in records} <= {stamp for stamp, _ in reads}
    assert not refusals
    assert parser.protocol == 'linktrack'


@pytest.mark.parametrize('name', sorted(PROTOCOLS))
def test_every_protocol_can_be_replayed(name):
    parser = replay()
    parser.feed(capture_header(name, 1), 0)
    assert type(parser.parser) is type(open_protocol(name))


def test_datagrams_keep_their_borders_and_refusals_come_through():
    file = capture_header('udp', 1)
    file += capture_chunk(10, datagram([{'anchor': 'A', 'range': 1.0}]))
    file += capture_chunk(20, b'nonsense')
    file += capture_chunk(30, datagram([{'anchor': 'B', 'range': 2.0}]))
    parser = replay()
    parsed = parser.feed(file, 99)
    assert [(item.anchor, item.stamp) for item in parsed.ranges] == [('A', 10), ('B', 30)]
    assert [(item.reason, item.stamp) for item in parsed.refusals] == [('no JSON', 20)]
    assert parser.counts == {'no JSON': 1}


def test_long_read_is_split_and_comes_back_whole():
    line = lec_line([(1, (0.0, 0.0, 0.0), 1.0)], (0.0, 0.0, 1.0))
    stream = line * (200_000 // len(line))
    parser = replay()
    parsed = parser.feed(capture_header('dwm1001', 1) + capture_chunk(7, stream), 0)
    assert len(parsed.ranges) == 200_000 // len(line)
    assert parser.frames == 5


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_changed_byte_costs_its_chunk_and_no_more(place, change):
    """Ten chunks of a frame each: never a range that was not there, eight frames at least."""
    chunks = [
        capture_chunk(index + 1, node_frame3(NODES, system_time=index)) for index in range(10)
    ]
    header = capture_header('linktrack', 1)
    file = bytearray(header + b''.join(chunks))
    place = len(header) + place % (len(file) - len(header))
    file[place] ^= change
    parser = replay()
    parsed = parser.feed(bytes(file), 0)
    assert {(item.anchor, item.range_m) for item in parsed.ranges} == {
        ('anchor0', 3.21),
        ('anchor1', 12.345),
    }
    assert len(parsed.ranges) >= 2 * 8
    assert all(item.stamp == item.ticks + 1 for item in parsed.ranges)


@given(st.binary(max_size=3000), cuts)
def test_any_bytes_are_survived_and_a_capture_behind_them_is_read(before, places):
    parser = replay()
    feed_all(parser, pieces(before, places))
    assert parser.buffered <= parser.longest
    file = capture_header('linktrack', 1) + capture_chunk(5, node_frame3(NODES))
    assert len(parser.feed(file, 0).ranges) == 2


def test_unknown_protocol_and_missing_header_are_refused():
    parser = replay()
    assert [item.reason for item in parser.feed(capture_chunk(1, b'x'), 0).refusals] == [
        'no protocol is known to read this'
    ]
    refusals = parser.feed(capture_header('other', 1) + capture_chunk(1, b'x'), 0).refusals
    assert [(item.reason, item.key, item.stamp) for item in refusals] == [
        ('unknown protocol', 'other', 1),
        ('no protocol is known to read this', 'other', 1),
    ]
    with pytest.raises(ValueError, match='1 to 64 bytes'):
        capture_header('', 1)


def test_lost_chunk_does_not_join_what_was_apart():
    """Half a frame before the lost chunk and the half behind it, which would fit, make none."""
    first = second = node_frame3(NODES)
    lost = bytearray(capture_chunk(2, first[20:] + second[:20]))
    lost[-1] ^= 1
    file = capture_header('linktrack', 1) + capture_chunk(1, first[:20]) + bytes(lost)
    parser = replay()
    assert not parser.feed(file + capture_chunk(3, second[20:]), 0).ranges
    assert len(parser.feed(capture_chunk(4, first), 0).ranges) == 2
