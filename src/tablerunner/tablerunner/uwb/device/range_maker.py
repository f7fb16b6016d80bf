"""From a device's ranges to ours: of one tag, with the anchors' names, dated by host time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from tablerunner.types import RangeSample, Refusal
from tablerunner.uwb.protocol import ClockMapping, DeviceRange, MappedStamp, Parser, to_sample

OTHER_TAG = 'another tag'
UNKNOWN = 'unknown anchor'

SEQUENCES = 1 << 32
"""A message's sequence number has 32 bits."""


class RangeMaker:
    """Makes the ranges of one device.

    Parameters
    ----------
    parser : Parser
        What reads the device: says whether it counts time.
    names : mapping of str to str
        Name of each anchor by the device's id of it; empty leaves the ids as they are.
    tag : str
        Whose ranges are taken; empty: those of the first that reports.
    least_delay_s : float
        What the fastest message takes from measurement to arrival, where that is known [s].
    """

    def __init__(
        self, parser: Parser, names: Mapping[str, str], tag: str = '', least_delay_s: float = 0.0
    ) -> None:
        self._parser = parser
        self._names = names
        self._wanted = self._tag = tag
        self._least_delay_s = least_delay_s
        self._restarts = 0  # of clocks before the present one
        self._clock: ClockMapping | None = None
        self._last: tuple[int, int] | None = None  # ticks and arrival of the last frame
        self._mapped: MappedStamp | None = None
        self._frame = -1  # arrival of the last frame
        self._count = 0  # of frames

    @property
    def words(self) -> str:
        """How ranges are dated, in words."""
        clock, mapped = self._clock, self._mapped
        if clock is None or mapped is None:
            return 'time of arrival'
        if not mapped.by_device:
            why = 'its time is not known yet' if not clock.usable else 'its time did not fit'
            return f'time of arrival: {why}'
        return (
            f'device time, drift {1e6 * clock.drift:+.1f} ppm, '
            f'deviation {1e3 * mapped.deviation_s:.2f} ms, restarts {clock.restarts}'
        )

    def reset(self) -> None:
        """Forget the device's time and the first tag, as after a reconnection."""
        self._clock = None
        self._last = self._mapped = None
        self._tag = self._wanted

    def make(
        self, ranges: Sequence[DeviceRange], host_stamp: Callable[[int], int]
    ) -> Iterator[RangeSample | Refusal]:
        """Yield each range as ours, or why it is none.

        Parameters
        ----------
        ranges : sequence of DeviceRange
            In the order of arrival.
        host_stamp : callable
            From times of the arrivals to host time [ns].
        """
        for record in ranges:
            if record.device:
                if not self._tag:
                    self._tag = record.device
                if record.device != self._tag:
                    yield Refusal(record.stamp, self._parser.source, record.device, OTHER_TAG)
                    continue
            if record.stamp != self._frame:
                self._frame = record.stamp
                self._count += 1
            stamp = host_stamp(self._stamp(record))
            made = to_sample(record, self._names, self._tag, stamp, self._count % SEQUENCES)
            if isinstance(made, RangeSample) and made.sequence >= SEQUENCES:
                made = replace(made, sequence=made.sequence % SEQUENCES)
            yield made

    def _stamp(self, record: DeviceRange) -> int:
        """Return when a range was measured, in the time of the arrivals."""
        if record.ticks is None or not self._parser.tick_ns:
            return record.stamp
        if self._clock is None:
            self._clock = ClockMapping(
                self._parser.tick_ns, self._parser.counter_bits, self._least_delay_s
            )
        frame = (record.ticks, record.stamp)
        if frame != self._last or self._mapped is None:
            self._last = frame
            self._mapped = self._clock.add(*frame)
        return self._mapped.stamp
