"""The picture of a trip: where the robot was, where it believed to be, and how far apart."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from tablerunner.errors import ConfigError
from tablerunner.evaluation.errors import ErrorSeries
from tablerunner.evaluation.plots import style
from tablerunner.evaluation.plots.room import draw_anchors, draw_room, extent
from tablerunner.evaluation.trip import Trip
from tablerunner.evaluation.truth import Stamps
from tablerunner.scenario import Scenario
from tablerunner.types import Anchor, LosState, Matrix, Vector, seconds

ELLIPSE_SIGMAS = 2.0
BAND_SIGMAS = 3.0

_ELLIPSE_EVERY = 0.055  # of the picture's width
_ARROW = 0.04  # the same
_MOST_RAYS = 160
_GAP_S = 0.6
_WIDTH_IN, _LEFT_IN, _RIGHT_IN = 9.0, 0.7, 0.25
_HEAD_IN, _BETWEEN_IN, _ERRORS_IN, _FOOT_IN = 1.32, 0.85, 1.7, 0.5


def draw_trip(trip: Trip, scenario: Scenario | None, file: Path, dpi: int = 150) -> None:
    """Draw a trip into a PNG file.

    Above the room with truth, estimate and its 2-sigma ellipses, UWB-only fixes, rays of ranges
    without line of sight, and where the robot was stopped; below the position error with 3-sigma,
    and when each anchor was without line of sight.

    Parameters
    ----------
    trip : Trip
        What to draw; every part of it may be empty.
    scenario : Scenario or None
        The room; None to draw without one.
    file : Path
        Its folder is made if need be.
    dpi : int
        Pixels per inch; the picture is 9 inches wide.

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    import matplotlib as mpl

    mpl.use('Agg')
    from matplotlib import pyplot as plt

    with mpl.rc_context(style.RC):
        anchors = trip.anchors or _anchors_of(scenario)
        low, high = extent(scenario, _points(trip, anchors))
        figure, (room, errors, sight) = _layout(plt, (high[1] - low[1]) / (high[0] - low[0]), trip)
        room.set_xlim(low[0], high[0])
        room.set_ylim(low[1], high[1])
        if scenario is not None:
            draw_room(room, scenario)
        draw_plan(room, trip)
        draw_anchors(room, anchors)
        series = trip.errors()
        _head(figure, trip, series)
        _draw_errors(errors, trip, series)
        _draw_sight(sight, trip)
        errors.set_xlim(0.0, max(seconds(trip.end - trip.start), 1.0))
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(file, dpi=dpi, metadata={'Software': 'Tablerunner'})
        except OSError as error:
            raise ConfigError('', str(file), f'a file to write ({error.strerror})') from error
        finally:
            plt.close(figure)


def _layout(plt: Any, shape: float, trip: Trip) -> tuple[Any, tuple[Any, Any, Any]]:
    """Make a figure whose room is as wide as all else; `shape` is its height over its width."""
    wide = _WIDTH_IN - _LEFT_IN - _RIGHT_IN
    room_high = wide * min(max(shape, 0.3), 1.6)
    sight_high = 0.15 * max(len(trip.anchors), 1) + 0.05
    high = _HEAD_IN + room_high + _BETWEEN_IN + _ERRORS_IN + 0.1 + sight_high + _FOOT_IN
    figure = plt.figure(figsize=(_WIDTH_IN, high))

    def axes(bottom: float, size: float) -> Any:
        made = figure.add_axes(
            (_LEFT_IN / _WIDTH_IN, bottom / high, wide / _WIDTH_IN, size / high)
        )
        made.tick_params(length=0)
        return made

    sight = axes(_FOOT_IN, sight_high)
    errors = axes(_FOOT_IN + sight_high + 0.1, _ERRORS_IN)
    room = axes(high - _HEAD_IN - room_high, room_high)
    room.set_xlabel('x [m]')
    room.set_ylabel('y [m]')
    room.set_aspect('equal')
    errors.sharex(sight)
    errors.tick_params(labelbottom=False)
    errors.set_ylabel('position error [m]')
    errors.grid(axis='y', color=style.GRID, lw=0.8)
    sight.set_xlabel('time [s]')
    return figure, (room, errors, sight)


def _head(figure: Any, trip: Trip, series: ErrorSeries) -> None:
    left, high = _LEFT_IN / _WIDTH_IN, figure.get_size_inches()[1]
    figure.text(left, 1.0 - 0.32 / high, trip.title, fontsize=15, fontweight='bold', va='center')
    summary = series.summary()
    words = [f'{seconds(trip.end - trip.start):.0f} s']
    if trip.estimator:
        words.append(f'estimator {trip.estimator}')
    if summary.count:
        words.append(
            f'position error: RMSE {summary.rmse:.3f} m, mean {summary.mean:.3f} m, '
            f'max {summary.max:.3f} m, final {summary.final:.3f} m'
        )
    words_at = 1.0 - 0.62 / high
    figure.text(left, words_at, '  ·  '.join(words), color=style.SUBDUED, va='center')


def draw_plan(axes: Any, trip: Trip) -> None:
    """Draw what happened into axes whose limits are set: rays, fixes, truth, estimate, halts."""
    _draw_rays(axes, trip)
    if len(trip.fixes):
        axes.plot(
            *trip.fixes.T,
            ls='',
            marker='o',
            ms=2.4,
            mfc=style.FIX,
            mec='none',
            alpha=0.55,
            zorder=3.5,
            label='UWB-only fix',
        )
    if len(trip.truth):
        axes.plot(
            *trip.truth.positions.T,
            color=style.TRUTH,
            lw=3.2,
            alpha=0.28,
            zorder=4,
            solid_capstyle='round',
            label='truth',
        )
    if len(trip.stamps):
        path = _with_gaps(trip.stamps, trip.poses[:, :2])
        axes.plot(*path.T, color=style.ESTIMATE, lw=1.3, zorder=5, label='estimate')
        _draw_ellipses(axes, trip)
        _draw_ends(axes, trip)
    _draw_halts(axes, trip)
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            handles,
            labels,
            loc='lower left',
            bbox_to_anchor=(0.0, 1.0),
            ncols=4,
            handlelength=1.7,
            columnspacing=1.5,
            borderpad=0.0,
            borderaxespad=0.6,
        )


def _draw_halts(axes: Any, trip: Trip) -> None:
    """Draw where the robot was stopped: larger where longer, filled where it was for a person."""
    for label, halts, face in (
        ('stopped for a person', [halt for halt in trip.halts if halt.person], style.HALT),
        (
            'stopped for a thing',
            [halt for halt in trip.halts if not (halt.person or halt.emergency)],
            'white',
        ),
        ('emergency stop', [halt for halt in trip.halts if halt.emergency], style.EMERGENCY),
    ):
        if halts:
            axes.scatter(
                [halt.x for halt in halts],
                [halt.y for halt in halts],
                s=[70.0 + 14.0 * min(halt.duration_s, 15.0) for halt in halts],
                marker='8',
                facecolor=face,
                edgecolor=style.HALT,
                lw=1.6,
                zorder=6,
                label=label,
            )
    for halt in trip.halts:
        if halt.person:
            line = np.array([(halt.x, halt.y), halt.person])
            axes.plot(*line.T, color=style.HALT, lw=1.0, ls=(0, (2, 1.5)), zorder=5.8)
            axes.plot(*halt.person, marker='o', ms=5, color=style.HALT, zorder=5.9)


def _draw_rays(axes: Any, trip: Trip) -> None:
    """Draw from the robot to the anchor where the line of sight was judged to be blocked."""
    from matplotlib.collections import LineCollection

    nlos = trip.nlos()
    nlos = nlos[:: max(1, math.ceil(len(nlos) / _MOST_RAYS))]
    where = {anchor.anchor_id: anchor.position[:2] for anchor in trip.anchors}
    places = trip.places(item.stamp for item in nlos)
    rays = [
        (place, where[item.anchor_id])
        for item, place in zip(nlos, places, strict=True)
        if item.anchor_id in where and np.isfinite(place).all()
    ]
    if rays:
        axes.add_collection(
            LineCollection(rays, colors=style.NLOS, linewidths=0.7, alpha=0.16, zorder=2)
        )
        axes.plot([], [], color=style.NLOS, lw=1.2, alpha=0.6, label='no line of sight')


def _draw_ellipses(axes: Any, trip: Trip) -> None:
    from matplotlib.collections import EllipseCollection

    rows = _spread(trip.poses[:, :2], _ELLIPSE_EVERY * _width(axes))
    values, vectors = np.linalg.eigh(trip.covariances[rows, :2, :2])
    axes_m = 2.0 * ELLIPSE_SIGMAS * np.sqrt(np.clip(values, 0.0, None))
    turn = np.degrees(np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]))
    axes.add_collection(
        EllipseCollection(
            axes_m[:, 1],
            axes_m[:, 0],
            turn,
            units='xy',
            offsets=trip.poses[rows, :2],
            offset_transform=axes.transData,
            facecolors=style.ESTIMATE,
            edgecolors=style.ESTIMATE,
            linewidths=0.7,
            alpha=0.18,
            zorder=4.5,
        )
    )
    axes.plot(
        [],
        [],
        ls='',
        marker='o',
        ms=8,
        mfc=style.ESTIMATE,
        mec=style.ESTIMATE,
        alpha=0.3,
        label=f'{ELLIPSE_SIGMAS:.0f}-sigma ellipse',
    )


def _draw_ends(axes: Any, trip: Trip) -> None:
    length = _ARROW * _width(axes)
    for row, face in ((0, 'white'), (-1, style.ESTIMATE)):
        x, y, heading = trip.poses[row]
        axes.plot(
            x,
            y,
            marker='o',
            ms=8,
            mfc=face,
            mec=style.ESTIMATE,
            mew=1.6,
            zorder=6.5,
        )
        axes.annotate(
            '',
            (x + length * math.cos(heading), y + length * math.sin(heading)),
            (x, y),
            arrowprops={'arrowstyle': '-|>', 'color': style.ESTIMATE, 'lw': 1.4, 'shrinkA': 4},
            zorder=6.4,
        )


def _draw_errors(axes: Any, trip: Trip, series: ErrorSeries) -> None:
    if not len(series.stamps):
        axes.text(
            0.5,
            0.5,
            'no truth to compare with',
            ha='center',
            color=style.SUBDUED,
            transform=axes.transAxes,
        )
        return
    times = _since(trip, series.stamps)
    largest = np.linalg.eigvalsh(series.covariances[:, :2, :2])[:, 1]
    bound = BAND_SIGMAS * np.sqrt(np.clip(largest, 0.0, None))
    for halt in trip.halts:
        begin = seconds(halt.stamp - trip.start)
        axes.axvspan(begin, begin + halt.duration_s, color=style.HALT, alpha=0.22, lw=0)
    table = _with_gaps(series.stamps, np.column_stack([times, series.distances, bound]))
    axes.fill_between(
        table[:, 0],
        table[:, 2],
        color=style.ESTIMATE,
        alpha=0.13,
        lw=0,
        label=f'{BAND_SIGMAS:.0f} sigma of the estimate',
    )
    axes.plot(table[:, 0], table[:, 1], color=style.ESTIMATE, lw=1.0, label='error')
    top = max(float(np.nanquantile(bound, 0.98)), float(series.distances.max()))
    axes.set_ylim(0.0, 1.15 * top if top > 0.0 else 1.0)
    axes.legend(loc='upper right', ncols=2, bbox_to_anchor=(1.0, 1.16))


def _draw_sight(axes: Any, trip: Trip) -> None:
    """Draw one line of ticks for each anchor: when it was without line of sight."""
    names = [anchor.anchor_id for anchor in trip.anchors]
    times: list[Vector] = [
        np.array(
            [seconds(item.stamp - trip.start) for item in trip.nlos() if item.anchor_id == name]
        )
        for name in names
    ]
    if names:
        axes.eventplot(times, colors=style.NLOS, linewidths=0.8, linelengths=0.75)
    if all(item.los is LosState.UNKNOWN for item in trip.ranges):
        axes.text(
            0.5,
            0.5,
            'line of sight was not judged',
            ha='center',
            va='center',
            color=style.SUBDUED,
            transform=axes.transAxes,
        )
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.spines['left'].set_visible(False)
    axes.set_ylabel('no sight', labelpad=6)


def _anchors_of(scenario: Scenario | None) -> tuple[Anchor, ...]:
    return () if scenario is None else tuple(place.anchor for place in scenario.anchors)


def _points(trip: Trip, anchors: tuple[Anchor, ...]) -> Matrix:
    places = np.array([anchor.position[:2] for anchor in anchors]).reshape(-1, 2)
    return np.concatenate([trip.poses[:, :2], trip.truth.positions, places])


def _width(axes: Any) -> float:
    low, high = axes.get_xlim()
    return float(high - low)


def _since(trip: Trip, stamps: Stamps) -> Vector:
    return (stamps - trip.start).astype(float) * 1e-9


def _with_gaps(stamps: Stamps, rows: Matrix) -> Matrix:
    """Return rows with a line of NaN wherever time jumps, so that no line is drawn across."""
    breaks = np.flatnonzero(np.diff(stamps) > _GAP_S * 1e9) + 1
    return np.insert(np.asarray(rows, dtype=float), breaks, np.nan, axis=0)


def _spread(points: Matrix, distance: float) -> list[int]:
    """Return rows that are at least so far apart along the way."""
    rows = [0]
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    for row in range(1, len(points)):
        if way[row] - way[rows[-1]] >= distance:
            rows.append(row)
    return rows
