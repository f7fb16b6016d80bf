"""LinkTrack frames: every field, and what damage on the wire may never do."""

import numpy as np
import pytest
from device_writers import node_frame2, node_frame3
from hypothesis import given
from hypothesis import strategies as st
from wire_damage import cuts, feed_all, noise, pieces

from tablerunner.uwb.protocol.linktrack import LinkTrack

NODES = [(1, 0, 3210, -81.5, -79.0), (1, 1, 12_345, -90.0, -84.5), (1, 200, 70_001, -99.5, -88.0)]
EXPECTED = {'anchor0': 3.21, 'anchor1': 12.345, 'anchor200': 70.001}

node_lists = st.lists(
    st.tuples(
        st.sampled_from([0, 1, 2]),
        st.integers(0, 255),
        st.integers(1, 299_999),
        st.integers(-255, 0).map(lambda half: half / 2),
        st.integers(-255, 0).map(lambda half: half / 2),
    ),
    max_size=12,
    unique_by=lambda node: node[:2],
)
writers = st.sampled_from([node_frame2, node_frame3])


def ranges(records):
    """Return anchor and distance of each range."""
    return [(item.anchor, item.range_m) for item in records if hasattr(item, 'range_m')]


@pytest.mark.parametrize('write', [node_frame2, node_frame3])
def test_frame_every_field_is_read(write):
    """Distance [m], both powers [dB], the other end, who reports, system time, arrival."""
    parsed = LinkTrack().feed(write(NODES, role=2, number=7, system_time=0xFEDCBA98), 42)
    assert not parsed.refusals
    assert {item.anchor: item.range_m for item in parsed.ranges} == pytest.approx(EXPECTED)
    first = parsed.ranges[0]
    assert (first.first_path_power_dbm, first.rx_power_dbm) == (-81.5, -79.0)
    assert (first.device, first.ticks, first.stamp) == ('tag7', 0xFEDCBA98, 42)


def test_frame3_bytes_of_the_table_by_hand():
    """A frame written byte by byte, so that writer and parser cannot share a mistake."""
    frame = bytes.fromhex('55051d000201' + '01000000' + '10270000' + '00000000' + '8813' + '01')
    frame += bytes.fromhex('0103' + 'b80b00' + 'a0' + '9c')
    frame += bytes([sum(frame) % 256])
    (item,) = LinkTrack().feed(frame, 1).ranges
    assert (item.device, item.anchor, item.range_m) == ('tag1', 'anchor3', 3.0)
    assert (item.first_path_power_dbm, item.rx_power_dbm, item.ticks) == (-80.0, -78.0, 10_000)


def test_frame2_position_is_read_and_none_where_the_device_has_none():
    place = LinkTrack().feed(node_frame2([], place_mm=(1500, -2500, 8_388_607)), 1).records[0]
    assert place.place == pytest.approx((1.5, -2.5, 8388.607))
    assert not LinkTrack().feed(node_frame2([], place_mm=(-8_388_000,) * 3), 1).records


def test_range_that_cannot_be_is_refused_and_the_others_are_kept():
    """A negative, a zero and a far range are refused by name; the frame around them is good."""
    nodes = [(1, 0, -5, -80, -80), (1, 1, 0, -80, -80), (1, 2, 250_000, -80, -80), NODES[0]]
    nodes[3] = (1, 3, *NODES[0][2:])
    parsed = LinkTrack(max_range_m=100.0).feed(node_frame3(nodes), 1)
    assert ranges(parsed.records) == [('anchor3', 3.21)]
    assert [(item.key, item.reason) for item in parsed.refusals] == [
        ('anchor0', 'range is not positive'),
        ('anchor1', 'range is not positive'),
        ('anchor2', 'range beyond max_range'),
    ]


@pytest.mark.parametrize('write', [node_frame2, node_frame3])
def test_one_changed_byte_never_gives_a_range(write):
    """Every byte of a frame, changed in every way: the sum tells, and the next frame is read."""
    good = write(NODES)
    rng = np.random.default_rng(1)
    for place in range(len(good)):
        for change in [1, 0x80, 0xFF, int(rng.integers(1, 256))]:
            bad = bytearray(good)
            bad[place] = (bad[place] + change) % 256
            parser = LinkTrack()
            parsed = parser.feed(bytes(bad), 1)
            assert not parsed.ranges
            after = parser.feed(good, 2)
            assert {item.anchor for item in after.ranges} == set(EXPECTED)
            assert parsed.refusals or after.refusals


@given(st.lists(st.tuples(writers, node_lists), min_size=1, max_size=6), cuts, st.data())
def test_frames_cut_anywhere_with_noise_between_are_all_read(frames, places, data):
    """Cut into any pieces, with noise without a header in between: nothing is lost."""
    stream, expected = b'', []
    for write, nodes in frames:
        stream += data.draw(noise.filter(lambda some: 0x55 not in some)) + write(nodes)
        expected += [
            (('node', 'anchor', 'tag')[node[0]] + str(node[1]), node[2] / 1000) for node in nodes
        ]
    records, _ = feed_all(LinkTrack(), pieces(stream, places))
    assert ranges(records) == expected


@given(st.binary(max_size=2000), node_lists.filter(len), cuts, writers)
def test_any_noise_is_survived_within_two_frames(before, nodes, places, write):
    """After any bytes at all, the second whole frame is read as soon as it is there."""
    parser = LinkTrack()
    feed_all(parser, pieces(before, places))
    assert parser.buffered <= parser.longest
    found = parser.feed(write(nodes), 2).ranges + parser.feed(write(nodes), 3).ranges
    expected = {(('node', 'anchor', 'tag')[node[0]] + str(node[1])) for node in nodes}
    assert {item.anchor for item in found} >= expected
    assert parser.buffered <= parser.longest


@given(node_lists.filter(len), writers, st.integers(0, 400), st.integers(0, 400), st.data())
def test_lost_bytes_cost_that_frame_and_no_more(nodes, write, at, count, data):
    """A piece lost out of the middle of three frames: the last of them is read at once."""
    good = write(nodes)
    at, count = at % len(good), 1 + count % len(good)
    stream = good + good[:at] + good[min(at + count, len(good)) :] + good
    parser = LinkTrack()
    records, _ = feed_all(parser, pieces(stream, data.draw(cuts)))
    found = {item.anchor for item in records if hasattr(item, 'range_m')}
    assert len(found) >= 1
    assert len(ranges(records)) >= 2 * len(nodes)


def test_bursts_of_damage_pass_no_oftener_than_the_sum_allows():
    """Random bursts over two to six bytes: 1 in 256 would pass by the sum alone.

    Of 4000 that would be 16; with roles, counts and doubles checked less than half of it.
    """
    rng = np.random.default_rng(7)
    good = node_frame3(NODES)
    true = set(EXPECTED.items())
    wrong = 0
    for _ in range(4000):
        bad = bytearray(good)
        count = int(rng.integers(2, 7))
        place = int(rng.integers(0, len(good) - count))
        bad[place : place + count] = rng.bytes(count)
        found = {(item.anchor, item.range_m) for item in LinkTrack().feed(bytes(bad), 1).ranges}
        wrong += bool(found - true)
    assert wrong < 8


def test_false_header_that_asks_for_much_delays_nothing():
    """A header in noise that announces 3435 bytes: the frame after it is read at once."""
    false = bytes([0x55, 0x04]) + (119 + 13 * 255 + 1).to_bytes(2, 'little')
    parsed = LinkTrack().feed(false + node_frame3(NODES), 1)
    assert len(parsed.ranges) == 3
    assert [item.reason for item in parsed.refusals] == ['truncated frame']


def test_reset_forgets_half_a_frame_and_keeps_the_counts():
    parser = LinkTrack()
    parser.feed(b'\x00\x01' + node_frame3(NODES)[:30], 1)
    assert parser.buffered == 30
    parser.reset()
    assert parser.buffered == 0
    assert len(parser.feed(node_frame3(NODES), 2).ranges) == 3
    assert parser.counts == {'bytes that are no frame': 1}
    assert parser.frames == 1


@pytest.mark.parametrize(
    ('nodes', 'role', 'expected'),
    [
        (NODES, 9, ('unknown role', 'header')),
        ([NODES[0], (7, 1, 1000, -80, -80)], 2, ('unknown role', 'node 1')),
        ([*NODES, NODES[1]], 2, ('node named twice', 'node 3')),
    ],
)
def test_frame_whose_sum_is_right_and_sense_is_not_is_refused(nodes, role, expected):
    """What damage to several bytes may leave."""
    parsed = LinkTrack().feed(node_frame3(nodes, role=role), 1)
    assert [(item.reason, item.key) for item in parsed.refusals] == [expected]
    assert not parsed.records


def test_frames_that_came_in_one_read_are_dated_by_the_speed_of_the_wire():
    """The second of two whole frames has no bytes behind it; without a speed both came now."""
    frame = node_frame3(NODES)
    parser = LinkTrack()
    parser.byte_ns = 1e10 / 921_600
    stamps = [item.stamp for item in parser.feed(frame * 2, 10**9).ranges]
    taken = round(len(frame) * 1e10 / 921_600)
    assert stamps == pytest.approx([10**9 - taken] * 3 + [10**9] * 3, abs=2)
    assert {item.stamp for item in LinkTrack().feed(frame * 2, 10**9).ranges} == {10**9}
