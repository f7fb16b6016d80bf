"""Noise of an estimator from the innovations of recorded drives, without any truth.

The logarithms of a few parameters are moved to where the log likelihood of the ranges
(`likelihood`) plus that of a prior is greatest (SciPy, trust region). The prior says of each
parameter that its default is right within a factor of 3 (one standard deviation, normal in the
logarithm). Then parameters go back to their defaults, one after the other, least missed first,
as long as that costs less than 1.92 in the logarithm (what one parameter in twenty gains by mere
chance: the likelihood ratio test at 5 %), the others being sought anew each time. What stays is
tuned; of the rest it is said whether the data confirm the default (they know the parameter better
than the prior does) or cannot tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from tablerunner.config.parameter import Config, parameters_of
from tablerunner.errors import TuningError
from tablerunner.estimation.estimator import Estimator, EstimatorConfig
from tablerunner.estimation.likelihood import Drive, RangeInnovations, run_drives
from tablerunner.types import Matrix, Vector

PRIOR_FACTOR = 3.0
"""By which factor a default may be wrong: one standard deviation of the prior."""

RANGE_STD = 'range_std'
"""The deviation of ranges, as the driver tells it or `default_range_std`: both by one factor."""

TUNABLE = (
    RANGE_STD,
    'range_bias_std',
    'range_bias_walk',
    'motion.distance',
    'motion.heading_per_turn',
    'motion.heading_per_distance',
    'motion.heading_per_time',
    'gyro_bias_walk',
)
"""What is tuned: of `EstimatorConfig`, dotted, and RANGE_STD."""

FEWEST_RANGES = 50
"""With fewer nothing is tuned."""

_PRIOR_STD = math.log(PRIOR_FACTOR)
_FLAT = 0.2  # slope of the log likelihood at which the search ends: 0.2 deviations or less off
_STEP = 0.02  # of the differences
_NEVER = 4.0  # deviations that no mean innovation reaches: it is clipped there
_MISSED = 1.92  # of log likelihood: half of the 95 % point of chi-square with one degree
_NOT_MISSED = 0.1  # several that cost no more may go at once
_NOTICED = 0.3


Choice = NDArray[np.bool_]


class Verdict(Enum):
    """What the data say of a parameter."""

    TUNED = 'tuned'
    CONFIRMED = 'default confirmed'
    HELD = 'held: not observable'


@dataclass(frozen=True, slots=True)
class Tuned:
    """One parameter.

    Attributes
    ----------
    name : str
        Of `TUNABLE`.
    unit : str
    before, after : float
    factor : float
        One standard deviation of what data and prior leave open: the value times or by this.
    verdict : Verdict
    told : bool
        Of RANGE_STD: whether the ranges came with a variance, by what made them.
    """

    name: str
    unit: str
    before: float
    after: float
    factor: float
    verdict: Verdict
    told: bool = False


@dataclass(frozen=True)
class Tuning:
    """The result of `tune`.

    Attributes
    ----------
    parameters : tuple of Tuned
        In the order of `TUNABLE`.
    config : EstimatorConfig
        With the tuned values in it.
    range_std_factor : float
        By which deviations told with the ranges are to be multiplied.
    before, after : RangeInnovations
        With the settings given, and with those found.
    evaluations : int
        How often the drives were run.
    """

    parameters: tuple[Tuned, ...]
    config: EstimatorConfig
    range_std_factor: float
    before: RangeInnovations
    after: RangeInnovations
    evaluations: int


def tune(
    make: Callable[[EstimatorConfig], Estimator],
    config: EstimatorConfig,
    drives: Sequence[Drive],
    names: Sequence[str] = TUNABLE,
    progress: Callable[[int], None] = lambda count: None,
) -> Tuning:
    """Find the noise under which the ranges of some drives are most likely.

    Parameters
    ----------
    make : callable
        Makes the estimator for given settings.
    config : EstimatorConfig
        Where to begin: the defaults that the prior holds to.
    drives : sequence of Drive
        What was recorded.
    names : sequence of str
        What to tune, of `TUNABLE`; what is 0 in `config` stays 0.
    progress : callable
        Called after each run over the drives with how many there were.

    Raises
    ------
    TuningError
        There are fewer than `FEWEST_RANGES` ranges.
    """
    search = _Search(make, config, drives, names, progress)
    if len(search.before.innovations) < FEWEST_RANGES:
        raise TuningError(
            f'{len(search.before.innovations)} ranges are too few to tune noise: at least '
            f'{FEWEST_RANGES} must reach the estimator'
        )
    return search.result()


def set_parameters(config: EstimatorConfig, values: dict[str, float]) -> EstimatorConfig:
    """Return settings with some values (dotted names) set, within their bounds."""
    own: dict[str, float] = {}
    nested: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        head, _, rest = name.partition('.')
        if rest:
            nested.setdefault(head, {})[rest] = value
        else:
            own[head] = _bounded(config, head, value)
    parts = {
        head: getattr(config, head).replace(
            **{name: _bounded(getattr(config, head), name, value) for name, value in items.items()}
        )
        for head, items in nested.items()
    }
    return config.replace(**own, **parts)


def _bounded(config: Config, name: str, value: float) -> float:
    _, info = parameters_of(type(config))[name]
    return min(value, math.inf if info.high is None else info.high)


class _Search:
    """The search for the best parameters; `_at` is the vector of logarithms of their factors."""

    def __init__(
        self,
        make: Callable[[EstimatorConfig], Estimator],
        config: EstimatorConfig,
        drives: Sequence[Drive],
        names: Sequence[str],
        progress: Callable[[int], None],
    ) -> None:
        self._make, self._config, self._drives = make, config, drives
        self._progress = progress
        self._evaluations = 0
        self._known: dict[bytes, Vector] = {}  # log likelihoods of the ranges
        self._names = tuple(names)
        self._defaults = {name: _default(config, name, drives) for name in names}
        self.before = self._run(config, 1.0)

    def result(self) -> Tuning:
        """Return what was found."""
        free, best = self._survey()
        best = self._maximise(best, free)
        deviations = self._deviations(best, free)
        while free.any():
            # What would be missed when one goes back and the others make up for it (Wald).
            missed = np.where(free, 0.5 * (best / self._deviations(best, free)) ** 2, np.inf)
            back = missed <= max(float(missed.min()), _NOT_MISSED)
            fewer = free & ~back
            found = self._maximise(np.where(back, 0.0, best), fewer)
            if self._objective(best) - self._objective(found) >= _MISSED * int(back.sum()):
                break
            free, best = fewer, found
        deviations = np.where(free, self._deviations(best, free), deviations)
        parameters = []
        for name, own, deviation, tuned in zip(self._names, best, deviations, free, strict=True):
            # The data know it better than the prior: they hold more than half of what is known.
            seen = deviation < math.sqrt(0.5) * _PRIOR_STD
            verdict = Verdict.TUNED if tuned else Verdict.CONFIRMED if seen else Verdict.HELD
            before = self._defaults[name]
            parameters.append(
                Tuned(
                    name,
                    _unit(self._config, name),
                    before,
                    before * math.exp(own),
                    math.exp(deviation),
                    verdict,
                    name == RANGE_STD and bool(_told(self._drives)),
                )
            )
        config, factor = self._settings(best)
        after = self._run(config, factor)
        return Tuning(tuple(parameters), config, factor, self.before, after, self._evaluations)

    def _settings(self, at: Vector) -> tuple[EstimatorConfig, float]:
        values = {
            name: self._defaults[name] * math.exp(own)
            for name, own in zip(self._names, at.tolist(), strict=True)
        }
        own = values.pop(RANGE_STD, None)
        factor = 1.0 if own is None else own / self._defaults[RANGE_STD]
        # Of a range that comes without a variance.
        values['default_range_std'] = self._config.default_range_std * factor
        return set_parameters(self._config, values), factor

    def _run(self, config: EstimatorConfig, factor: float) -> RangeInnovations:
        self._evaluations += 1
        return run_drives(self._make(config), self._drives, config.huber, config.gate, factor)

    def _each(self, at: Vector) -> Vector:
        """Return the log likelihood of each range; worked out once for each place."""
        key = at.tobytes()
        if key not in self._known:
            config, factor = self._settings(at)
            # No judgement by what an anchor read for a while: it comes and goes in jumps, which
            # would hide every slope. The loss forgives what is blocked.
            plain = config.replace(persistence=_NEVER, doubt=_NEVER)
            self._known[key] = self._run(plain, factor).log_likelihoods
            self._progress(self._evaluations)
        return self._known[key]

    def _objective(self, at: Vector) -> float:
        return float(self._each(at).sum() - 0.5 * np.sum((at / _PRIOR_STD) ** 2))

    def _survey(self) -> tuple[Choice, Vector]:
        """Return which parameters the ranges notice at all, and a place from where to climb.

        Each is tried far smaller and far greater, the others staying at the best so far: from
        noise so wrong that most ranges are refused, no slope leads anywhere.
        """
        size = len(self._names)
        free, best = np.zeros(size, dtype=bool), np.zeros(size)
        for index, name in enumerate(self._names):
            if self._defaults[name] <= 0.0:
                continue
            tried = [best]
            for way in (-2.0, -1.0, 1.0, 2.0):
                tried.append(best.copy())
                tried[-1][index] = way * _PRIOR_STD
            sums = [float(self._each(at).sum()) for at in tried]
            free[index] = max(sums) - min(sums) > _NOTICED
            best = max(tried, key=self._objective)
        return free, best

    def _maximise(self, at: Vector, free: Choice) -> Vector:
        if not free.any():
            return at

        def whole(part: Vector) -> Vector:
            full: Vector = at.copy()
            full[free] = part
            return full

        found = minimize(
            lambda part: -self._objective(whole(part)),
            at[free],
            jac=lambda part: -self._gradient(whole(part), free)[free],
            hess=lambda part: self._information(whole(part), free)[np.ix_(free, free)],
            method='dogleg',
            options={'gtol': _FLAT, 'maxiter': 12, 'max_trust_radius': 2.0},
        )
        best: Vector = whole(np.asarray(found.x))
        return best if self._objective(best) >= self._objective(at) else at

    def _gradient(self, at: Vector, free: Choice) -> Vector:
        return np.asarray(self._slopes(at, free).sum(axis=0) - at / _PRIOR_STD**2)

    def _information(self, at: Vector, free: Choice) -> Matrix:
        """Return what is known of the logarithms from data and prior, shape (n, n).

        It is the sum of the outer products of each range's slopes: the slopes of independent
        innovations are uncorrelated (Berndt, Hall, Hall, Hausman 1974).
        """
        # The likelihood steps where a range comes to be judged otherwise; steps are no slopes. The
        # steepest that a range has, at the gate, is this.
        steepest = self._config.huber * math.sqrt(self._config.gate)
        slopes = np.clip(self._slopes(at, free), -steepest, steepest)
        return np.asarray(slopes.T @ slopes + np.eye(len(at)) / _PRIOR_STD**2)

    def _deviations(self, at: Vector, free: Choice) -> Vector:
        information = self._information(at, free)
        return np.asarray(np.sqrt(np.diagonal(np.linalg.inv(information))))

    def _slopes(self, at: Vector, free: Choice) -> Matrix:
        """Return d(log likelihood of each range)/d(logarithm), shape (ranges, n)."""
        slopes: Matrix = np.zeros((len(self.before.innovations), len(at)))
        for index in np.flatnonzero(free).tolist():
            step = np.zeros(len(at))
            step[index] = _STEP
            slopes[:, index] = (self._each(at + step) - self._each(at - step)) / (2.0 * _STEP)
        return slopes


def _default(config: EstimatorConfig, name: str, drives: Sequence[Drive]) -> float:
    if name == RANGE_STD:
        told = _told(drives)
        return math.sqrt(float(np.median(told))) if told else config.default_range_std
    owner, last = _owner(config, name)
    return float(getattr(owner, last))


def _told(drives: Sequence[Drive]) -> list[float]:
    """Return the variances that ranges came with."""
    samples = [item for drive in drives for step in drive.steps for item in step.ranges]
    return [item.variance_m2 for item in samples if item.variance_m2 > 0.0]


def _unit(config: EstimatorConfig, name: str) -> str:
    if name == RANGE_STD:
        return 'm'
    owner, last = _owner(config, name)
    return parameters_of(type(owner))[last][1].unit


def _owner(config: EstimatorConfig, name: str) -> tuple[Config, str]:
    """Return the part of the settings that a dotted name is in, and its name there."""
    owner: Config = config
    *parts, last = name.split('.')
    for part in parts:
        owner = getattr(owner, part)
    return owner, last
