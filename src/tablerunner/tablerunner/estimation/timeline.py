"""Measurements in order of their stamps, however late they come.

The estimate after each of the last steps is kept. A measurement that belongs before some of them
is put in its place and everything after it is worked out again, so that the result does not
depend on the order of arrival: late data in place equal on-time data, to the last bit.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field

from tablerunner.estimation.estimator import Estimator, Measurement, Start
from tablerunner.estimation.track import OdometryTrack
from tablerunner.types import Estimate, Innovation, OdometrySample, RangeSample

_Key = tuple[int, int, str]  # stamp, rank, source key: a total order, whatever arrives first


_RANGE = 1
"""Rank of a range among entries of one stamp: after odometry, before poses."""
_POSE, _WITHHELD = 2, 3
"""What is withheld is only judged, after all that counts."""


@dataclass(slots=True)
class _Entry:
    key: _Key
    measurement: Measurement | None  # None: an odometry sample, prediction only
    after: Estimate = field(init=False)


class Timeline:
    """Runs an estimator along odometry and measurements over a sliding history.

    Parameters
    ----------
    estimator : Estimator
    track : OdometryTrack
        Odometry; samples are added through `add_odometry`.
    start : Start
        Where to begin; the track must reach back to its stamp.
    history : int
        How far back a measurement may belong [ns].
    """

    def __init__(
        self, estimator: Estimator, track: OdometryTrack, start: Start, history: int
    ) -> None:
        self.estimator = estimator
        self._track = track
        self._history = history
        first = _Entry((start.stamp, -1, ''), None)
        first.after = estimator.start(start)
        self._entries = [first]
        self._keys = [first.key]
        for stamp in track.stamps_after(start.stamp):
            self._insert(_Entry((stamp, 0, ''), None))
        self._run(1)

    @property
    def newest(self) -> Estimate:
        """The estimate at the newest stamp."""
        return self._entries[-1].after

    @property
    def oldest_stamp(self) -> int:
        """Stamp of the oldest estimate that is kept: nothing earlier can be taken."""
        return self._keys[0][0]

    def takes(self, stamp: int) -> bool:
        """Whether the history reaches back to this stamp."""
        return stamp > self.oldest_stamp

    def add_odometry(self, sample: OdometrySample) -> None:
        """Add an odometry sample and work out again what came after the one before it."""
        before = self._track.before(sample.stamp)
        self._track.add(sample)
        self._insert(_Entry((sample.stamp, 0, ''), None))
        since = sample.stamp if before is None else before.stamp
        # Whatever lay beyond the sample before was predicted on held velocity.
        self._run(bisect_right(self._keys, (since, 99, '')))
        self._trim()

    def add(self, measurement: Measurement, *, withhold: bool = False) -> Innovation | None:
        """Add a measurement; return what it did, None if the same one is already there.

        With `withhold` the estimate stays: the innovation says what it would have done.
        """
        key = _key(measurement)
        aside = (key[0], _WITHHELD, key[2])
        if self._holds(key) or self._holds(aside):
            return None
        index = self._insert(_Entry(aside if withhold else key, measurement))
        innovation = self._run(index)
        self._trim()
        return innovation

    def withhold_past(self, source: str) -> None:
        """Take back all ranges and what `source` gave, as far as the history reaches."""
        first = bisect_right(self._keys, (self.oldest_stamp, 99, ''))
        entries = self._entries[first:]
        for entry in entries:
            stamp, rank, name = entry.key
            if rank == _RANGE or (rank == _POSE and name == source):
                entry.key = (stamp, _WITHHELD, name)
        entries.sort(key=_by_key)
        self._entries[first:] = entries
        self._keys[first:] = [entry.key for entry in entries]
        self._run(first)

    def _holds(self, key: _Key) -> bool:
        position = bisect_left(self._keys, key)
        return position < len(self._keys) and self._keys[position] == key

    def _insert(self, entry: _Entry) -> int:
        index = bisect_right(self._keys, entry.key)
        self._keys.insert(index, entry.key)
        self._entries.insert(index, entry)
        return index

    def _run(self, index: int) -> Innovation | None:
        """Work out all entries from `index` on; return the innovation of that one.

        Ranges of one instant are one step: who comes first in it does not matter.
        """
        position, wanted = self._first_of_instant(max(index, 1)), None
        while position < len(self._entries):
            estimate = self._entries[position - 1].after
            stamp = self._keys[position][0]
            if stamp > estimate.stamp:
                motion = self._track.motion(estimate.stamp, stamp)
                estimate = self.estimator.predict(estimate, motion, stamp)
            samples = self._ranges_at(position)
            innovations: tuple[Innovation, ...] = ()
            if samples:
                estimate, innovations = self.estimator.update_ranges(estimate, samples)
            else:
                entry = self._entries[position]
                if entry.measurement is not None:
                    after, innovation = self.estimator.update(estimate, entry.measurement)
                    estimate = estimate if entry.key[1] == _WITHHELD else after
                    innovations = (innovation,)
            for offset in range(max(len(innovations), 1)):
                self._entries[position + offset].after = estimate
            if position <= index < position + len(innovations):
                wanted = innovations[index - position]
            position += max(len(innovations), 1)
        return wanted

    def _first_of_instant(self, index: int) -> int:
        """Return where the ranges begin that share the instant of a range."""
        if index >= len(self._keys):
            return index
        stamp, rank, _ = self._keys[index]
        while rank == _RANGE and self._keys[index - 1][:2] == (stamp, _RANGE):
            index -= 1
        return index

    def _ranges_at(self, position: int) -> list[RangeSample]:
        """Return the ranges of the instant that begins at an entry; none if it is no range."""
        instant, samples = (self._keys[position][0], _RANGE), []
        while position < len(self._keys) and self._keys[position][:2] == instant:
            measurement = self._entries[position].measurement
            if isinstance(measurement, RangeSample):
                samples.append(measurement)
            position += 1
        return samples

    def _trim(self) -> None:
        horizon = self._keys[-1][0] - self._history
        drop = bisect_right(self._keys, (horizon, 99, '')) - 1
        if drop > 0:
            del self._keys[:drop]
            del self._entries[:drop]
        # An interval that ends in the history may begin before it.
        self._track.trim(self._keys[0][0])


def _by_key(entry: _Entry) -> _Key:
    return entry.key


def _key(measurement: Measurement) -> _Key:
    if isinstance(measurement, RangeSample):
        return (measurement.stamp, _RANGE, f'{measurement.anchor_id}/{measurement.tag_id}')
    return (measurement.stamp, _POSE, measurement.source)
