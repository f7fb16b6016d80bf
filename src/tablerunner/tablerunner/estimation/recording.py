"""A whole run of an estimator, kept for what looks back at it: smoothing, tuning."""

from __future__ import annotations

from bisect import bisect_right
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

from tablerunner.estimation.estimator import Estimator, Measurement, Start
from tablerunner.estimation.localizer import Localizer
from tablerunner.estimation.localizer_config import LocalizerConfig
from tablerunner.estimation.outcome import Outcome
from tablerunner.estimation.timeline import Timeline
from tablerunner.estimation.track import OdometryTrack
from tablerunner.odometry.motion import Motion
from tablerunner.types import Anchor, Estimate, OdometrySample, RangeSample, nanoseconds


@dataclass(frozen=True, slots=True)
class Step:
    """One step of an estimator: a motion, then perhaps a measurement."""

    stamp: int
    motion: Motion | None  # since the step before; None: no time has passed
    measurement: Measurement | None
    after: Estimate


class Lead(NamedTuple):
    """An instant before the start of an estimator."""

    stamp: int
    measurement: Measurement | None  # what the start was found from
    onward: Motion  # to the next instant, from the last one to the start


@dataclass(frozen=True)
class Run:
    """What an estimator did from a start to the end, with everything in its place in time.

    Attributes
    ----------
    estimator : Estimator
        The one that ran.
    start : Start
        Where it began.
    first : Estimate
        What it made of the start.
    steps : tuple of Step
        All steps, in order of their stamps.
    lead_in : tuple of Lead
        Odometry and ranges from before the start, in order, as far back as the start was sought.
    """

    estimator: Estimator
    start: Start
    first: Estimate
    steps: tuple[Step, ...]
    lead_in: tuple[Lead, ...]


class _WholeTimeline(Timeline):
    """A timeline that forgets nothing, and yet takes nothing that is older than the history."""

    def __init__(
        self,
        estimator: Estimator,
        track: OdometryTrack,
        start: Start,
        history: int,
        early: list[RangeSample],
    ) -> None:
        super().__init__(estimator, track, start, history)
        self._whole_track = deepcopy(track)
        self._start = start
        self._early = early
        self._oldest = start.stamp

    @property
    def oldest_stamp(self) -> int:
        """Stamp before which nothing can be taken any more."""
        return self._oldest

    def add_odometry(self, sample: OdometrySample) -> None:
        """Add an odometry sample as `Timeline` does."""
        self._whole_track.add(sample)
        super().add_odometry(sample)

    def _trim(self) -> None:
        horizon = self._keys[-1][0] - self._history
        kept = max(bisect_right(self._keys, (horizon, 99, '')) - 1, 0)
        self._oldest = max(self._oldest, self._keys[kept][0])
        self._track.trim(self._oldest)  # as much as others see of it

    def run(self) -> Run:
        """Return the run so far."""
        first, *entries = self._entries
        steps, before = [], first.after.stamp
        for entry in entries:
            stamp = entry.key[0]
            motion = self._whole_track.motion(before, stamp) if stamp > before else None
            steps.append(Step(stamp, motion, entry.measurement, entry.after))
            before = max(before, stamp)
        return Run(self.estimator, self._start, first.after, tuple(steps), self._lead_in())

    def _lead_in(self) -> tuple[Lead, ...]:
        start, oldest = self._start.stamp, self._whole_track.oldest_stamp
        stamps = [oldest, *self._whole_track.stamps_after(oldest)]
        instants: list[tuple[int, RangeSample | None]]
        instants = [(stamp, None) for stamp in stamps if stamp < start]
        instants += [(item.stamp, item) for item in self._early if oldest <= item.stamp < start]
        instants.sort(key=_stamp)
        following = [*(stamp for stamp, _ in instants), start][1:]
        return tuple(
            Lead(stamp, measurement, self._whole_track.motion(stamp, after))
            for (stamp, measurement), after in zip(instants, following, strict=True)
        )


class RecordingLocalizer(Localizer):
    """A localiser that does the same and remembers all of it; memory grows with time."""

    def __init__(self, config: LocalizerConfig, anchors: tuple[Anchor, ...] = ()) -> None:
        self._timelines: list[_WholeTimeline] = []
        self._early: list[RangeSample] = []
        super().__init__(config, anchors)

    def runs(self) -> tuple[Run, ...]:
        """Return the runs so far: a new one began wherever the estimator began anew."""
        return tuple(timeline.run() for timeline in self._timelines)

    def add_range(self, sample: RangeSample) -> Outcome:
        """Take a range as `Localizer` does."""
        if self._timeline is not None:
            return super().add_range(sample)
        self._early.append(sample)
        outcome = super().add_range(sample)
        if outcome.refusals:
            self._early.remove(sample)
        return outcome

    def _begin(self, start: Start) -> None:
        super()._begin(start)
        early, self._early = self._early, []
        timeline = _WholeTimeline(
            self._new_estimator(), self._track, start, nanoseconds(self.config.history), early
        )
        self._timelines.append(timeline)
        self._timeline = timeline


def _stamp(instant: tuple[int, RangeSample | None]) -> int:
    return instant[0]
