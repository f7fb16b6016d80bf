"""uwb_driver on emulated devices: a wire, a socket, a capture; over DDS."""

from __future__ import annotations

import contextlib
import itertools
import random
import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from device_writers import datagram, node_frame3
from emulated import EmulatedDwm1001, Running, Wire
from rclpy.parameter import Parameter

from tablerunner.errors import ConfigError
from tablerunner.uwb.protocol import capture_chunk, capture_header
from tablerunner_interfaces.msg import UwbRange
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Process, Processes
from uwb_driver.node import UwbDriver

PLACE = (1.0, 2.0, 0.5)
CORNERS = {'north': (0.0, 0.0, 2.0), 'east': (5.0, 0.0, 2.0), 'south': (5.0, 4.0, 2.0)}
METRES = {'north': 2.69, 'east': 4.74, 'south': 4.74}
ANCHORS = {
    'anchor_ids': list(CORNERS),
    'anchor_positions': [number for corner in CORNERS.values() for number in corner],
    'tag_height': 0.5,
}
ADDRESSES = {'north': 0x0A01, 'east': 0x0A02, 'south': 0x2E10}
LINKTRACK = [(1, 4 + k, round(1000 * METRES[name]), -82.0, -80.0) for k, name in enumerate(METRES)]
TRUE = set(METRES.items())
STATUS = 'uwb_driver'
START_S = 60.0
"""A process may take long to start where others keep the machine busy."""


def module() -> EmulatedDwm1001:
    """Return a DWM1001 between the anchors."""
    anchors = [(ADDRESSES[name], CORNERS[name], METRES[name]) for name in CORNERS]
    return EmulatedDwm1001(anchors, PLACE)


def found(ranges: list[UwbRange]) -> set[tuple[str, float]]:
    """Return names and distances."""
    return {(item.anchor_id, round(item.raw_range, 3)) for item in ranges}


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[Wire]:
    """Return a wire that is plugged in."""
    item = Wire(tmp_path / 'ttyUWB')
    item.plug()
    yield item
    item.unplug()


def dwm1001(wire: Wire, mode: str) -> dict[str, Any]:
    """Return the parameters for a module on a wire."""
    return {
        **ANCHORS,
        'device': 'dwm1001',
        'device_ids': [f'DW{address:04X}' for address in ADDRESSES.values()],
        'serial': {'port': str(wire.path)},
        'dwm1001': {'mode': mode},
        'reconnect': {'first': 0.1},
    }


def linktrack(wire: Wire, **more: Any) -> dict[str, Any]:
    """Return the parameters for a LinkTrack on a wire."""
    return {
        **ANCHORS,
        'device': 'linktrack',
        'device_ids': ['anchor4', '5', '6'],
        'serial': {'port': str(wire.path)},
        'reconnect': {'first': 0.1},
        **more,
    }


def start(processes: Processes, parameters: dict[str, Any]) -> Process:
    """Start the installed executable."""
    return processes.node('uwb_driver', 'uwb_driver', parameters)


def flat(parameters: dict[str, Any]) -> list[Parameter]:
    """Return parameters for a node in this process."""
    made = []
    for name, value in parameters.items():
        if isinstance(value, dict):
            made += [Parameter(f'{name}.{key}', value=item) for key, item in value.items()]
        else:
            made.append(Parameter(name, value=value))
    return made


def fresh(probe: Probe, ranges: list[UwbRange], count: int = 6) -> None:
    """Wait until true ranges come, and no other."""
    ranges.clear()
    probe.wait_for(lambda: len(ranges) >= count, 'ranges of the device')
    assert found(ranges) <= TRUE


@pytest.mark.parametrize('mode', ['lec', 'tlv'])
def test_dwm1001_process_is_begun_pulled_and_found_again(
    probe: Probe, processes: Processes, wire: Wire, mode: str
) -> None:
    """Out of its shell at first; a module that is plugged in again is, too.

    Names, stamps of now, one stamp for a location; unplugged it is an error on /diagnostics.
    """
    ranges = probe.listen(UwbRange, 'uwb/ranges')
    emulated = module()
    with Running(emulated, wire):
        process = start(processes, dwm1001(wire, mode))
        probe.wait_for(lambda: found(ranges) == TRUE, 'ranges of all anchors', START_S)
        late_s = [
            time.time() - stamp_from_message(item.header.stamp) / 1e9 for item in ranges[-3:]
        ]
        assert all(-0.001 < each < 5.0 for each in late_s)
        assert ranges[0].header.frame_id == 'uwb_tag'
        stamps = {stamp_from_message(item.header.stamp) for item in ranges}
        assert len(stamps) <= len(ranges) // 3 + 1
        probe.wait_diagnostic(STATUS, 'device stamps', 'time of arrival')
        firmware = '01030001' if mode == 'lec' else '1.3.0 variant 1'
        probe.wait_diagnostic(STATUS, 'device firmware', firmware)
        wire.unplug()
        status = probe.wait_diagnostic(STATUS, 'device state', 'not open')
        assert status.level == b'\x02'
        emulated.reset(time.monotonic())
        wire.plug()
        fresh(probe, ranges)
        probe.wait_diagnostic(STATUS, 'device opened', '2')
    assert process.end() == 0
    assert 'Traceback' not in process.output


def test_linktrack_process_in_a_storm_gives_true_ranges_only(
    probe: Probe, processes: Processes, wire: Wire
) -> None:
    """Cut at random, noise between, one byte in fifty frames changed, plugged in late.

    The device's time dates the ranges after a few seconds; the checksum errors are counted.
    """
    wire.unplug()
    ranges = probe.listen(UwbRange, 'uwb/ranges')
    process = start(processes, linktrack(wire))
    probe.wait_diagnostic(
        STATUS, 'device last failure', lambda text: 'does not exist' in text, START_S
    )
    wire.plug()
    rng = random.Random(5)
    begun = time.monotonic()
    due = 0.0

    def storm() -> bool:
        nonlocal due
        now = time.monotonic() - begun
        while due < now:
            frame = bytearray(node_frame3(LINKTRACK, system_time=round(1000 * due)))
            if rng.random() < 0.05:
                frame[rng.randrange(len(frame))] ^= rng.randrange(1, 256)
            noise = rng.randbytes(rng.randrange(4)).replace(b'\x55', b'')
            cut = rng.randrange(len(frame))
            wire.write(noise + frame[:cut])
            wire.write(bytes(frame[cut:]))
            due += 0.02
        return len(ranges) > 400 and now > 4.5

    probe.wait_for(storm, '400 ranges', START_S)
    assert found(ranges) == TRUE
    assert {item.tag_id for item in ranges} == {'tag7'}
    assert ranges[-1].rx_power == -80.0

    def dated() -> bool:
        storm()  # it goes on: after silence the times of arrival count again
        status = probe.diagnostic(STATUS)
        return status is not None and any(
            item.key == 'device stamps' and item.value.startswith('device time')
            for item in status.values
        )

    probe.wait_for(dated, 'stamps by the time of the device')
    # Damage comes out under several reasons: the sum, the role, the length.
    status = probe.diagnostic(f'{STATUS}: uwb/device')
    assert status is not None
    refused = {item.key: int(item.value) for item in status.values if 'refused: ' in item.key}
    assert refused['refused: checksum does not agree (checksum)'] > 0
    assert process.end() == 0


def test_udp_process_takes_datagrams_of_one_tag(probe: Probe, processes: Processes) -> None:
    """The other tag's, and what is no JSON, are refused and counted."""
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as holder:
        holder.bind(('127.0.0.1', 0))
        port = holder.getsockname()[1]
        ranges = probe.listen(UwbRange, 'uwb/ranges')
        parameters = {
            **ANCHORS,
            'device': 'udp',
            'udp': {'address': '127.0.0.1', 'port': port},
            'device_tag': 'T1',
            'reconnect': {'first': 0.1},
        }
        process = start(processes, parameters)
        # The port is ours: said, and tried again until it is free.
        probe.wait_diagnostic(
            STATUS, 'device last failure', lambda text: 'in use' in text, START_S
        )
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    entries = [{'anchor': name, 'range': metres} for name, metres in METRES.items()]
    number = 0

    def send() -> bool:
        nonlocal number
        number += 1
        for data in (
            datagram(entries, tag='T1', seq=number),
            datagram([{'anchor': 'north', 'range': 9.99}], tag='T2', seq=number),
            b'{"v": 1, "ranges": [',
        ):
            sender.sendto(data, ('127.0.0.1', port))
        return len(ranges) > 60

    with contextlib.closing(sender):
        probe.wait_for(send, 'ranges')
    assert found(ranges) == TRUE
    stream = f'{STATUS}: uwb/device'
    probe.wait_diagnostic(stream, 'refused: another tag (T2)', lambda text: int(text) > 0)
    probe.wait_diagnostic(stream, 'refused: no JSON', lambda text: int(text) > 0)
    assert process.end() == 0


@pytest.mark.parametrize('stamps', ['now', 'captured'])
def test_replay_process_gives_what_was_captured(
    probe: Probe, processes: Processes, tmp_path: Path, stamps: str
) -> None:
    """Ranges with times of now, at the pace that is asked for, or of then."""
    taken = time.time_ns() - 3600 * 10**9
    file = tmp_path / 'drive.trc'
    file.write_bytes(
        capture_header('linktrack', taken)
        + b''.join(
            capture_chunk(taken + k * 20_000_000, node_frame3(LINKTRACK, system_time=20 * k))
            for k in range(1500)
        )
    )
    ranges = probe.listen(UwbRange, 'uwb/ranges')
    parameters = {
        **ANCHORS,
        'device': 'replay',
        'device_ids': ['4', '5', '6'],
        'replay': {'file': str(file), 'rate': 2.0, 'stamps': stamps},
    }
    process = start(processes, parameters)
    probe.wait_for(lambda: len(ranges) >= 60, 'ranges', START_S)
    assert process.end() == 0
    assert found(ranges) == TRUE
    times = sorted({stamp_from_message(item.header.stamp) for item in ranges})
    steps = sorted(b - a for a, b in itertools.pairwise(times))
    age_s = time.time() - times[-1] / 1e9
    # 20 ms in the capture, twice as fast.
    period, oldest, youngest = (10_000_000, 60, 0) if stamps == 'now' else (20_000_000, 4e3, 3e3)
    assert steps[len(steps) // 2] == pytest.approx(period, abs=1_000_000)
    assert youngest <= age_s < oldest


def test_wrong_baud_rate_is_told_of_on_diagnostics(probe: Probe, wire: Wire) -> None:
    """Bytes that are no frames: an error that names the rate, and no range."""
    ranges = probe.listen(UwbRange, 'uwb/ranges')
    probe.host(UwbDriver, parameter_overrides=flat(linktrack(wire)))
    rng = random.Random(8)

    def told() -> bool:
        wire.write(rng.randbytes(30))
        status = probe.diagnostic(STATUS)
        return status is not None and 'wrong baud rate' in status.message

    probe.wait_for(told, 'the words')
    status = probe.diagnostic(STATUS)
    assert status is not None
    assert status.level == b'\x02'
    assert 'linktrack at 921600 bit/s' in status.message
    assert not ranges


def test_still_tag_is_not_called_silent(probe: Probe, wire: Wire) -> None:
    """The module says that it reports every two seconds when still: no error in between."""
    emulated = module()
    emulated.still_s = 2.0
    with Running(emulated, wire):
        probe.host(UwbDriver, parameter_overrides=flat({**dwm1001(wire, 'tlv'), 'silence': 0.5}))
        ranges = probe.listen(UwbRange, 'uwb/ranges')
        probe.wait_for(lambda: ranges, 'ranges')
        probe.wait_diagnostic(STATUS, 'device update_interval_still_ms', '2000')
        emulated.moves = False
        probe.spin(0.3)
        ranges.clear()
        said: set[str] = set()

        def watch() -> bool:
            status = probe.diagnostic(f'{STATUS}: uwb/device')
            said.add('' if status is None else status.message)
            return len(ranges) >= 3

        probe.wait_for(watch, 'the ranges of a still tag')
    assert not [words for words in said if 'silent' in words]


def test_what_comes_is_captured_and_can_be_played(
    probe: Probe, wire: Wire, tmp_path: Path
) -> None:
    """The file of one run is the device of the next, with the same ranges; the end is told."""
    file = tmp_path / 'kept.trc'
    ranges = probe.listen(UwbRange, 'uwb/ranges')
    node = probe.host(UwbDriver, parameter_overrides=flat(linktrack(wire, capture_file=str(file))))
    number = 0

    def send() -> bool:
        nonlocal number
        number += 1
        wire.write(node_frame3(LINKTRACK, system_time=20 * number))
        return len(ranges) >= 30

    probe.wait_for(send, 'ranges')
    node.destroy_node()
    assert 'uwb device' not in {thread.name for thread in threading.enumerate()}
    count = len(ranges)
    ranges.clear()
    parameters = {**linktrack(wire), 'device': 'replay', 'replay': {'file': str(file)}}
    probe.host(UwbDriver, parameter_overrides=flat(parameters))
    probe.wait_for(lambda: len(ranges) >= count, 'the same ranges again')
    probe.wait_diagnostic(STATUS, 'device state', 'ended')
    assert found(ranges) == TRUE


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        (
            {'device': 'sonar'},
            "device: got 'sonar', expected one of exchanges, dwm1001, linktrack",
        ),
        ({'device': 'linktrack'}, "serial.port: got '', expected the path of a serial port"),
        ({'device': 'udp'}, 'udp.port: got 0, expected a port from 1 to 65535'),
        (
            {'device': 'replay', 'replay': {'file': '/no/where.trc'}},
            "replay.file: got '/no/where.trc', expected a capture of one of dwm1001",
        ),
        (
            {'device': 'linktrack', 'serial': {'port': '/dev/x'}, 'device_ids': ['1']},
            "device_ids: got ('1',), expected 3 ids, one for each of anchor_ids",
        ),
    ],
)
def test_bad_start_is_named(probe: Probe, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(f'parameters of /uwb_driver: {words}')):
        UwbDriver(context=probe.context, parameter_overrides=flat({**ANCHORS, **changes}))


def test_corrupt_capture_exits_2_with_one_sentence(processes: Processes, tmp_path: Path) -> None:
    """That error is all that the process says."""
    file = tmp_path / 'bad.trc'
    file.write_bytes(b'\x00' * 1000)
    process = start(processes, {**ANCHORS, 'device': 'replay', 'replay': {'file': str(file)}})
    assert process.wait(START_S) == 2
    assert len(process.output.splitlines()) == 1
    assert process.output.startswith(f"parameters of /uwb_driver: replay.file: got '{file}'")
    assert 'no good header begins it' in process.output
