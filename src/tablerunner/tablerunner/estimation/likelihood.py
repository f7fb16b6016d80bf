"""How likely the ranges of a drive are under given noise: what tuning maximises.

The innovations of a filter with the right noise are independent with covariance S, so that the
log likelihood of all ranges is a sum over them (Schweppe 1965; Saerkkae 2013, section 12.3.1). It
needs no truth. Blocked ranges must not decide it: with the normalised innovation z and a loss

    rho(z) = z^2                for |z| up to k          (k: `huber` of the filter)
             2 k |z| - k^2      beyond
             rho(g)             beyond g                 (g: root of `gate`, as the filter refuses)

each range counts  -(beta log S + rho(z)) / 2,  with beta = E[z rho'(z) / 2] for a standard normal
z, which makes the noise that maximises it the true one where nothing is blocked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tablerunner.estimation.estimator import Estimator, Measurement, Start
from tablerunner.estimation.recording import Run
from tablerunner.estimation.smoother import extend_back, smooth
from tablerunner.odometry.motion import Motion
from tablerunner.types import HeadingSample, PoseSample, RangeSample, Vector

_START_FACTOR = 3.0
_LONGEST_MERGED_S = 0.1


class DriveStep(NamedTuple):
    """A motion, then what was measured at its end."""

    stamp: int
    motion: Motion | None  # since the step before; None: no time has passed
    ranges: tuple[RangeSample, ...] = ()  # of one instant
    other: PoseSample | HeadingSample | None = None


@dataclass(frozen=True)
class Drive:
    """A start and all motions and measurements after it, decoded and in order.

    Attributes
    ----------
    start : Start
        Pose only; range biases begin at their prior.
    steps : tuple of DriveStep
    """

    start: Start
    steps: tuple[DriveStep, ...]


@dataclass(frozen=True)
class RangeInnovations:
    """What a filter found of each range that it compared with its estimate, n of them.

    Attributes
    ----------
    anchors : ndarray of str, shape (n,)
    innovations : ndarray, shape (n,)
        Measured minus expected [m].
    variances : ndarray, shape (n,)
        S [m^2].
    accepted : ndarray of bool, shape (n,)
    log_likelihoods : ndarray, shape (n,)
        Robust, up to a constant that is the same for all noise.
    """

    anchors: NDArray[np.str_]
    innovations: Vector
    variances: Vector
    accepted: NDArray[np.bool_]
    log_likelihoods: Vector

    @property
    def nis(self) -> Vector:
        """Normalised innovations squared."""
        return np.asarray(self.innovations**2 / self.variances)

    @property
    def log_likelihood(self) -> float:
        """Of all ranges together."""
        return float(np.sum(self.log_likelihoods))


def drive_of(run: Run) -> Drive:
    """Return the drive of a run, from where the search for its start began, if there was one.

    The pose that the smoothed run is led back to is where to linearise; its deviations are
    multiplied by 3, since it was found from ranges that are to be judged.
    """
    if not run.lead_in:
        start = Start(run.start.stamp, run.start.pose, run.start.pose_covariance)
        steps = [(step.stamp, step.motion, step.measurement) for step in run.steps]
        return Drive(start, tuple(_merged(steps)))
    smoothed = smooth(run)[0]
    first = [*extend_back(run, smoothed), smoothed][0]
    start = Start(first.stamp, first.mean[:3], _START_FACTOR**2 * first.pose_covariance)
    steps = []
    onward: Motion | None = None
    for lead in run.lead_in:
        steps.append((lead.stamp, onward, lead.measurement))
        onward = lead.onward if lead.onward.dt_s > 0.0 else None
    steps.append((run.start.stamp, onward, None))
    steps += [(step.stamp, step.motion, step.measurement) for step in run.steps]
    return Drive(start, tuple(_merged(steps)))


def _merged(
    steps: Iterable[tuple[int, Motion | None, Measurement | None]],
) -> Iterator[DriveStep]:
    """Yield the steps with ranges of one instant and short motions before one put together."""
    gathered: Motion | None = None
    ranges: list[RangeSample] = []
    last = 0
    for stamp, motion, measurement in steps:
        if ranges and (motion is not None or not isinstance(measurement, RangeSample)):
            yield DriveStep(last, gathered, tuple(ranges))
            gathered, ranges = None, []
        if motion is not None:
            if gathered is not None and gathered.dt_s + motion.dt_s > _LONGEST_MERGED_S:
                yield DriveStep(last, gathered)
                gathered = None
            before = gathered or Motion(0.0, 0.0, 0.0)
            gathered = Motion(
                before.distance_m + motion.distance_m,
                before.turn_rad + motion.turn_rad,
                before.dt_s + motion.dt_s,
            )
        if isinstance(measurement, RangeSample):
            ranges.append(measurement)
        elif measurement is not None:
            yield DriveStep(stamp, gathered, (), measurement)
            gathered = None
        last = stamp
    if ranges or gathered is not None:
        yield DriveStep(last, gathered, tuple(ranges))


def run_drives(
    estimator: Estimator,
    drives: Iterable[Drive],
    huber: float,
    gate: float,
    range_std_factor: float = 1.0,
) -> RangeInnovations:
    """Run an estimator over drives and return what became of the ranges.

    Parameters
    ----------
    estimator : Estimator
        One that takes ranges.
    drives : iterable of Drive
    huber, gate : float
        As of the estimator's settings.
    range_std_factor : float
        By which the deviation that a range comes with is multiplied.
    """
    anchors: list[str] = []
    rows: list[tuple[float, float, bool]] = []
    square = range_std_factor**2
    for drive in drives:
        estimate = estimator.start(drive.start)
        for stamp, motion, ranges, other in drive.steps:
            if motion is not None:
                estimate = estimator.predict(estimate, motion, stamp)
            if other is not None:
                estimate, _ = estimator.update(estimate, other)
            if not ranges:
                continue
            samples: Sequence[RangeSample] = ranges
            if square != 1.0:
                samples = [replace(item, variance_m2=square * item.variance_m2) for item in ranges]
            estimate, found = estimator.update_ranges(estimate, samples)
            for seen in found:
                if seen.considered:
                    anchors.append(seen.key)
                    rows.append((seen.innovation.item(), seen.covariance.item(), seen.accepted))
    table = np.array(rows, dtype=float).reshape(-1, 3)
    innovations, variances = table[:, 0], table[:, 1]
    loss = robust_loss(innovations / np.sqrt(variances), huber, gate)
    weight = scale_weight(huber, gate)
    return RangeInnovations(
        np.array(anchors, dtype=str),
        innovations,
        variances,
        table[:, 2] > 0.5,
        -0.5 * (weight * np.log(variances) + loss),
    )


def robust_loss(normalised: Vector, huber: float, gate: float) -> Vector:
    """Return rho of each normalised innovation; see the top of this file."""
    size = np.minimum(np.abs(normalised), math.sqrt(gate))
    return np.where(size <= huber, size**2, 2.0 * huber * size - huber**2)


def scale_weight(huber: float, gate: float) -> float:
    """Return beta, by which log S must be multiplied; 1 without any robustness."""
    limit = math.sqrt(gate)
    knee = min(huber, limit)
    # E[z^2; |z| < k] + 2 k E[z; k < z < g], in closed form.
    inner = 2.0 * float(ndtr(knee)) - 1.0 - 2.0 * knee * _density(knee)
    return inner + 2.0 * knee * (_density(knee) - _density(limit))


def _density(value: float) -> float:
    return math.exp(-0.5 * value * value) / math.sqrt(2.0 * math.pi)
