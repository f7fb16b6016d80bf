"""One device over its life: opened, spoken to, read, lost, and opened again.

Nothing here waits longer than it is told to, and nothing starts a thread: `step` is called again
and again, by a `DeviceReader` or by a test.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from tablerunner.types import RangeSample, Refusal
from tablerunner.uwb.device.back_off import BackOff
from tablerunner.uwb.device.capture_file import CaptureWriter
from tablerunner.uwb.device.config import ReconnectConfig
from tablerunner.uwb.device.dialogue import Dialogue
from tablerunner.uwb.device.range_maker import RangeMaker
from tablerunner.uwb.device.source import Arrival, Source, SourceError
from tablerunner.uwb.protocol import DeviceFact, Parser
from tablerunner.uwb.ranger import DEVICE_SOURCE


class LinkState(Enum):
    """Where a session stands."""

    CLOSED = 'not open'
    OPEN = 'open'
    ENDED = 'ended'


@dataclass(frozen=True)
class Batch:
    """What one step brought."""

    ranges: tuple[RangeSample, ...] = ()
    refusals: tuple[Refusal, ...] = ()


@dataclass(frozen=True)
class DeviceHealth:
    """How a session does; counts are from its beginning."""

    link: LinkState
    status: str  # what the dialogue is doing
    trouble: str  # what is wrong now; empty: nothing
    last_failure: str  # why it was closed or could not be opened; empty: never
    opened: int
    failures: int
    bytes_read: int
    frames: int
    frames_since_opened: int
    stamps: str  # how ranges are dated
    facts: Mapping[str, str | int] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """What is wrong, in words; empty: it reads frames."""
        if self.link is LinkState.ENDED:
            return 'the capture has been played to its end'
        if self.link is LinkState.CLOSED:
            return self.last_failure or 'not open yet'
        if self.trouble:
            return self.trouble
        if self.frames_since_opened == 0:
            return self.last_failure or 'open, nothing understood yet'
        return ''


_NOTHING = Batch()


class DeviceSession:
    """Reads a device for as long as it is stepped.

    Parameters
    ----------
    source : Source
        Where its bytes come from.
    parser : Parser
        What reads them.
    dialogue : Dialogue
        What has to be said.
    maker : RangeMaker
        What dates and names the ranges.
    config : ReconnectConfig
        When to give up, and when to try again.
    capture : CaptureWriter or None
        Where arrivals are kept.
    steady : callable
        Returns a time that only goes forward [s].
    """

    def __init__(
        self,
        source: Source,
        parser: Parser,
        dialogue: Dialogue,
        maker: RangeMaker,
        config: ReconnectConfig,
        capture: CaptureWriter | None = None,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source = source
        self._parser = parser
        self._dialogue = dialogue
        self._maker = maker
        self._patience_s = config.patience
        self._back_off = BackOff(config.first, config.longest)
        self._capture = capture
        self._steady = steady
        self._link = LinkState.CLOSED
        self._retry_at = self._opened_at = 0.0
        self._trouble = ''
        self._troubled_since = 0.0
        self._last_failure = ''
        self._opened = self._failures = self._bytes = self._frames_before = 0
        self._facts: dict[str, str | int] = {}

    @property
    def name(self) -> str:
        """What it reads: a port, an address, a file."""
        return self._source.name

    @property
    def health(self) -> DeviceHealth:
        """How it does; may be asked from another thread."""
        facts = dict(self._facts)
        if self._capture is not None:
            facts['capture'] = self._capture.error or 'written'
        return DeviceHealth(
            self._link,
            self._dialogue.status if self._link is LinkState.OPEN else self._link.value,
            self._trouble,
            self._last_failure,
            self._opened,
            self._failures,
            self._bytes,
            self._parser.frames,
            self._parser.frames - self._frames_before,
            self._maker.words,
            facts,
        )

    def step(self, wait_s: float, sleep: Callable[[float], object] = time.sleep) -> Batch:
        """Do what is due, and wait for bytes at most `wait_s` [s]."""
        now = self._steady()
        if self._link is LinkState.ENDED:
            sleep(wait_s)
            return _NOTHING
        if self._link is LinkState.CLOSED:
            if now < self._retry_at:
                sleep(min(wait_s, self._retry_at - now))
                return _NOTHING
            self._open(now)
            return _NOTHING
        try:
            request = self._dialogue.due(now)
            if request:
                self._source.write(request)
            arrivals = self._source.read(min(wait_s, self._dialogue.wait_s(now)))
        except SourceError as error:
            self._fail(str(error))
            return _NOTHING
        batch = self._take(arrivals)
        self._judge()
        return batch

    def close(self) -> None:
        """Close the source, for good."""
        self._source.close()
        if self._capture is not None:
            self._capture.close()
        self._link = LinkState.ENDED

    def _open(self, now: float) -> None:
        try:
            self._source.open()
        except SourceError as error:
            self._fail(str(error))
            return
        self._link = LinkState.OPEN
        self._opened += 1
        self._opened_at = now
        self._frames_before = self._parser.frames
        self._parser.reset()
        self._maker.reset()
        self._dialogue.begin(now)
        self._trouble = ''

    def _take(self, arrivals: list[Arrival]) -> Batch:
        ranges: list[RangeSample] = []
        refusals = list(self._source.refusals())
        for arrival in arrivals:
            if self._capture is not None:
                self._capture.add(arrival)
            if arrival.lost:
                self._parser.reset()
            self._bytes += len(arrival.data)
            before = self._parser.frames
            parsed = self._parser.feed(arrival.data, arrival.stamp)
            believed = self._dialogue.heard(
                arrival.data, parsed, self._parser.frames - before, self._steady()
            )
            refusals += believed.refusals
            for record in believed.records:
                if isinstance(record, DeviceFact):
                    self._facts[record.name] = record.value
            for made in self._maker.make(believed.ranges, self._source.host_stamp):
                if isinstance(made, Refusal):
                    refusals.append(made)
                else:
                    ranges.append(made)
        if not ranges and not refusals:
            return _NOTHING
        return Batch(
            tuple(ranges),
            tuple(Refusal(item.stamp, DEVICE_SOURCE, item.key, item.reason) for item in refusals),
        )

    def _judge(self) -> None:
        """Give a device up that has not been understood for too long."""
        now = self._steady()
        if self._source.finished:
            self._source.close()
            self._link = LinkState.ENDED
            return
        if self._parser.frames > self._frames_before:
            self._back_off.reset()
        trouble = self._dialogue.trouble(now)
        if trouble and not self._trouble:
            self._troubled_since = now
        self._trouble = trouble
        if trouble and now - self._troubled_since >= self._patience_s:
            self._fail(trouble)

    def _fail(self, words: str) -> None:
        """Close; open again at once what had been open for long, else after a while."""
        now = self._steady()
        lasted = self._link is LinkState.OPEN and now - self._opened_at >= self._patience_s
        self._source.close()
        self._link = LinkState.CLOSED
        self._failures += 1
        self._last_failure = words
        self._trouble = ''
        self._retry_at = now if lasted else now + self._back_off.next_s()
