"""The thread beside the node: what it hands over, how it ends, and that no error is lost."""

import threading
import time

import pytest
from device_writers import datagram

from tablerunner.uwb.device.config import ReconnectConfig
from tablerunner.uwb.device.dialogue import Dialogue
from tablerunner.uwb.device.range_maker import RangeMaker
from tablerunner.uwb.device.reader import MOST_WAITING, DeviceReader
from tablerunner.uwb.device.session import DeviceSession, LinkState
from tablerunner.uwb.device.source import Arrival, Source
from tablerunner.uwb.protocol import Udp


class Feed(Source):
    """Gives a datagram at each read, `count` times; `fault` is raised at the end."""

    def __init__(self, count, fault=None):
        self.left, self.fault, self.closed = count, fault, False

    def open(self):
        pass

    def close(self):
        self.closed = True

    def read(self, wait_s):
        if self.left:
            self.left -= 1
            return [Arrival(time.time_ns(), datagram([{'anchor': 'A1', 'range': 2.0}]))]
        if self.fault:
            raise self.fault
        time.sleep(min(wait_s, 0.01))
        return []


def wait_for(condition, what):
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.01)


def reader(feed):
    parser = Udp()
    session = DeviceSession(
        feed, parser, Dialogue('udp', True), RangeMaker(parser, {}), ReconnectConfig()
    )
    told = threading.Semaphore(0)
    return DeviceReader(session, lambda batch: batch, told.release), told, session


def test_ranges_are_handed_over_and_told_of():
    item, told, session = reader(Feed(3))
    item.start()
    count = 0
    while count < 3:
        assert told.acquire(timeout=5.0)
        count += sum(len(batch.ranges) for batch in item.take())
    assert item.take() == []
    item.stop()
    assert session.health.link is LinkState.ENDED


def test_stop_closes_the_source_soon():
    feed = Feed(0)
    item, _, _ = reader(feed)
    item.start()
    begun = time.monotonic()
    item.stop()
    assert time.monotonic() - begun < 2.0
    assert feed.closed
    item.stop()


def test_error_nobody_foresaw_is_raised_where_it_is_taken():
    item, told, _ = reader(Feed(0, ZeroDivisionError('a bug')))
    item.start()
    assert told.acquire(timeout=5.0)
    with pytest.raises(ZeroDivisionError, match='a bug'):
        item.take()
    item.stop()


def test_nobody_takes_and_memory_stays_bounded():
    """The newest are kept, the lost ones counted."""
    feed = Feed(MOST_WAITING + 50)
    item, told, _ = reader(feed)
    item.start()
    wait_for(lambda: not feed.left, 'the end of the feed')
    item.stop()
    assert len(item.take()) == MOST_WAITING
    assert item.dropped == 50
    assert told.acquire(timeout=0.0)


def test_what_cannot_wait_is_done_in_the_thread_that_reads():
    """Before anybody is told of it, and its result is what is taken."""
    parser = Udp()
    dialogue = Dialogue('udp', True)
    session = DeviceSession(Feed(1), parser, dialogue, RangeMaker(parser, {}), ReconnectConfig())
    told = threading.Event()
    threads = []

    def handle(batch):
        assert not told.is_set()
        threads.append(threading.current_thread().name)
        return len(batch.ranges)

    item = DeviceReader(session, handle, told.set)
    item.start()
    assert told.wait(5.0)
    assert item.take() == [1]
    assert threads == ['uwb device']
    item.stop()
