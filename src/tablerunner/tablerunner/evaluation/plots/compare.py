"""Pictures of a comparison: how large the errors are, and whether the estimators know it."""

from __future__ import annotations

from typing import Any

import numpy as np

from tablerunner.evaluation.comparison import Comparison, EstimatorRuns
from tablerunner.evaluation.plots import style
from tablerunner.evaluation.run_average import RunAverage
from tablerunner.types import Vector

COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#F0E442')
"""Okabe and Ito, in the order of the estimators."""

BAND_SIGMAS = 3.0
_MOST_LINES = 30
_MOST_POINTS = 1500


def draw_comparison(figure: Any, comparison: Comparison) -> None:
    """Draw box plots of the runs' errors, and the errors of all over time, with the bound."""
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 1.1))
    boxes = (
        (figure.add_subplot(grid[0, 0]), 'position, RMSE of a run [m]', 1.0),
        (figure.add_subplot(grid[0, 1]), 'heading, RMSE of a run [deg]', np.degrees(1.0)),
    )
    values = (
        [item.rmse_of_runs for item in comparison.estimators],
        [item.heading_rmse_of_runs for item in comparison.estimators],
    )
    bounds = (comparison.bound_rmse, comparison.bound_heading_rmse)
    for (axes, title, unit), runs, bound in zip(boxes, values, bounds, strict=True):
        _draw_boxes(axes, comparison, [unit * row for row in runs], unit * bound)
        axes.set_title(title, loc='left')
    _draw_over_time(figure.add_subplot(grid[1, :]), comparison)
    figure.suptitle(
        f'{comparison.title}: {len(comparison.seeds)} runs', x=0.01, ha='left', fontweight='bold'
    )


def draw_estimator(figure: Any, comparison: Comparison, item: EstimatorRuns) -> None:
    """Draw the errors of one estimator with 3 sigma, its NEES and NIS with their bounds."""
    axes = figure.subplots(5, 1, sharex=True)
    units = (('x [m]', 1.0), ('y [m]', 1.0), ('heading [deg]', float(np.degrees(1.0))))
    for index, (name, unit) in enumerate(units):
        _draw_errors(axes[index], comparison, item, index, unit)
        axes[index].set_ylabel(name)
    _draw_average(axes[3], comparison.times, item.average_nees)
    axes[3].set_ylabel('NEES / 3')
    _draw_average(axes[4], comparison.range_times, item.average_nis)
    axes[4].set_ylabel('NIS')
    axes[4].set_xlabel('time [s]')
    axes[0].legend(loc='upper right', ncols=3, bbox_to_anchor=(1.0, 1.35))
    figure.suptitle(
        f'{comparison.title}, {item.name}: {len(comparison.seeds)} runs',
        x=0.01,
        ha='left',
        fontweight='bold',
    )


def _draw_boxes(axes: Any, comparison: Comparison, runs: list[Vector], bound: float) -> None:
    names = [item.name.replace('_', '\n') for item in comparison.estimators]
    known = [row[np.isfinite(row)] for row in runs]
    drawn = axes.boxplot(known, widths=0.55, patch_artist=True, whis=(5.0, 95.0))
    axes.set_xticks(range(1, len(names) + 1), names)
    for index, box in enumerate(drawn['boxes']):
        box.set(facecolor=COLOURS[index % len(COLOURS)], alpha=0.45, edgecolor=style.TEXT)
    for line in drawn['medians']:
        line.set(color=style.TEXT, linewidth=1.4)
    for line in drawn['fliers']:
        line.set(marker='.', markersize=3, markeredgecolor=style.SUBDUED)
    axes.axhline(bound, color=style.TRUTH, lw=1.0, ls=(0, (4, 2)))
    axes.set_yscale('log')
    axes.grid(axis='y', color=style.GRID, lw=0.8, which='both')
    axes.tick_params(axis='x', length=0)


def _draw_over_time(axes: Any, comparison: Comparison) -> None:
    every = _every(comparison.times)
    times = comparison.times[::every]
    for index, item in enumerate(comparison.estimators):
        squares = item.distances[:, ::every] ** 2
        known = np.isfinite(squares).any(axis=0)
        root = np.full(len(times), np.nan)
        root[known] = np.sqrt(np.nanmean(squares[:, known], axis=0))
        axes.plot(times, root, color=COLOURS[index % len(COLOURS)], lw=1.2, label=item.name)
    bound = np.sqrt(comparison.bound_over_time[::every, :2].sum(axis=1))
    axes.plot(times, bound, color=style.TRUTH, lw=1.2, ls=(0, (4, 2)), label='bound')
    axes.set_yscale('log')
    axes.set_title('position, RMS over the runs [m]', loc='left')
    axes.set_xlabel('time [s]')
    axes.grid(axis='y', color=style.GRID, lw=0.8, which='both')
    axes.margins(x=0.0)
    axes.legend(loc='lower right', ncols=4, bbox_to_anchor=(1.0, 1.0))


def _draw_errors(
    axes: Any, comparison: Comparison, item: EstimatorRuns, index: int, unit: float
) -> None:
    every = _every(comparison.times)
    times = comparison.times[::every]
    errors = unit * item.errors[:, ::every, index]
    squares = item.deviations[:, ::every, index] ** 2
    known = np.isfinite(squares).any(axis=0)
    believed, bound = np.full(len(times), np.nan), comparison.bound_over_time[::every, index]
    believed[known] = np.sqrt(np.nanmean(squares[:, known], axis=0))
    for number, row in enumerate(errors[:_MOST_LINES]):
        label = 'errors of runs' if number == 0 else None
        axes.plot(times, row, color=style.ESTIMATE, lw=0.5, alpha=0.3, label=label)
    for sign in (1.0, -1.0):
        axes.plot(
            times,
            sign * BAND_SIGMAS * unit * believed,
            color=style.NLOS,
            lw=1.2,
            label='3 sigma, as believed' if sign > 0.0 else None,
        )
        axes.plot(
            times,
            sign * BAND_SIGMAS * unit * np.sqrt(bound),
            color=style.TRUTH,
            lw=1.0,
            ls=(0, (4, 2)),
            label='3 sigma of the bound' if sign > 0.0 else None,
        )
    limit = 1.6 * BAND_SIGMAS * unit * float(np.nanmax(believed, initial=1e-6))
    axes.set_ylim(-limit, limit)
    axes.grid(axis='y', color=style.GRID, lw=0.8)
    axes.margins(x=0.0)


def _draw_average(axes: Any, times: Vector, average: RunAverage) -> None:
    axes.fill_between(times, average.low, average.high, color=style.TRUTH, alpha=0.13, lw=0)
    axes.plot(times, average.means, color=style.ESTIMATE, lw=0.7)
    axes.axhline(1.0, color=style.TRUTH, lw=0.6)
    axes.set_ylim(0.0, max(2.0, min(6.0, 1.1 * float(np.nanmax(average.means, initial=0.0)))))
    axes.set_title(
        f'{100.0 * average.inside:.0f} % of the steps inside the bounds, mean {average.mean:.2f}',
        loc='right',
        fontsize=8.0,
        pad=2.0,
    )
    axes.margins(x=0.0)


def _every(times: Vector) -> int:
    return max(1, len(times) // _MOST_POINTS)
