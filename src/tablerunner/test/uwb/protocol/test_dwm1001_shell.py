"""The shell's lines, as public logs show them, and what damage may never do."""

import pytest
from device_writers import lec_line, les_line
from hypothesis import given
from hypothesis import strategies as st
from wire_damage import cuts, feed_all, noise, pieces

from tablerunner.uwb.protocol.dwm1001_shell import LONGEST_LINE, NEW_SET, Dwm1001Shell

ANCHORS = [
    (0x022E, (7.94, 8.03, 0.0), 3.44),
    (0x9280, (7.95, 0.0, 0.0), 5.68),
    (0xDCAE, (0.0, 8.03, 0.0), 7.76),
    (0x5431, (0.0, 0.0, 0.0), 8.73),
]
PLACE = (6.95, 5.37, -1.97)
TRUE = {f'{address:04X}': range_m for address, _, range_m in ANCHORS}
writers = st.sampled_from([lec_line, les_line])
anchor_lists = st.lists(
    st.tuples(
        st.integers(0, 0xFFFF),
        st.tuples(*[st.integers(-2000, 9000).map(lambda cm: cm / 100)] * 3),
        st.integers(1, 29_999).map(lambda cm: cm / 100),
    ),
    min_size=1,
    max_size=8,
    unique_by=lambda anchor: anchor[0],
)


def ranges(records):
    """Return anchor and distance of each range."""
    return [(item.anchor, item.range_m) for item in records if hasattr(item, 'range_m')]


def expected(anchors):
    """Return what a line of these says."""
    return [(f'{address:04X}', range_m) for address, _, range_m in anchors]


def acquainted(anchors, places=(None, PLACE), **settings):
    """Return a parser that has seen these anchors together, without and with a position."""
    parser = Dwm1001Shell(**settings)
    for place in places:
        parser.feed(les_line(anchors, place), 0)
    return parser


def test_lec_line_as_the_firmware_prints_it():
    """Ids and ranges, the anchors' places, the position with its quality."""
    line = b'DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,7.95,-0.04,0.00,5.68,'
    parsed = Dwm1001Shell().feed(line + b'POS,6.95,5.37,-1.97,52\r\n', 9)
    assert ranges(parsed.records) == [('022E', 3.44), ('9280', 5.68)]
    assert parsed.ranges[1].anchor_place == (7.95, -0.04, 0.0)
    assert parsed.ranges[0].stamp == 9
    assert parsed.ranges[0].ticks is None
    assert (parsed.records[-1].place, parsed.records[-1].quality) == ((6.95, 5.37, -1.97), 0.52)
    assert not parsed.refusals


def test_les_line_as_the_firmware_prints_it():
    line = b'022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 le_us=3082 '
    line += b'est[6.97,5.17,-1.77,53]\r\n'
    parser = Dwm1001Shell()
    parsed = parser.feed(line, 1)
    assert [item.reason for item in parsed.refusals] == [NEW_SET]
    assert not parsed.records
    parsed = parser.feed(line, 2)
    assert ranges(parsed.records) == [('022E', 3.38), ('9280', 5.49)]
    assert (parsed.records[-1].place, parsed.records[-1].quality) == ((6.97, 5.17, -1.77), 0.53)


@pytest.mark.parametrize('write', [lec_line, les_line])
def test_line_without_position_gives_the_ranges(write):
    assert ranges(acquainted(ANCHORS).feed(write(ANCHORS), 1).records) == expected(ANCHORS)


def test_prompt_echo_and_banner_are_passed_over():
    """What a shell says besides is no damage; a prompt before a line does not hide it."""
    text = b'\r\n\r\n DWM1001 TWR Real Time Location System\r\n\r\n Help      :  ? or help\r\n\r\n'
    text += b'dwm> lec\r\ndwm> ' + lec_line(ANCHORS, PLACE)
    parsed = Dwm1001Shell().feed(text, 1)
    assert ranges(parsed.records) == expected(ANCHORS)
    assert not parsed.refusals


def test_line_mixed_up_at_high_rate_is_refused_whole():
    """A line seen in public logs: its last group begins twice."""
    line = b'DIST,4,AN0,0090,0.00,0.00,0.00,3.25,AN1,D91E,0.00,0.00,0.00,3.33,AN2,0487,0.00,0.00,'
    line += b'0.00,0.18,AN3,15BA,0.00,0,AN3,15BA,0.00,0.00,0.00,0.00\r\n'
    parsed = Dwm1001Shell().feed(line, 1)
    assert not parsed.records
    assert [(item.reason, item.key) for item in parsed.refusals] == [('damaged line', 'AN3')]


def test_line_that_lost_its_position_is_refused_once():
    """What is lost from within the last range on leaves a line that is right in form."""
    line = lec_line(ANCHORS, PLACE)
    spliced = line[: line.index(b'.73,POS') + 1] + b'60\r\n'
    parser = Dwm1001Shell()
    assert ranges(parser.feed(line, 1).records) == expected(ANCHORS)
    parsed = parser.feed(spliced, 2)
    assert [item.reason for item in parsed.refusals] == [NEW_SET]
    assert not parsed.records


def test_zero_range_is_refused_alone():
    anchors = [(*ANCHORS[0][:2], 0.0), *ANCHORS[1:]]
    parsed = acquainted(ANCHORS).feed(lec_line(anchors), 1)
    assert ranges(parsed.records) == expected(ANCHORS[1:])
    assert [(item.reason, item.key) for item in parsed.refusals] == [
        ('range is not positive', '022E')
    ]


@pytest.mark.parametrize('write', [lec_line, les_line])
@pytest.mark.parametrize('lost', [0, 1, 2, 3])
def test_range_that_alone_does_not_fit_the_position_is_refused(write, lost):
    """A changed first digit leaves the form right: the position tells which range it was in."""
    anchors = list(ANCHORS)
    anchors[lost] = (*anchors[lost][:2], anchors[lost][2] + 10.0)
    parsed = acquainted(ANCHORS).feed(write(anchors, PLACE), 1)
    assert ranges(parsed.records) == expected(ANCHORS[:lost] + ANCHORS[lost + 1 :])
    assert [item.key for item in parsed.refusals] == [f'{ANCHORS[lost][0]:04X}']
    assert len(acquainted(ANCHORS, max_residual_m=0.0).feed(write(anchors, PLACE), 1).ranges) == 4


def test_wrong_position_costs_no_range():
    """Where all disagree it is the position that is wrong, or the anchors it was told."""
    parsed = Dwm1001Shell().feed(lec_line(ANCHORS, (60.0, 60.0, 0.0)), 1)
    assert ranges(parsed.records) == expected(ANCHORS)


@pytest.mark.parametrize('write', [lec_line, les_line])
@pytest.mark.parametrize('count', range(1, 80))
def test_lost_piece_anywhere_never_gives_a_wrong_range(write, count):
    """Every piece of every length lost out of a line of four anchors and a position."""
    good = write(ANCHORS, PLACE)
    for at in range(len(good) - count):
        parser = acquainted(ANCHORS, [PLACE])
        parsed = parser.feed(good[:at] + good[at + count :] + good, 1)
        assert set(ranges(parsed.records)) <= set(TRUE.items())
        again = parser.feed(good, 2)
        assert ranges(again.records) == expected(ANCHORS)


@given(st.lists(st.tuples(writers, anchor_lists), min_size=1, max_size=6), cuts)
def test_lines_cut_anywhere_are_all_read(lines, places):
    stream = b''.join(write(anchors) for write, anchors in lines)
    parser = Dwm1001Shell()
    for _, anchors in lines:
        parser.feed(les_line(anchors), 0)
    records, refusals = feed_all(parser, pieces(stream, places))
    assert ranges(records) == [item for _, anchors in lines for item in expected(anchors)]
    assert not refusals


@given(st.lists(noise, max_size=12), anchor_lists, cuts, writers)
def test_any_noise_is_survived_within_two_lines(before, anchors, places, write):
    """After any bytes at all, the second line is read; nothing is kept beyond a line."""
    parser = acquainted(anchors)
    feed_all(parser, [*before, *pieces(b''.join(before), places)])
    assert parser.buffered <= LONGEST_LINE
    parser.feed(write(anchors), 2)
    assert ranges(parser.feed(write(anchors), 3).records) == expected(anchors)


@given(anchor_lists, writers, st.integers(0, 400), st.binary(min_size=1, max_size=6))
def test_noise_inside_a_line_never_gives_another_anchor(anchors, write, at, what):
    """Bytes put into a line: refused, or what the line says; the next line is read."""
    good = write(anchors)
    at %= len(good)
    parser = acquainted(anchors)
    parsed = parser.feed(good[:at] + what + good[at:], 1)
    if not any(48 <= byte <= 57 for byte in what):
        assert set(ranges(parsed.records)) <= set(expected(anchors))
    parser.feed(b'\n', 1)
    assert ranges(parser.feed(good, 2).records) == expected(anchors)


def test_line_without_end_is_dropped_and_counted_once():
    parser = Dwm1001Shell()
    for _ in range(50):
        parser.feed(b'x' * 100, 1)
        assert parser.buffered <= LONGEST_LINE
    assert parser.counts == {'line too long': 1}
    found = parser.feed(b'\n' + lec_line(ANCHORS, PLACE), 2).records
    assert ranges(found) == expected(ANCHORS)


@pytest.mark.parametrize(
    ('change', 'expected'),
    [
        ((b',AN2,', b',AN3,'), ('damaged line', 'AN2')),
        ((b'9280', b'022E'), ('anchor named twice', '')),
        ((b'DIST,4', b'DIST,5'), ('damaged line', 'AN4')),
        ((b'-1.97,60', b'-1.97,101'), ('damaged line', 'quality')),
        ((b'5.68', b'5.680'), ('damaged line', 'AN2')),  # where it could not be read on
        ((b'DIST', b'DI\xd3T'), ('line is no text', '')),
    ],
)
def test_line_with_one_fault_is_refused_by_its_part(change, expected):
    parsed = Dwm1001Shell().feed(lec_line(ANCHORS, PLACE).replace(*change), 1)
    assert [(item.reason, item.key) for item in parsed.refusals][:1] == [expected]
    assert not parsed.records


def test_system_info_is_read_as_facts():
    """Lines of `si` as public logs show them; text of the shell that is no damage."""
    text = b'dwm> si\r\n[000042.580 INF] sys: fw2 fw_ver=x01030001 cfg_ver=x00010700\r\n'
    text += b'[000042.590 INF] mode: tn (act,twr,np,le)\r\n'
    text += b'[000042.590 INF] uwbmac: connected\r\n'
    text += b'[000042.600 INF] cfg: sync=0 fwup=0 ble=1 leds=1 le=1 lp=0 stat_det=1 (sens=1) '
    text += b'mode=0 upd_rate_norm=1 upd_rate_stat=100 label=DW01D2\r\n'
    parsed = Dwm1001Shell().feed(text, 1)
    assert [(item.name, item.value) for item in parsed.records] == [
        ('firmware', '01030001'),
        ('mode', 'tn (act,twr,np,le)'),
        ('update_interval_ms', 100),
        ('update_interval_still_ms', 10_000),
    ]
    assert not parsed.refusals


def test_still_interval_without_stationary_detection_is_the_moving_one():
    line = b'[000042.600 INF] cfg: stat_det=0 mode=0 upd_rate_norm=2 upd_rate_stat=100 label=D\r\n'
    parsed = Dwm1001Shell().feed(line, 1)
    assert [item.value for item in parsed.records] == [200, 200]


def test_error_answers_before_the_shell_opened_are_passed_over():
    """What the module says to text while it is not in its shell hides no line behind it."""
    parsed = Dwm1001Shell().feed(b'\x40\x01\x01' * 3 + lec_line(ANCHORS, PLACE), 1)
    assert ranges(parsed.records) == expected(ANCHORS)
    assert not parsed.refusals


def test_lines_that_came_in_one_read_are_dated_by_the_speed_of_the_wire():
    """At 115200 baud a byte takes 87 us: the first of three lines came two lines earlier."""
    line = lec_line(ANCHORS, PLACE)
    parser = Dwm1001Shell()
    parser.byte_ns = 1e10 / 115_200
    parsed = parser.feed(line * 3, 10**9)
    stamps = sorted({item.stamp for item in parsed.ranges})
    taken = round(len(line) * 1e10 / 115_200)
    assert stamps == pytest.approx([10**9 - 2 * taken, 10**9 - taken, 10**9], abs=2)
    parsed = parser.feed(line * 3, 10**9 + 1000)  # faster than the wire can be: still in order
    later = sorted({item.stamp for item in parsed.ranges})
    assert len(later) == 3
    assert stamps[-1] < later[0] < later[-1] == 10**9 + 1000
