"""The binary interface of an emulated DWM1001: every location once, and dated well."""

import pytest
from bench_clock import EPOCH_NS, Bench
from emulated import EmulatedDwm1001
from test_shell_dialogue import ANCHORS, PLACE, TRUE, found

from tablerunner.uwb.device.tlv_dialogue import ANSWER_S, TlvDialogue
from tablerunner.uwb.protocol import Dwm1001Tlv


def tlv(rate_hz=50.0, **settings):
    """Return a bench with a module that nobody has spoken to yet."""
    return Bench(
        EmulatedDwm1001(ANCHORS, PLACE), Dwm1001Tlv(), TlvDialogue(rate_hz, 'dwm1001'), **settings
    )


def test_each_location_is_taken_once():
    """Asked 50 times a second, the module has ten locations in it: 40 ranges."""
    bench = tlv()
    bench.run(1.0)
    ranges, refusals = bench.run(10.0)
    assert len(ranges) == pytest.approx(400, abs=8)
    assert found(ranges) == TRUE
    assert not refusals
    assert len({item.stamp for item in ranges}) == len(ranges) // 4
    assert bench.health.facts['firmware'] == '1.3.0 variant 1'


def test_still_tag_gives_no_old_range_again():
    """One location in ten seconds: one set of ranges, not five hundred."""
    bench = tlv()
    bench.run(1.0)
    bench.module.moves = False
    ranges, _ = bench.run(100.0)
    assert len(ranges) == pytest.approx(40, abs=4)
    assert bench.source.opens == 1
    assert bench.health.words == ''


def test_stamp_is_at_most_a_question_late():
    """A question every 0.05 s or as soon as the last is answered, answers after 0.05 s.

    So a location is announced 0.1 s after the ranging at the latest; it comes 0.05 s later still,
    which does not count. Steps of the bench: 0.005 s.
    """
    bench = tlv(rate_hz=20.0, latency_s=0.05)
    bench.run(1.0)
    ranges, _ = bench.run(5.0)
    for item in ranges:
        stamp_s = (item.stamp - EPOCH_NS) / 1e9
        measured_s = max(at for at in bench.module.measured if at <= stamp_s)
        assert stamp_s - measured_s <= 0.1 + 0.02
    assert len(ranges) >= 4 * 25


def test_stamp_is_that_of_the_announcement():
    """Not of the location, which comes an answer later: 0.1 s here."""
    bench = tlv(latency_s=0.1)
    bench.run(2.0)
    count = 0
    while count < 20:
        for item in bench.session.step(0.1).ranges:
            count += 1
            assert bench.clock.now - (item.stamp - EPOCH_NS) / 1e9 >= 0.1 - 1e-6


def test_late_answer_is_refused():
    """An answer after its time may be to anything: no range, and it is counted."""
    bench = tlv(latency_s=ANSWER_S + 0.05)
    ranges, refusals = bench.run(8.0)
    assert not ranges
    assert bench.health.frames > 0 or refusals
    bench.source.latency_s = 0.002
    bench.run(2.0)
    assert found(bench.run(1.0)[0]) == TRUE


def test_module_in_its_shell_is_brought_out():
    bench = tlv()
    bench.module.shell = True
    bench.run(5.0)
    assert bench.module.commands[-1].endswith(b'quit')
    assert found(bench.run(1.0)[0]) == TRUE


def test_deaf_module_is_told_of_and_found_again():
    bench = tlv()
    bench.run(1.0)
    bench.module.deaf = True
    bench.run(5.0)
    assert 'does not answer' in bench.health.words
    bench.run(30.0)
    assert bench.health.opened > 2
    bench.module.deaf = False
    bench.run(10.0)
    assert found(bench.run(1.0)[0]) == TRUE


def test_module_that_resets_goes_on():
    bench = tlv()
    bench.run(1.0)
    bench.module.reset(bench.clock.now)
    bench.run(1.0)
    assert found(bench.run(1.0)[0]) == TRUE


def test_anchorless_tag_is_no_trouble():
    """Locations without distances: no range, no complaint, the questions go on."""
    bench = tlv()
    bench.module.anchors = []
    ranges, refusals = bench.run(5.0)
    assert not ranges
    assert not refusals
    assert bench.health.words == ''
    bench.module.anchors = ANCHORS
    assert found(bench.run(1.0)[0]) == TRUE
