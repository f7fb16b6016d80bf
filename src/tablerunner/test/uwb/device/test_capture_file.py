"""Captures on disk: played at their pace, moved to the present or not, and refused when bad."""

import re
import tempfile
from pathlib import Path

import pytest
from bench_clock import EPOCH_NS, Clock
from device_writers import datagram, node_frame3
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.errors import ConfigError
from tablerunner.uwb.device.build import build_session
from tablerunner.uwb.device.capture_file import CaptureFile, CaptureWriter
from tablerunner.uwb.device.config import DeviceConfig, ReplayConfig
from tablerunner.uwb.device.session import LinkState
from tablerunner.uwb.device.source import Arrival, SourceError
from tablerunner.uwb.protocol import capture_chunk, capture_header

TAKEN = 1_600_000_000_000_000_000
NODES = [(1, 0, 3210, -81.5, -79.0), (1, 1, 12_345, -90.0, -84.5)]


def frames(count, begin=TAKEN, period_ns=100_000_000, ticks=0):
    """Return chunks of one frame each."""
    return b''.join(
        capture_chunk(begin + k * period_ns, node_frame3(NODES, system_time=ticks + 100 * k))
        for k in range(count)
    )


def player(path, clock, **settings):
    return CaptureFile(
        str(path), clock=clock.host_ns, steady=clock.steady, sleep=clock.sleep, **settings
    )


def play(source, clock, duration_s):
    """Return (seconds after the beginning, arrival)."""
    begun, found = clock.now, []
    while clock.now < begun + duration_s and not source.finished:
        found += [(clock.now - begun, item) for item in source.read(0.1)]
        clock.now += 1e-4
    return found


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'drive.trc'


@pytest.mark.parametrize('rate', [1.0, 2.0, 0.5])
def test_chunks_come_at_the_pace_of_the_capture(path, rate):
    """Ten at 10 Hz; twice as fast they take half as long. Then it has ended."""
    path.write_bytes(capture_header('linktrack', TAKEN) + frames(10))
    clock = Clock()
    source = player(path, clock, rate=rate)
    source.open()
    found = play(source, clock, 30.0)
    assert [at for at, _ in found] == pytest.approx([0.1 * k / rate for k in range(10)], abs=0.01)
    assert source.finished
    assert source.protocol == 'linktrack'


def test_times_are_moved_to_the_present_or_kept(path):
    path.write_bytes(capture_header('linktrack', TAKEN) + frames(3))
    clock = Clock()
    source = player(path, clock, rate=2.0)
    source.open()
    begun = clock.host_ns()
    play(source, clock, 5.0)
    assert source.host_stamp(TAKEN + 200_000_000) == pytest.approx(begun + 100_000_000, abs=10)
    kept = player(path, clock, keep_stamps=True)
    kept.open()
    play(kept, clock, 1.0)
    assert kept.host_stamp(TAKEN) == TAKEN


def test_captures_one_behind_another_are_played_on(path):
    """The second was taken earlier: its times begin anew, and nothing is waited for."""
    earlier = TAKEN - 3600 * 10**9
    one = capture_header('linktrack', TAKEN) + frames(3)
    path.write_bytes(one + capture_header('linktrack', earlier) + frames(3, earlier))
    clock = Clock()
    source = player(path, clock)
    source.open()
    found = play(source, clock, 5.0)
    assert len(found) == 6
    assert found[-1][0] < 0.6
    assert source.host_stamp(earlier + 200_000_000) <= clock.host_ns()


def test_damage_is_told_and_what_is_around_it_is_played(path):
    """One chunk with a wrong byte, and a file that was cut off."""
    data = bytearray(capture_header('linktrack', TAKEN) + frames(5))
    size = len(frames(1))
    data[len(capture_header('linktrack', TAKEN)) + 2 * size + 25] ^= 1
    path.write_bytes(data[:-7])
    clock = Clock()
    source = player(path, clock)
    source.open()
    found = play(source, clock, 5.0)
    assert len(found) == 3
    assert [item.lost for _, item in found[1:]] == [False, True]
    reasons = [item.reason for item in source.refusals()]
    assert reasons == ['checksum does not agree', 'truncated frame']
    assert source.refusals() == ()


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        (None, 'that can be read: No such file or directory'),
        (b'', 'no good header begins it'),
        (b'x' * 100_000, 'no good header begins it'),
        (capture_header('sonar', 1) + capture_chunk(2, b'x'), "it is one of 'sonar'"),
        (capture_header('linktrack', 1), 'nothing in it is whole'),
        (capture_header('linktrack', 1) + capture_chunk(2, b'x')[:-1] + b'y', 'nothing in it'),
    ],
)
def test_file_that_cannot_be_played_is_named(path, content, words):
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError, match=f'^replay.file: got .*{re.escape(words)}'):
        CaptureFile(str(path))


def test_file_that_goes_later_is_a_source_that_has_gone(path):
    path.write_bytes(capture_header('linktrack', TAKEN) + frames(3))
    source = CaptureFile(str(path))
    path.unlink()
    with pytest.raises(SourceError, match='cannot be read'):
        source.open()


def test_what_was_written_is_played(path):
    """A file that is there already is continued."""
    for begin in (TAKEN, TAKEN + 10**9):
        writer = CaptureWriter(str(path), 'udp', begin)
        for k in range(3):
            data = datagram([{'anchor': f'A{k}', 'range': 3.0 + k}])
            writer.add(Arrival(begin + k * 10_000_000, data))
        writer.close()
    clock = Clock()
    source = player(path, clock)
    source.open()
    assert [item.stamp for _, item in play(source, clock, 5.0)] == [
        begin + k * 10_000_000 for begin in (TAKEN, TAKEN + 10**9) for k in range(3)
    ]


def test_full_disk_ends_the_capture_and_is_told():
    writer = CaptureWriter('/dev/full', 'udp', TAKEN)
    assert writer.error == 'No space left on device'
    writer.add(Arrival(TAKEN, b'x'))
    writer.close()


def test_session_plays_a_capture_to_its_end(path):
    """Ranges with moved times, in order and none in the future; then it says that it has ended."""
    path.write_bytes(capture_header('linktrack', TAKEN) + frames(60))
    config = DeviceConfig(device='replay', replay=ReplayConfig(file=str(path), rate=500.0))
    session = build_session(config.replace(device_ids=('0', '1')), ['north', 'south'])
    ranges = []
    for _ in range(2000):
        ranges += session.step(0.01).ranges
        if session.health.link is LinkState.ENDED:
            break
    assert session.health.words == 'the capture has been played to its end'
    assert len(ranges) == 120
    assert {item.anchor_id for item in ranges} == {'north', 'south'}
    stamps = [item.stamp for item in ranges]
    assert stamps == sorted(stamps)
    # 5.9 s of capture, 500 times faster.
    assert stamps[-1] - stamps[0] == pytest.approx(5_900_000_000 / 500, rel=0.02)
    assert stamps[0] > EPOCH_NS


GOOD = capture_header('linktrack', TAKEN) + frames(6, period_ns=1_000_000)
TRUE = {('anchor0', 3.21), ('anchor1', 12.345)}


@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(1, 255)), max_size=4),
    st.integers(0, len(GOOD)),
    st.binary(max_size=60),
)
def test_damaged_capture_is_refused_or_gives_true_ranges(changes, at, noise):
    """Bytes changed, others put in, anywhere: one sentence, or what was captured, to the end."""
    data = bytearray(GOOD)
    for place, change in changes:
        data[place] ^= change
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'drive.trc'
        file.write_bytes(bytes(data[:at]) + noise + bytes(data[at:]))
        config = DeviceConfig(device='replay', replay=ReplayConfig(file=str(file), rate=1000.0))
        try:
            session = build_session(config, [])
        except ConfigError as error:
            assert error.field == 'replay.file'  # noqa: PT017 (that it fails is one of two ways)
            return
        ranges, ended = [], False
        for _ in range(300):
            ranges += session.step(0.01).ranges
            ended = session.health.link is LinkState.ENDED
            if ended:
                break
        session.close()
    assert ended
    assert {(item.anchor_id, item.range_m) for item in ranges} <= TRUE
