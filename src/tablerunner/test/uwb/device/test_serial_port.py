"""A serial port over a pseudo-terminal: read, written, pulled, plugged, locked, and refused."""

import errno
import os
import select
import time

import pytest
import serial
from device_writers import node_frame3
from emulated import Wire

from tablerunner.uwb.device.serial_port import SerialPort
from tablerunner.uwb.device.source import SourceError


@pytest.fixture
def wire(tmp_path):
    item = Wire(tmp_path / 'ttyUWB')
    item.plug()
    yield item
    item.unplug()


def read_all(port, count):
    """Return the bytes that come, at least so many, within five seconds."""
    data, end = b'', time.monotonic() + 5.0
    while len(data) < count and time.monotonic() < end:
        data += b''.join(arrival.data for arrival in port.read(0.1))
    return data


def repeat(act):
    """Do it until it fails: the system may notice a pulled wire a moment later."""
    for _ in range(50):
        act()
        time.sleep(0.01)


def test_bytes_arrive_unchanged_with_their_time(wire):
    """All 256 values both ways: no byte is taken for a control character."""
    port = SerialPort(str(wire.path), 115_200)
    port.open()
    every = bytes(range(256))
    before = time.time_ns()
    wire.write(every)
    (arrival,) = port.read(5.0)[:1]
    assert before <= arrival.stamp <= time.time_ns()
    assert arrival.data + read_all(port, 256 - len(arrival.data)) == every
    port.write(every)
    heard, end = b'', time.monotonic() + 5.0
    while len(heard) < 256 and time.monotonic() < end:
        heard += wire.read()
    assert heard == every
    port.close()


def test_what_waited_before_it_was_opened_is_forgotten(wire):
    """Nobody knows when that came: as ranges of now it would be wrong."""
    held = os.open(wire.path, os.O_RDWR | os.O_NOCTTY)  # a port keeps what comes while it is open
    wire.write(node_frame3([(1, 0, 1000, -80, -80)]))
    assert select.select([held], [], [], 5.0)[0]
    port = SerialPort(str(wire.path), 115_200)
    port.open()
    assert port.read(0.1) == []
    port.close()
    os.close(held)


def test_unplugged_and_plugged_again(wire):
    """The same path is another port then; reading says that it has gone, once."""
    port = SerialPort(str(wire.path), 115_200)
    port.open()
    wire.unplug()
    with pytest.raises(SourceError, match='has gone'):
        repeat(lambda: port.read(0.1))
    with pytest.raises(SourceError, match='does not exist: is the device plugged in'):
        port.open()
    wire.plug()
    port.open()
    wire.write(b'back')
    assert read_all(port, 4) == b'back'
    port.close()


def test_two_programs_do_not_share_a_port(wire):
    """Each would get half of the bytes."""
    first, second = (SerialPort(str(wire.path), 115_200) for _ in range(2))
    first.open()
    with pytest.raises(SourceError, match='is used by another program'):
        second.open()
    first.close()
    second.open()
    second.close()


@pytest.mark.parametrize('kind', ['file', 'folder'])
def test_path_that_is_no_port_is_said(tmp_path, kind):
    path = tmp_path / 'thing'
    path.write_text('') if kind == 'file' else path.mkdir()
    with pytest.raises(SourceError, match='is no serial port'):
        SerialPort(str(path), 115_200).open()


@pytest.mark.parametrize(
    ('number', 'words'),
    [
        (errno.EACCES, 'no permission: add the user to the group dialout'),
        (errno.EBUSY, 'is used by another program'),
        (errno.EIO, 'cannot be opened: Input/output error'),
    ],
)
def test_reason_of_the_system_is_told_with_what_to_do(monkeypatch, number, words):
    """As root no permission is ever missing: the error is made here."""

    def refuse(*arguments, **settings):
        raise serial.SerialException(number, 'could not open port')

    monkeypatch.setattr(serial, 'Serial', refuse)
    with pytest.raises(SourceError, match=words):
        SerialPort('/dev/ttyX', 115_200).open()


def test_write_to_a_pulled_port_is_an_error(wire):
    port = SerialPort(str(wire.path), 115_200)
    port.open()
    wire.unplug()
    with pytest.raises(SourceError):
        repeat(lambda: port.write(b'si\r'))
    with pytest.raises(SourceError, match='is not open'):
        port.read(0.0)
