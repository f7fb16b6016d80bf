"""Noise of an estimator from the innovations of recorded drives, without any truth.

The logarithms of a few parameters are moved to where the log likelihood of the ranges
(`likelihood`) plus that of a prior is greatest (L-BFGS-B of SciPy). The prior says of each
parameter that its default is right within a factor of 3 (one standard deviation, normal in the
logarithm). Then parameters go back to their defaults, one after the other, least missed first,
as long as that costs less than 1 in the logarithm (Akaike: so much any parameter gains by chance),
the others being sought anew each time. What stays is tuned; of the rest it is said whether the data
confirm the default (they know the parameter better than the prior does) or cannot tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.optimize import minimize

from tablerunner.config.parameter import Config, parameters_of
from tablerunner.errors import TuningError
from tablerunner.estimation.estimator import Estimator, EstimatorConfig
from tablerunner.estimation.likelihood import Drive, RangeInnovations, run_drives
from tablerunner.types import Matrix, RangeSample, Vector

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
_FARTHEST = math.log(30.0)  # from the default
_STEP = 0.05  # of the differences: acceptance at the gate makes small ones rough
_MISSED = 1.0  # of log likelihood
_NOT_MISSED = 0.1  # several that cost no more may go at once
_NOTICED = 0.3


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
    progress: Callable[[int, float], None] = lambda count, gained: None,
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
        Called after each run over the drives with how many there were, and what the best of them
        gained in log likelihood so far.

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
        progress: Callable[[int, float], None],
    ) -> None:
        self._make, self._config, self._drives = make, config, drives
        self._progress = progress
        self._evaluations = 0
        self._known: dict[bytes, RangeInnovations] = {}
        self._names = tuple(names)
        self._defaults = {name: _default(config, name, drives) for name in names}
        self.before = self._run(np.zeros(len(names)))

    def result(self) -> Tuning:
        """Return what was found."""
        size = len(self._names)
        free = np.array([self._matters(index) for index in range(size)])
        best = self._maximise(np.zeros(size), free)
        known = self._deviations(best, free)
        while free.any():
            losses = np.array(
                [self._loss(best, index) if free[index] else np.inf for index in range(size)]
            )
            if losses.min() >= _MISSED:
                break
            back = losses <= max(float(losses.min()), _NOT_MISSED)
            free[back], best[back] = False, 0.0
            best = self._maximise(best, free)
        deviations = np.where(free, self._deviations(best, free), known)
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
        after = self._run(best)
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

    def _run(self, at: Vector) -> RangeInnovations:
        key = at.tobytes()
        if key not in self._known:
            config, factor = self._settings(at)
            self._known[key] = run_drives(
                self._make(config), self._drives, config.huber, config.gate, factor
            )
            self._evaluations += 1
            if self._evaluations > 1:
                gained = self._known[key].log_likelihood - self.before.log_likelihood
                self._progress(self._evaluations, gained)
        return self._known[key]

    def _objective(self, at: Vector) -> float:
        return self._run(at).log_likelihood - 0.5 * float(np.sum((at / _PRIOR_STD) ** 2))

    def _matters(self, index: int) -> bool:
        """Whether the ranges notice the parameter at all, be it far greater or far smaller."""
        if self._defaults[self._names[index]] <= 0.0:
            return False
        changes = []
        for way in (-2.0 * _PRIOR_STD, 2.0 * _PRIOR_STD):
            at = np.zeros(len(self._names))
            at[index] = way
            changes.append(self._run(at).log_likelihood - self.before.log_likelihood)
        return max(abs(change) for change in changes) > _NOTICED

    def _loss(self, best: Vector, index: int) -> float:
        back = best.copy()
        back[index] = 0.0
        return self._objective(best) - self._objective(back)

    def _maximise(self, at: Vector, free: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Vector:
        if not free.any():
            return at

        def whole(part: Vector) -> Vector:
            full = at.copy()
            full[free] = part
            return full

        def cost(part: Vector) -> tuple[float, Vector]:
            full = whole(part)
            slope = np.array([self._slope(full, index) for index in np.flatnonzero(free)])
            return -self._objective(full), -slope

        found = minimize(
            cost,
            at[free],
            jac=True,
            method='L-BFGS-B',
            bounds=[(-_FARTHEST, _FARTHEST)] * int(free.sum()),
            options={'ftol': 1e-6, 'gtol': 0.1, 'maxiter': 25},
        )
        best = whole(np.asarray(found.x))
        return best if self._objective(best) >= self._objective(at) else at

    def _slope(self, at: Vector, index: int) -> float:
        ahead = at.copy()
        ahead[index] += _STEP
        back = at.copy()
        back[index] -= _STEP
        return (self._objective(ahead) - self._objective(back)) / (2.0 * _STEP)

    def _deviations(
        self, at: Vector, free: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    ) -> Vector:
        """Return the deviations of the logarithms that data and prior leave.

        The information is the sum of the outer products of each range's slopes: the slopes of
        independent innovations are uncorrelated (Berndt, Hall, Hall, Hausman 1974).
        """
        size = len(at)
        slopes: Matrix = np.zeros((len(self.before.innovations), size))
        for index in np.flatnonzero(free):
            ahead = at.copy()
            ahead[index] += _STEP
            back = at.copy()
            back[index] -= _STEP
            difference = self._run(ahead).log_likelihoods - self._run(back).log_likelihoods
            slopes[:, index] = difference / (2.0 * _STEP)
        information = slopes.T @ slopes + np.eye(size) / _PRIOR_STD**2
        return np.asarray(np.sqrt(np.diagonal(np.linalg.inv(information))))


def _default(config: EstimatorConfig, name: str, drives: Sequence[Drive]) -> float:
    if name == RANGE_STD:
        told = _told(drives)
        return math.sqrt(float(np.median(told))) if told else config.default_range_std
    value: object = config
    for part in name.split('.'):
        value = getattr(value, part)
    assert isinstance(value, (int, float))
    return float(value)


def _told(drives: Sequence[Drive]) -> list[float]:
    """Return the variances that ranges came with."""
    samples = [step[2] for drive in drives for step in drive.steps]
    return [s.variance_m2 for s in samples if isinstance(s, RangeSample) and s.variance_m2 > 0.0]


def _unit(config: EstimatorConfig, name: str) -> str:
    if name == RANGE_STD:
        return 'm'
    owner: Config = config
    *parts, last = name.split('.')
    for part in parts:
        owner = getattr(owner, part)
    return parameters_of(type(owner))[last][1].unit
