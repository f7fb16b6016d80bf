"""Anchor places from a drive: ranges to the tag, odometry, and ranges between anchors.

First a short stretch from the start, on which dead reckoning is good, then longer ones, each
solved as a whole; an anchor joins as soon as its ranges leave one place only. docs/survey.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError, GeometryError
from tablerunner.survey.adjust import Adjusted, Kinds, adjust
from tablerunner.survey.odometry import OdometryMotions
from tablerunner.survey.problem import (
    ALONG,
    GROUPS,
    LINKS,
    RANGES,
    TURN,
    Layout,
    Links,
    Prior,
    Problem,
    TagRanges,
)
from tablerunner.survey.record import (
    RANGE_STD_M,
    Survey,
    SurveyConfig,
    SurveyData,
    SurveyedAnchor,
)
from tablerunner.survey.start import ALIKE, APART_M, Places, locate_anchor
from tablerunner.survey.stretch import Stretch, seen_from_knots, width
from tablerunner.survey.track import (
    Pieces,
    choose_knots,
    composed,
    laid_on,
    relative,
    rotated,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_RANGES = 20
"""An anchor with fewer ranges is left out."""

LEAST_ANCHORS = 3
LEAST_WAY_M = 3.0
LEAST_WIDTH_M = 0.3
WORST_STD_M = 0.5
"""An anchor that is less certain than this has not been found."""

BLOCKED_WEIGHT = 0.2
"""A range with less weight than this counts as blocked."""

KINDS = Kinds(
    GROUPS,
    found=frozenset({RANGES, ALONG, TURN}),
    robust=frozenset({RANGES}),
    doubtful=frozenset({LINKS}),
)

_FIRST_WAY_M, _GROWTH = 4.0, 1.6
_GAUGE_SLACK_M = 0.2


def survey(data: SurveyData, config: SurveyConfig) -> Survey:
    """Return where the anchors hang, with covariance.

    Parameters
    ----------
    data : SurveyData
    config : SurveyConfig

    Raises
    ------
    ConfigError
        A gauge anchor is not known; fewer than three anchors; a drive that is too short, or too
        straight to tell the sides apart; given places that the ranges contradict.
    """
    work = _Work(data, config)
    work.check()
    work.grow()
    work.finish()
    return work.result()


class _Work:
    """A survey under way."""

    def __init__(self, data: SurveyData, config: SurveyConfig) -> None:
        self._data, self._config = data, config
        self._table = data.ranges.within(data.track)
        self._ids = data.ranges.ids
        count = len(self._ids)
        self._anchors = np.zeros((count, 5))
        tag = data.tag_position[2]
        self._heights = np.array(
            [config.heights.get(name, tag + config.usual_height_m) for name in self._ids]
        )
        for name, place in config.fixed.items():
            if name in self._ids and len(place) == 3:
                self._heights[self._ids.index(name)] = place[2]
        self._anchors[:, 2] = self._heights
        self._height_known = np.array(
            [name in config.heights or len(config.fixed.get(name, ())) == 3 for name in self._ids],
            dtype=bool,
        )
        self._placed: Flags = np.zeros(count, dtype=bool)
        self._doubt: dict[int, Places] = {}
        self._stage: Stretch | None = None
        self._poses: Array = np.array([config.start])
        self._wrongs: Array = np.zeros(0)
        self._layout = Layout(0, 0, 0)
        self._adjusted: Adjusted | None = None

    # -- before ---------------------------------------------------------------------------------

    def check(self) -> None:
        """Refuse what cannot lead to a survey."""
        config, counts = self._config, self._table.counts()
        heard = [name for name, n in zip(self._ids, counts, strict=True) if n >= LEAST_RANGES]
        for name in (*config.fixed, *config.heights):
            if name not in heard:
                what = '--at' if name in config.fixed else '--height'
                raise ConfigError(
                    what, name, f'one of {", ".join(heard) or "no anchors"}, which were heard'
                )
        if len(config.fixed) == 1:
            raise ConfigError('--at', next(iter(config.fixed)), 'two anchors, or none')
        if len(heard) < LEAST_ANCHORS:
            raise ConfigError(
                'anchors',
                ', '.join(f'{n}: {c} ranges' for n, c in zip(self._ids, counts, strict=True)),
                f'{LEAST_ANCHORS} anchors or more with {LEAST_RANGES} ranges each on the drive',
            )
        way = float(self._data.track.way[-1])
        if way < LEAST_WAY_M:
            raise ConfigError('drive', f'{way:.1f} m', f'{LEAST_WAY_M:g} m or more, best 20 to 40')
        across = width(self._data.track)
        if across < LEAST_WIDTH_M:
            raise ConfigError(
                'drive',
                f'{way:.1f} m straight, {across:.2f} m wide',
                'a drive round corners (best a loop): from a straight one the two sides of the '
                'way look alike',
            )

    # -- growing --------------------------------------------------------------------------------

    def grow(self) -> None:
        """Solve longer and longer stretches from the start."""
        way = self._data.track.way
        limit = _FIRST_WAY_M
        while True:
            end = int(np.searchsorted(way, limit, side='right'))
            self._enter(end)
            self._place()
            if self._placed.sum() >= 2:
                self._solve(find=False)
            if end == len(way):
                break
            limit *= _GROWTH
        self._place()
        heard = self._table.counts() >= LEAST_RANGES
        for index in np.flatnonzero(heard & ~self._placed):
            doubt = self._doubt[int(index)]
            one, two = doubt.place, doubt.other
            assert two is not None  # noqa: S101 - else it would have been placed
            raise ConfigError(
                f'anchor {self._ids[index]}',
                f'({one[0]:.1f}, {one[1]:.1f}) as well as ({two[0]:.1f}, {two[1]:.1f})',
                'a drive that tells them apart: round corners, where it is heard, best a loop',
            )

    def _enter(self, end: int) -> None:
        """Take the first `end` poses of the track, keeping what is known of the earlier ones."""
        track = self._data.track.cut(end)
        knots = choose_knots(track)
        table = self._table.within(track)
        ranges = seen_from_knots(track, knots, table, self._data.tag_position)
        new = Stretch(Pieces.of(track, knots), knots, ranges)
        if self._stage is None:
            origin = np.broadcast_to(track.poses[:1], (len(knots), 3))
            seen = relative(track.poses[knots], origin)
            self._poses = composed(np.broadcast_to(self._poses[:1], seen.shape), seen)
        else:
            nearest = self._stage.pieces.nearest(new.pieces.stamps)
            seen = relative(track.poses[knots], track.poses[self._stage.rows[nearest]])
            self._poses = composed(self._poses[nearest], seen)
        self._stage = new

    def _place(self) -> None:
        """Place anchors that are not placed yet, or are placed where their ranges do not fit."""
        stage = self._known_stage()
        knots = self._poses[stage.ranges.knot]
        tags = knots[:, :2] + rotated(stage.ranges.lever[:, :2], knots[:, 2])
        for index in range(len(self._ids)):
            own = stage.ranges.anchor == index
            if own.sum() < LEAST_RANGES:
                continue
            height = self._anchors[index, 2] - self._data.tag_position[2]
            found = locate_anchor(
                tags[own], height, stage.ranges.range_m[own] - self._anchors[index, 3]
            )
            self._doubt[index] = found
            if self._placed[index]:
                held = self._anchors[index]
                moved = float(np.linalg.norm(found.place - held[:2]))
                distance = np.hypot(np.linalg.norm(tags[own] - held[:2], axis=1), height)
                error = (1.0 + held[4]) * distance + held[3] - stage.ranges.range_m[own]
                cost = float(np.mean(np.log1p((error / RANGE_STD_M / 3.0) ** 2)))
                if moved < APART_M or found.other is not None or found.cost > cost - ALIKE:
                    continue
            if found.other is None:
                self._anchors[index, :2] = found.place
                self._anchors[index, 3:] = 0.0
                self._placed[index] = True

    def _solve(self, find: bool, gauge: bool = False) -> None:
        stage = self._known_stage()
        used = self._placed[stage.ranges.anchor]
        ranges = TagRanges(
            stage.ranges.knot[used],
            stage.ranges.anchor[used],
            stage.ranges.lever[used],
            stage.ranges.range_m[used],
            stage.ranges.std_m[used],
        )
        motions = OdometryMotions(stage.pieces, self._config.noise)
        layout = self._layout = Layout(stage.pieces.count, len(self._ids), motions.count)
        problem = Problem(
            layout,
            ranges,
            motions,
            self._links(),
            self._priors(layout),
        )
        wrongs = np.zeros(motions.count)
        wrongs[: len(self._wrongs)] = self._wrongs
        start = np.concatenate([self._poses.ravel(), self._anchors.ravel(), wrongs])
        try:
            done = adjust(problem.rows, start, self._free(layout, gauge), KINDS, find_factors=find)
        except GeometryError as error:
            raise ConfigError('drive', str(error), 'a longer drive, round corners') from error
        self._poses = layout.poses(done.values)
        self._anchors = layout.places(done.values).copy()
        self._wrongs = layout.wrongs(done.values)
        self._adjusted = done

    def _free(self, layout: Layout, gauge: bool) -> Flags:
        free = np.ones(layout.size, dtype=bool)
        if not gauge:
            free[:3] = False
        config = self._config
        for index, name in enumerate(self._ids):
            at = int(layout.anchor(index))
            if not self._placed[index]:
                free[at : at + 5] = False
                continue
            if self._height_known[index]:
                free[at + 2] = False
            if config.bias_std_m == 0.0:
                free[at + 3] = False
            if config.scale_std == 0.0:
                free[at + 4] = False
            if gauge and name in config.fixed:
                free[at : at + 2] = False
        return free

    def _priors(self, layout: Layout) -> Sequence[Prior]:
        config = self._config
        priors: list[Prior] = []
        for index in np.flatnonzero(self._placed):
            at = int(layout.anchor(index))
            if not self._height_known[index]:
                priors.append((at + 2, float(self._heights[index]), config.height_std_m))
            if config.bias_std_m > 0.0:
                priors.append((at + 3, 0.0, config.bias_std_m))
            if config.scale_std > 0.0:
                priors.append((at + 4, 0.0, config.scale_std))
        return priors

    def _links(self) -> Links:
        """Return the ranges between placed anchors, one of each pair: its median."""
        first, second, middle, std = [], [], [], []
        for (one, two), values in self._data.links.items():
            pair = [self._ids.index(name) for name in (one, two) if name in self._ids]
            if len(pair) < 2 or not self._placed[pair].all() or not len(values):
                continue
            first.append(pair[0])
            second.append(pair[1])
            middle.append(float(np.median(values)))
            noise = 1.57 * RANGE_STD_M**2 / len(values)  # of a median
            wrong = self._config.bias_std_m**2 + (self._config.scale_std * middle[-1]) ** 2
            std.append(float(np.sqrt(noise + wrong)))
        return Links(
            np.array(first, dtype=np.intp),
            np.array(second, dtype=np.intp),
            np.array(middle),
            np.array(std),
        )

    def _known_stage(self) -> Stretch:
        if self._stage is None:
            raise RuntimeError('no stretch was entered')
        return self._stage

    # -- the end --------------------------------------------------------------------------------

    def finish(self) -> None:
        """Solve the whole drive with its noise, in the frame that was asked for."""
        self._solve(find=not self._config.fixed)
        if self._config.fixed:
            self._move_to_given()
            self._solve(find=True, gauge=True)

    def _move_to_given(self) -> None:
        """Move everything so that the given anchors come to where they are given."""
        names = list(self._config.fixed)
        index = [self._ids.index(name) for name in names]
        given = np.array([self._config.fixed[name][:2] for name in names])
        found = self._anchors[index, :2]
        for one in range(1, len(names)):
            told = float(np.linalg.norm(given[one] - given[0]))
            seen = float(np.linalg.norm(found[one] - found[0]))
            slack = _GAUGE_SLACK_M + 4.0 * self._distance_std(index[0], index[one])
            if abs(told - seen) > slack:
                raise ConfigError(
                    '--at',
                    f'{names[0]} and {names[one]} {told:.2f} m apart',
                    f'places about {seen:.2f} m apart, as the ranges say (within {slack:.2f} m)',
                )
        _, (before, after, angle) = laid_on(found, given)
        for place in (self._anchors, self._poses):
            place[:, :2] = rotated(place[:, :2] - before, np.full(len(place), angle)) + after
        self._poses[:, 2] += angle
        self._anchors[index, :2] = given

    def _distance_std(self, one: int, two: int) -> float:
        done, layout = self._done()
        apart = self._anchors[two, :2] - self._anchors[one, :2]
        unit = apart / max(float(np.linalg.norm(apart)), 1e-9)
        slope = np.zeros(layout.size)
        for index, sign in ((one, -1.0), (two, 1.0)):
            at = int(layout.anchor(index))
            slope[at : at + 2] = sign * unit
        return float(np.sqrt(max(float(slope @ done.covariance @ slope), 0.0)))

    def _done(self) -> tuple[Adjusted, Layout]:
        if self._adjusted is None:
            raise RuntimeError('nothing was solved')
        return self._adjusted, self._layout

    def result(self) -> Survey:
        """Return what came out; raise where an anchor is not certain enough."""
        done, layout = self._done()
        stage, counts = self._known_stage(), self._table.counts()
        used = np.flatnonzero(self._placed[stage.ranges.anchor])
        weights, noise = done.weights[: len(used)], done.factors[RANGES] * RANGE_STD_M
        residual = -done.residuals[: len(used)] * noise
        anchors = []
        for index in np.flatnonzero(self._placed):
            at, name = int(layout.anchor(index)), self._ids[index]
            own = stage.ranges.anchor[used] == index
            block = done.covariance[at : at + 5, at : at + 5]
            item = SurveyedAnchor(
                name,
                self._anchors[index, :3].copy(),
                block[:3, :3],
                float(self._anchors[index, 3]),
                float(np.sqrt(block[3, 3])),
                float(self._anchors[index, 4]),
                int(counts[index]),
                float(np.mean(weights[own] < BLOCKED_WEIGHT)),
            )
            if float(np.sqrt(block[:2, :2].diagonal().max())) > WORST_STD_M:
                raise ConfigError(
                    f'anchor {name}',
                    f'standard deviation {item.std[:2].max():.2f} m',
                    f'at most {WORST_STD_M} m: a longer drive, on several sides of it',
                )
            anchors.append(item)
        columns = np.concatenate(
            [layout.anchor(int(i)) + np.arange(3) for i in np.flatnonzero(self._placed)]
        )
        first = layout.first_motion
        way, turns, drift = (
            (float(done.values[first + i]), float(np.sqrt(done.covariance[first + i, first + i])))
            for i in range(3)
        )
        return Survey(
            tuple(anchors),
            done.covariance[np.ix_(columns, columns)],
            {
                name: int(count)
                for name, count, placed in zip(self._ids, counts, self._placed, strict=True)
                if not placed
            },
            self._poses,
            {
                self._ids[index]: residual[stage.ranges.anchor[used] == index]
                for index in np.flatnonzero(self._placed)
            },
            float(noise),
            way,
            turns,
            drift,
        )
