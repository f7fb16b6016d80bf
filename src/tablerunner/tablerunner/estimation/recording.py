"""A whole run of an estimator, kept for what looks back at it: smoothing, tuning."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

from tablerunner.estimation.estimator import Estimator, Measurement, Start
from tablerunner.estimation.localizer import Localizer, Outcome
from tablerunner.estimation.localizer_config import LocalizerConfig
from tablerunner.estimation.timeline import Timeline
from tablerunner.estimation.track import OdometryTrack
from tablerunner.odometry.motion import Motion
from tablerunner.types import Anchor, Estimate, OdometrySample, nanoseconds


@dataclass(frozen=True, slots=True)
class Step:
    """One step of an estimator: a motion, then perhaps a measurement."""

    stamp: int
    motion: Motion | None  # since the step before; None: no time has passed
    measurement: Measurement | None
    after: Estimate


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
    lead_in : tuple of (int, Motion)
        Odometry from before the start, which was found later: stamps in order, each with the
        motion from there to the next (the last one: to the start).
    """

    estimator: Estimator
    start: Start
    first: Estimate
    steps: tuple[Step, ...]
    lead_in: tuple[tuple[int, Motion], ...]


class _WholeTimeline(Timeline):
    """A timeline that forgets nothing, and yet takes nothing that is older than the history."""

    def __init__(
        self, estimator: Estimator, track: OdometryTrack, start: Start, history: int
    ) -> None:
        super().__init__(estimator, track, start, history)
        self._start = start
        self._oldest = start.stamp

    @property
    def oldest_stamp(self) -> int:
        """Stamp before which nothing can be taken any more."""
        return self._oldest

    def _trim(self) -> None:
        horizon = self._keys[-1][0] - self._history
        kept = max(bisect_right(self._keys, (horizon, 99, '')) - 1, 0)
        self._oldest = max(self._oldest, self._keys[kept][0])

    def run(self) -> Run:
        """Return the run so far."""
        first, *entries = self._entries
        steps, before = [], first.after.stamp
        for entry in entries:
            stamp = entry.key[0]
            motion = self._track.motion(before, stamp) if stamp > before else None
            steps.append(Step(stamp, motion, entry.measurement, entry.after))
            before = max(before, stamp)
        start = self._start.stamp
        oldest = self._track.oldest_stamp
        stamps = [s for s in (oldest, *self._track.stamps_after(oldest)) if s < start]
        lead_in = tuple(
            (stamp, self._track.motion(stamp, after))
            for stamp, after in zip(stamps, [*stamps[1:], start], strict=True)
        )
        return Run(self.estimator, self._start, first.after, tuple(steps), lead_in)


class RecordingLocalizer(Localizer):
    """A localiser that does the same and remembers all of it; memory grows with time."""

    def __init__(self, config: LocalizerConfig, anchors: tuple[Anchor, ...] = ()) -> None:
        self._ended: list[Run] = []
        self._whole: _WholeTimeline | None = None
        super().__init__(config, anchors)

    def runs(self) -> tuple[Run, ...]:
        """Return the runs so far: a new one began wherever the estimator began anew."""
        return (*self._ended, *(() if self._whole is None else (self._whole.run(),)))

    def add_odometry(self, sample: OdometrySample) -> Outcome:
        """Take odometry as `Localizer` does."""
        if self._timeline is None:
            self._end()  # before the track of a lost run is trimmed
        return super().add_odometry(sample)

    def _begin(self, start: Start) -> None:
        self._end()
        super()._begin(start)
        self._whole = _WholeTimeline(
            self._new_estimator(), self._track, start, nanoseconds(self.config.history)
        )
        self._timeline = self._whole

    def _end(self) -> None:
        if self._whole is not None:
            self._ended.append(self._whole.run())
        self._whole = None
