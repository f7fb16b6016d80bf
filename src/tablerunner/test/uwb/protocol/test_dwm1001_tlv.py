"""Answers of the binary interface, and what damage may never do."""

import struct

import pytest
from device_writers import anchor_location_answer, location_answer, place_bytes, tlv
from hypothesis import given
from hypothesis import strategies as st
from wire_damage import cuts, feed_all, pieces

from tablerunner.uwb.protocol.dwm1001_tlv import Dwm1001Tlv

# Places and ranges as from a tag at (1, 2, 0.3) m.
PLACE = (1000, 2000, 300)
ANCHORS = [
    (0x022E, 2410, 100, (0, 0, 1200)),
    (0x9280, 4562, 100, (5000, 0, 1200)),
    (0xDCAE, 5838, 90, (6000, 5000, 0)),
    (0x5431, 3174, 100, (0, 5000, 0)),
]
TRUE = [(f'{address:04X}', mm / 1000) for address, mm, _, _ in ANCHORS]
millimetres = st.integers(-20_000, 90_000)
anchor_lists = st.lists(
    st.tuples(
        st.integers(0, 0xFFFF),
        st.integers(1, 60_000),
        st.integers(0, 100),
        st.tuples(millimetres, millimetres, millimetres),
    ),
    max_size=12,
    unique_by=lambda anchor: anchor[0],
)


def ranges(records):
    """Return anchor and distance of each range."""
    return [(item.anchor, item.range_m) for item in records if hasattr(item, 'range_m')]


def facts(data):
    """Return what a device says of itself."""
    return {item.name: item.value for item in Dwm1001Tlv().feed(data, 1).records}


def test_location_of_a_tag_every_field_is_read():
    parsed = Dwm1001Tlv().feed(location_answer(ANCHORS, PLACE, 70), 5)
    assert ranges(parsed.records) == TRUE
    assert parsed.ranges[2].quality == 0.9
    assert parsed.ranges[1].anchor_place == (5.0, 0.0, 1.2)
    assert parsed.ranges[0].stamp == 5
    assert (parsed.records[0].place, parsed.records[0].quality) == ((1.0, 2.0, 0.3), 0.7)
    assert not parsed.refusals


def test_location_bytes_of_the_table_by_hand():
    """An answer written byte by byte, so that writer and parser cannot share a mistake."""
    answer = '400100' + '410d' + 'e8030000' + '18fcffff' + '2c010000' + '46'
    answer += '4915' + '01' + '2e02' + '6a090000' + '64' + '00000000' * 2 + 'b0040000' + '64'
    parsed = Dwm1001Tlv().feed(bytes.fromhex(answer), 1)
    assert parsed.records[0].place == (1.0, -1.0, 0.3)
    assert ranges(parsed.records) == [('022E', 2.41)]
    assert parsed.ranges[0].anchor_place == (0.0, 0.0, 1.2)


def test_location_of_an_anchor_has_long_ids():
    parsed = Dwm1001Tlv().feed(anchor_location_answer([(0xDECA123456789ABC, 2500, 80)]), 1)
    assert ranges(parsed.records) == [('DECA123456789ABC', 2.5)]


def test_version_mode_rate_and_state_are_told():
    """Byte orders and bits as in the table of docs/protocols.md."""
    version = tlv(0x50, bytes([0x01, 2, 3, 1])) + tlv(0x51, struct.pack('<I', 0x00010700))
    version += tlv(0x52, struct.pack('<I', 0xDECA002A))
    told = facts(tlv(0x40, b'\x00') + version)
    assert told['firmware'] == '1.3.2 variant 1'
    assert told['hardware_version'] == 'deca002a'
    assert told['configuration_version'] == '00010700'
    assert facts(tlv(0x40, b'\x00') + tlv(0x46, bytes([0x52, 0x24])))['mode'] == 'anchor'
    assert facts(tlv(0x40, b'\x00') + tlv(0x46, bytes([0x52, 0x04])))['mode'] == 'tag'
    assert facts(tlv(0x40, b'\x00') + tlv(0x45, struct.pack('<HH', 1, 50))) == {
        'update_interval_ms': 100,
        'update_interval_still_ms': 5000,
    }
    assert facts(tlv(0x40, b'\x00') + tlv(0x5A, b'\x03\x00'))['location_ready'] == 1


def test_error_of_the_device_is_refused_by_its_meaning():
    """As of a device in this mode that is sent shell commands: 40 01 01."""
    parser = Dwm1001Tlv()
    parsed = parser.feed(bytes.fromhex('400101') * 3, 1)
    assert parser.counts == {'device answers: unknown command or broken frame': 3}
    assert not parsed.records


def test_position_alone_is_given_at_once():
    (record,) = (
        Dwm1001Tlv().feed(tlv(0x40, b'\x00') + tlv(0x41, place_bytes(PLACE, 60)), 3).records
    )
    assert record.stamp == 3


@pytest.mark.parametrize('count', range(1, 60))
def test_lost_piece_anywhere_never_gives_a_wrong_range(count):
    """Every piece of every length lost out of an answer, with good ones around it."""
    good = location_answer(ANCHORS, PLACE)
    for at in range(len(good) - count):
        parser = Dwm1001Tlv()
        parsed = parser.feed(good + good[:at] + good[at + count :] + good + good, 1)
        assert set(ranges(parsed.records)) <= set(TRUE)
        assert len(ranges(parsed.records)) >= 2 * len(TRUE)
        assert ranges(parser.feed(good, 2).records)[-4:] == TRUE
        assert parser.buffered <= parser.longest


def test_changed_byte_gives_no_range_that_is_far_off():
    """Every byte, every change: refused, or off by less than what the position leaves open.

    One changed byte of a distance is 0.001 to 0.255 m, 0.256 to 65 m (the position tells from 3 m
    on), or beyond 65 km. Without a checksum no more can be told.
    """
    good = location_answer(ANCHORS, PLACE)
    true = dict(TRUE)
    named = set()
    for place in range(len(good)):
        for value in range(256):
            bad = bytearray(good)
            bad[place] = value
            for name, range_m in ranges(Dwm1001Tlv().feed(bytes(bad), 1).records):
                if name not in true:
                    named.add(place)
                    continue
                assert abs(range_m - true[name]) <= 3.1
    # A changed address is another anchor; the table of names refuses it, as nobody knows it.
    assert named == {21 + 20 * index + byte for index in range(4) for byte in (0, 1)}


@given(st.lists(anchor_lists, min_size=1, max_size=5), cuts)
def test_answers_cut_anywhere_are_all_read(answers, places):
    stream = b''.join(location_answer(anchors, PLACE, 0) for anchors in answers)
    records, _ = feed_all(Dwm1001Tlv(), pieces(stream, places))
    wanted = [(f'{item[0]:04X}', item[1] / 1000) for anchors in answers for item in anchors]
    assert ranges(records) == wanted


@given(st.lists(st.binary(max_size=400), max_size=6), cuts, st.booleans())
def test_any_noise_is_survived_within_two_answers(before, places, marked):
    """After any bytes, headers among them, the second answer is read; the buffer is bounded."""
    parser = Dwm1001Tlv()
    stream = (bytes.fromhex('400100410d') if marked else b'').join(before)
    feed_all(parser, pieces(stream, places))
    assert parser.buffered <= parser.longest
    good = location_answer(ANCHORS, PLACE)
    found = ranges(parser.feed(good, 2).records) + ranges(parser.feed(good, 3).records)
    assert found[-4:] == TRUE


def test_short_status_inside_a_list_does_not_end_it():
    """An anchor named 0140 at 65.5 m writes 40 01 01, as an error would; fed byte by byte."""
    anchors = [(0x0140, 0x0101, 100, (0, 0, 0)), ANCHORS[1]]
    records, refusals = feed_all(
        Dwm1001Tlv(), [bytes([byte]) for byte in location_answer(anchors, PLACE)]
    )
    assert ranges(records) == [('0140', 0.257), TRUE[1]]
    assert not refusals


def test_truncated_answer_is_refused_when_the_next_begins():
    good = location_answer(ANCHORS, PLACE)
    parsed = Dwm1001Tlv().feed(good[:60] + good, 1)
    assert ranges(parsed.records) == TRUE
    assert [item.reason for item in parsed.refusals] == ['truncated frame']


@pytest.mark.parametrize(
    ('anchor', 'reason'),
    [
        ((1, 1000, 101, (0, 0, 0)), 'impossible distance'),
        ((1, 10_000_001, 100, (0, 0, 0)), 'impossible distance'),
        ((1, 1000, 100, (0, -10_000_001, 0)), 'impossible place of an anchor'),
        (ANCHORS[0], 'anchor named twice'),
    ],
)
def test_list_with_one_impossible_entry_is_refused_whole(anchor, reason):
    parsed = Dwm1001Tlv().feed(location_answer([*ANCHORS, anchor], PLACE), 1)
    assert [(item.reason, item.key) for item in parsed.refusals] == [(reason, 'entry 4')]
    assert not parsed.ranges


def test_impossible_quality_of_an_anchors_place_is_refused():
    answer = bytearray(location_answer(ANCHORS, PLACE))
    answer[-1] = 101
    parsed = Dwm1001Tlv().feed(bytes(answer), 1)
    assert [item.key for item in parsed.refusals] == ['entry 3']
    assert not parsed.ranges


def test_impossible_position_and_the_list_behind_it_are_refused():
    for place, quality in [((0, 0, 10_000_001), 50), (PLACE, 101)]:
        parsed = Dwm1001Tlv().feed(location_answer(ANCHORS, place, quality), 1)
        assert not parsed.records
        assert parsed.refusals[0].reason == 'impossible position'


def test_list_after_a_reset_belongs_to_no_answer():
    parser = Dwm1001Tlv()
    answer = location_answer(ANCHORS, PLACE)
    assert parser.feed(answer[:18], 1).records
    parser.reset()
    assert not parser.feed(answer[18:], 2).records


def test_range_that_alone_does_not_fit_the_position_is_refused():
    anchors = [*ANCHORS[:3], (*ANCHORS[3][:1], 9000, *ANCHORS[3][2:])]
    parsed = Dwm1001Tlv().feed(location_answer(anchors, PLACE), 1)
    assert ranges(parsed.records) == TRUE[:3]
    assert [item.key for item in parsed.refusals] == ['5431']
    assert len(Dwm1001Tlv(max_residual_m=0.0).feed(location_answer(anchors, PLACE), 1).ranges) == 4
