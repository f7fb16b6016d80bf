"""A UDP socket on the loopback: datagrams whole and in order, and a port that is taken."""

import contextlib
import socket
import time

import pytest

from tablerunner.uwb.device.datagrams import LARGEST, MOST_DATAGRAMS, Datagrams
from tablerunner.uwb.device.source import SourceError


@pytest.fixture
def receiver():
    item = Datagrams('127.0.0.1', 0)
    item.open()
    yield item
    item.close()


def send(port, *datagrams):
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender:
        for data in datagrams:
            sender.sendto(data, ('127.0.0.1', port))


def read_all(receiver, count):
    found, end = [], time.monotonic() + 5.0
    while len(found) < count and time.monotonic() < end:
        found += receiver.read(0.1)
    return found


def test_datagrams_come_whole_and_in_order(receiver):
    """Also an empty one, and the longest that IPv4 carries."""
    sent = [b'one', b'', b'x' * 65_507, b'four']
    before = time.time_ns()
    send(receiver.port, *sent)
    arrivals = read_all(receiver, 4)
    assert [arrival.data for arrival in arrivals] == sent
    stamps = [arrival.stamp for arrival in arrivals]
    assert stamps == sorted(stamps)
    assert before <= stamps[0] <= time.time_ns()
    assert LARGEST >= 65_507


def test_flood_is_taken_in_turns(receiver):
    send(receiver.port, *[b'x'] * (MOST_DATAGRAMS + 20))
    assert len(receiver.read(1.0)) == MOST_DATAGRAMS
    assert len(read_all(receiver, 20)) == 20


def test_silence_is_no_error(receiver):
    begun = time.monotonic()
    assert receiver.read(0.05) == []
    assert time.monotonic() - begun >= 0.04


def test_port_that_is_taken_is_said_and_free_later(receiver):
    second = Datagrams('127.0.0.1', receiver.port)
    with pytest.raises(SourceError, match='cannot be listened on: Address already in use'):
        second.open()
    with pytest.raises(SourceError, match='is not open'):
        second.read(0.0)
    receiver.close()
    second.open()
    second.close()


def test_address_that_this_machine_has_not_is_said():
    with pytest.raises(SourceError, match='cannot be listened on'):
        Datagrams('192.0.2.7', 0).open()  # TEST-NET-1: nobody has it
