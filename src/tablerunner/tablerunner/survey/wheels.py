"""Wheel radii and track from a drive: encoders, gyroscope, and ranges to known anchors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError, GeometryError
from tablerunner.odometry import MotionNoise
from tablerunner.survey.adjust import Adjusted, Kinds, adjust
from tablerunner.survey.problem import (
    ALONG,
    GROUPS,
    GYRO,
    RANGES,
    TURN,
    Layout,
    Prior,
    Problem,
)
from tablerunner.survey.record import RANGE_STD_M, RangeTable, SurveyConfig, SurveyData
from tablerunner.survey.stretch import seen_from_knots
from tablerunner.survey.survey import LEAST_RANGES, survey
from tablerunner.survey.track import Indices, Track, choose_knots, laid_on, rotated
from tablerunner.survey.wheel_motion import Sizes, WheelAngles, WheelMotions, integrated
from tablerunner.types import Anchor

Array = NDArray[np.float64]

LEAST_TURN_RAD = 2.0 * np.pi
"""With less turning the track shows too little."""

WORST_SHARE = 0.03
"""Radii and track that are less certain than this have not been found."""

KINDS = Kinds(
    GROUPS,
    found=frozenset({RANGES, ALONG, TURN, GYRO}),
    robust=frozenset({RANGES}),
    doubtful=frozenset({ALONG, TURN}),
)
"""With a gyroscope, beside which wheels that slip stand out."""

KINDS_OF_WHEELS = Kinds(GROUPS, found=frozenset({RANGES, ALONG, TURN}), robust=frozenset({RANGES}))
"""Without one: slips are part of the noise."""

_ROUNDS = 6
_SMALL_SHARE = 1e-5
_WORST_MISFIT_M = 0.5


@dataclass(frozen=True)
class WheelData:
    """What was recorded on a drive.

    Attributes
    ----------
    wheels : WheelAngles
    track : Track
        Of base_link by dead reckoning with the nominal sizes: a first guess of the way.
    ranges : RangeTable
    anchors : tuple of Anchor
        Where they are.
    tag_position : tuple
        Tag in base_link [m].
    nominal : Sizes
    """

    wheels: WheelAngles
    track: Track
    ranges: RangeTable
    anchors: tuple[Anchor, ...]
    tag_position: tuple[float, float, float]
    nominal: Sizes


@dataclass(frozen=True)
class WheelConfig:
    """What is known before.

    Attributes
    ----------
    bias_std_m, scale_std : float
        As of `SurveyConfig`.
    noise : MotionNoise
        Of the wheels, and per time of the gyroscope; how large it is is found, too.
    """

    bias_std_m: float = 0.1
    scale_std: float = 0.005
    noise: MotionNoise = field(default_factory=MotionNoise)


@dataclass(frozen=True)
class WheelFit:
    """What came out.

    Attributes
    ----------
    sizes : Sizes
    covariance : ndarray, shape (3, 3)
        Of left radius, right radius, track [m^2].
    nominal : Sizes
    gyro_scale, gyro_drift : tuple of 2 floats, or None
        Share by which the gyroscope tells turns too large, and its drift in the beginning
        [rad/s], each with its standard deviation; None without one.
    range_std_m : float
        Noise of a range that is not blocked.
    ranges : int
    path, before, after : ndarray, shape (k, 3), (n, 3), (n, 3)
        base_link in map: as found at the knots; by the wheels alone with the nominal sizes, and
        with those that were found.
    """

    sizes: Sizes
    covariance: Array
    nominal: Sizes
    gyro_scale: tuple[float, float] | None
    gyro_drift: tuple[float, float] | None
    range_std_m: float
    ranges: int
    path: Array
    before: Array
    after: Array

    @property
    def std(self) -> Array:
        """Standard deviations of left radius, right radius, track, shape (3,) [m]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def radius(self) -> tuple[float, float]:
        """Mean radius with its standard deviation [m]."""
        slope = np.array([0.5, 0.5, 0.0])
        std = float(np.sqrt(slope @ self.covariance @ slope))
        return float(slope @ self.sizes.values), std

    @property
    def difference(self) -> tuple[float, float]:
        """Right less left radius over the mean radius, with its standard deviation."""
        left, right = self.sizes.left_radius_m, self.sizes.right_radius_m
        slope = np.array([-4.0 * right, 4.0 * left, 0.0]) / (left + right) ** 2
        std = float(np.sqrt(slope @ self.covariance @ slope))
        return 2.0 * (right - left) / (left + right), std


def fit_wheels(data: WheelData, config: WheelConfig) -> WheelFit:
    """Return radii and track, with covariance.

    Parameters
    ----------
    data : WheelData
    config : WheelConfig

    Raises
    ------
    ConfigError
        As of `survey`; ranges of anchors that are not known; a drive with too few turns; anchors
        that are not where they are said to be.
    """
    known = {anchor.anchor_id: anchor for anchor in data.anchors}
    for name, count in zip(data.ranges.ids, data.ranges.counts(), strict=True):
        if count and name not in known:
            raise ConfigError('anchor', name, f'one of {", ".join(known) or "no anchors"}')
    turned = float(data.track.turned[-1])
    if turned < LEAST_TURN_RAD:
        raise ConfigError(
            'drive',
            f'{np.degrees(turned):.0f} degrees of turning',
            f'{np.degrees(LEAST_TURN_RAD):.0f} or more, to both sides: the track shows in turns',
        )
    path = _first_path(data, config, known)
    knots = choose_knots(data.track)
    rows = np.searchsorted(data.wheels.stamps, data.track.stamps[knots])
    rows = np.unique(np.minimum(rows, len(data.wheels.stamps) - 1))
    path = np.column_stack(
        [
            np.interp(data.wheels.stamps[rows], data.track.stamps[knots], path[:, i])
            for i in range(3)
        ]
    )
    return _Fit(data, config, known, rows).run(path)


def _first_path(data: WheelData, config: WheelConfig, known: dict[str, Anchor]) -> Array:
    """Return the knots in map: a survey in a frame of its own, laid on the known anchors."""
    heights = {
        name: known[name].position[2]
        for name, count in zip(data.ranges.ids, data.ranges.counts(), strict=True)
        if count
    }
    table = data.ranges
    found = survey(
        SurveyData(data.track, table, data.tag_position),
        SurveyConfig(
            heights={k: v for k, v in heights.items() if _often(data, k)},
            bias_std_m=config.bias_std_m,
            scale_std=config.scale_std,
            noise=config.noise,
        ),
    )
    there = np.array([known[item.anchor_id].position[:2] for item in found.anchors])
    here = found.positions[:, :2]
    laid, (before, after, angle) = laid_on(here, there)
    off = np.linalg.norm(laid - there, axis=1)
    if off.max() > _WORST_MISFIT_M + 4.0 * max(float(i.std[:2].max()) for i in found.anchors):
        worst = found.anchors[int(np.argmax(off))].anchor_id
        raise ConfigError(
            f'anchor {worst}', f'{off.max():.2f} m off', 'places that the ranges agree with'
        )
    moved = rotated(found.path[:, :2] - before, np.full(len(found.path), angle)) + after
    return np.column_stack([moved, found.path[:, 2] + angle])


def _often(data: WheelData, name: str) -> bool:
    table = data.ranges.within(data.track)
    return bool(table.counts()[table.ids.index(name)] >= LEAST_RANGES)


class _Fit:
    """The sizes, found about better and better guesses of them."""

    def __init__(
        self, data: WheelData, config: WheelConfig, known: dict[str, Anchor], rows: Indices
    ) -> None:
        self._data, self._config, self._rows = data, config, rows
        self._places = np.zeros((len(data.ranges.ids), 5))
        for index, name in enumerate(data.ranges.ids):
            if name in known:
                self._places[index, :3] = known[name].position

    def run(self, path: Array) -> WheelFit:
        """Return what came out, from a guess of the knots in map."""
        data, sizes = self._data, self._data.nominal
        places, gyro = self._places, np.zeros(0)
        factors: Array | None = None
        kinds = KINDS_OF_WHEELS if data.wheels.gyro is None else KINDS
        for _ in range(_ROUNDS):
            track = integrated(data.wheels, sizes)
            table = data.ranges.within(track)
            motions = WheelMotions.of(data.wheels, sizes, self._rows, self._config.noise)
            layout = Layout(len(self._rows), len(places), motions.count)
            ranges = seen_from_knots(track, self._rows, table, data.tag_position)
            problem = Problem(layout, ranges, motions, None, self._priors(layout))
            wrongs = np.zeros(motions.count)
            wrongs[3 : 3 + len(gyro)] = gyro
            start = np.concatenate([path.ravel(), places.ravel(), wrongs])
            try:
                done = adjust(problem.rows, start, self._free(layout), kinds, factors)
            except GeometryError as error:
                raise ConfigError('drive', str(error), 'a longer drive, round corners') from error
            path, places = layout.poses(done.values), layout.places(done.values)
            shares, gyro = layout.wrongs(done.values)[:3], layout.wrongs(done.values)[3:]
            sizes, factors = sizes.scaled(shares), done.factors
            if float(np.abs(shares).max()) < _SMALL_SHARE:
                break
        return self._result(done, layout, sizes, path, len(table.stamps))

    def _priors(self, layout: Layout) -> list[Prior]:
        config = self._config
        priors: list[Prior] = []
        for index in range(layout.anchors):
            at = int(layout.anchor(index))
            if config.bias_std_m > 0.0:
                priors.append((at + 3, 0.0, config.bias_std_m))
            if config.scale_std > 0.0:
                priors.append((at + 4, 0.0, config.scale_std))
        return priors

    def _free(self, layout: Layout) -> NDArray[np.bool_]:
        free = np.ones(layout.size, dtype=bool)
        for index in range(layout.anchors):
            at = int(layout.anchor(index))
            free[at : at + 3] = False
            free[at + 3] = self._config.bias_std_m > 0.0
            free[at + 4] = self._config.scale_std > 0.0
        return free

    def _result(
        self, done: Adjusted, layout: Layout, sizes: Sizes, path: Array, ranges: int
    ) -> WheelFit:
        first, data = layout.first_motion, self._data
        block = done.covariance[first : first + 3, first : first + 3]
        names = ('left radius', 'right radius', 'track')
        for name, std in zip(names, np.sqrt(np.diag(block)), strict=True):
            if std > WORST_SHARE:
                raise ConfigError(
                    name,
                    f'standard deviation {100.0 * std:.1f} %',
                    f'at most {100.0 * WORST_SHARE:g} %: a longer drive with more turns',
                )
        gyro: list[tuple[float, float]] = [
            (float(done.values[i]), float(np.sqrt(done.covariance[i, i])))
            for i in range(first + 3, layout.size)
        ][:2]
        return WheelFit(
            sizes,
            block * np.outer(sizes.values, sizes.values),
            data.nominal,
            gyro[0] if gyro else None,
            gyro[1] if gyro else None,
            float(done.factors[RANGES] * RANGE_STD_M),
            ranges,
            path,
            _laid(integrated(data.wheels, data.nominal), path[0]),
            _laid(integrated(data.wheels, sizes), path[0]),
        )


def _laid(track: Track, start: Array) -> Array:
    """Return a track's poses from a start in map on."""
    angle = np.full(len(track.poses), start[2])
    return np.column_stack(
        [rotated(track.poses[:, :2], angle) + start[:2], track.poses[:, 2] + start[2]]
    )
