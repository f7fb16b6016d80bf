"""The pictures of a survey and of a calibration of wheels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.evaluation.plots import style
from tablerunner.survey.record import Survey
from tablerunner.survey.wheels import WheelFit

Array = NDArray[np.float64]

ENLARGED = 10.0
"""Ellipses of the anchors are drawn this much larger: three standard deviations, enlarged."""


def draw_survey(
    figure: Any, found: Survey, known: Mapping[str, tuple[float, float, float]] | None = None
) -> None:
    """Draw the way, the anchors with their uncertainty, and what the ranges leave.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty.
    found : Survey
    known : mapping of str to tuple, optional
        Where the anchors were said to be, in the same frame.
    """
    from matplotlib.patches import Ellipse

    plan, left = figure.subplots(1, 2, width_ratios=(3, 2))
    plan.plot(*found.path[:, :2].T, color=style.ESTIMATE, lw=1.2)
    plan.plot(*found.path[0, :2], 'o', color=style.ESTIMATE, ms=5)
    middle = found.positions[:, :2].mean(axis=0)
    for item in found.anchors:
        x, y = item.position[:2]
        if known and item.anchor_id in known:
            plan.plot(*known[item.anchor_id][:2], 'x', color=style.TRUTH, ms=7, zorder=8)
        plan.plot(x, y, '^', color=style.ANCHOR, ms=8, zorder=7)
        values, vectors = np.linalg.eigh(item.covariance[:2, :2])
        width, height = 2.0 * 3.0 * ENLARGED * np.sqrt(np.maximum(values, 0.0))
        angle = float(np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0])))
        plan.add_patch(
            Ellipse((x, y), width, height, angle=angle, fc='none', ec=style.ANCHOR, lw=0.9)
        )
        away = 1 if x < middle[0] else -1
        plan.annotate(
            f'{item.anchor_id}\n{100.0 * float(np.hypot(*item.std[:2])):.1f} cm',
            (x, y),
            xytext=(10 * away, 0),
            textcoords='offset points',
            ha='left' if away > 0 else 'right',
            va='center',
            color=style.ANCHOR,
        )
    plan.set_aspect('equal', adjustable='datalim')
    plan.margins(0.12)
    plan.set_xlabel('x [m]')
    plan.set_ylabel('y [m]')
    plan.set_title(f'anchors, ellipses of 3 sigma x {ENLARGED:g}', loc='left')
    edge = 6.0 * found.range_std_m
    bins = np.linspace(-edge, 2.0 * edge, 73)
    for item in found.anchors:
        clipped = np.clip(found.residuals[item.anchor_id], bins[0], bins[-1])
        left.hist(clipped, bins=bins, histtype='step', lw=1.1, label=item.anchor_id)
    left.legend(fontsize=7)
    left.set_xlabel('range less expected [m]')
    left.set_ylabel('ranges')
    left.set_title(f'noise of a range {found.range_std_m:.3f} m', loc='left')


def draw_wheels(figure: Any, fit: WheelFit, anchors: Mapping[str, tuple[float, ...]]) -> None:
    """Draw the way as found, and dead reckoning by the wheels alone before and after.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty.
    fit : WheelFit
    anchors : mapping of str to tuple
        Their places [m].
    """
    plan, sizes = figure.subplots(1, 2, width_ratios=(3, 2))
    for path, colour, label in (
        (fit.before, style.FIX, 'wheels alone, nominal'),
        (fit.after, style.NLOS, 'wheels alone, calibrated'),
        (fit.path, style.ESTIMATE, 'with all that was measured'),
    ):
        plan.plot(*path[:, :2].T, color=colour, lw=1.1, label=label)
    for name, place in anchors.items():
        plan.plot(*place[:2], '^', color=style.ANCHOR, ms=8)
        plan.annotate(name, place[:2], xytext=(6, 4), textcoords='offset points', fontsize=7)
    plan.set_aspect('equal', adjustable='datalim')
    plan.legend(fontsize=7)
    plan.set_xlabel('x [m]')
    plan.set_ylabel('y [m]')
    change = 100.0 * (fit.sizes.values / fit.nominal.values - 1.0)
    std = 100.0 * fit.std / fit.nominal.values
    names = ['left radius', 'right radius', 'track']
    sizes.errorbar(change, range(3), xerr=3.0 * std, fmt='o', color=style.ESTIMATE, capsize=3)
    sizes.axvline(0.0, color=style.TRUTH, lw=0.8)
    sizes.set_yticks(range(3), names)
    sizes.set_ylim(2.5, -0.5)
    sizes.set_xlabel('larger than nominal [%], with 3 sigma')
