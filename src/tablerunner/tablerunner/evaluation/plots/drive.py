"""A tour through a room: where the robot drove, where it believed to be, what it touched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tablerunner.evaluation.plots import style
from tablerunner.evaluation.plots.room import draw_anchors, draw_room, extent
from tablerunner.scenario import Scenario
from tablerunner.types import Matrix

LEGS = ('#0072B2', '#E69F00', '#009E73', '#CC79A7', '#56B4E9')
"""Colours of the ways from stop to stop, one after the other."""

_MARK_S = 20.0


def draw_drive(
    axes: Any,
    scenario: Scenario,
    unknown: Sequence[str],
    track: Matrix,
    ends_s: Sequence[float],
    tour: Mapping[str, bool],
    contacts: Sequence[tuple[float, bool]],
) -> None:
    """Draw one tour.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    scenario : Scenario
        The room as it is.
    unknown : sequence of str
        Names of the boxes that the robot's map does not show; they are hatched.
    track : ndarray, shape (n, 6)
        Time [s], true x, y [m], heading [rad], estimated x, y [m].
    ends_s : sequence of float
        When the way to each stop ended [s].
    tour : mapping of str to bool
        Stops in their order, and whether they can be reached.
    contacts : sequence of (float, bool)
        Times of touches [s], and whether the robot is to blame.
    """
    from matplotlib.patches import Circle, Polygon

    draw_room(axes, scenario)
    draw_anchors(axes, [place.anchor for place in scenario.anchors])
    for box in scenario.boxes:
        if box.name in unknown:
            axes.add_patch(
                Polygon(
                    box.outline.corners, fc='none', ec=style.NLOS, hatch='////', lw=0.9, zorder=1.8
                )
            )
    for person in scenario.people:
        if len(person.route) == 1:
            axes.add_patch(Circle(person.route[0], person.radius, fc='#C9C9C9', ec='none'))
    for number, (name, is_open) in enumerate(tour.items(), start=1):
        stop = scenario.stops.get(name, scenario.start_pose)
        colour = LEGS[(number - 1) % len(LEGS)]
        axes.add_patch(
            Circle(
                (stop.x, stop.y),
                scenario.robot.footprint_radius,
                fc='none',
                ec=colour,
                lw=1.4,
                ls='-' if is_open else ':',
                zorder=5,
            )
        )
        axes.text(stop.x, stop.y, str(number), ha='center', va='center', color=colour, zorder=8)
    axes.plot(track[:, 4], track[:, 5], color='#999999', lw=0.7, zorder=4)
    begin = -1.0
    for number, end in enumerate(_filled(ends_s, track)):
        part = track[(track[:, 0] >= begin) & (track[:, 0] <= end)]
        axes.plot(part[:, 1], part[:, 2], color=LEGS[number % len(LEGS)], lw=1.6, zorder=4.5)
        begin = end
    for time in np.arange(_MARK_S, track[-1, 0], _MARK_S):
        row = track[int(np.searchsorted(track[:, 0], time))]
        axes.plot(row[1], row[2], '.', color=style.TEXT, ms=3, zorder=4.6)
        axes.annotate(
            f'{time:.0f}',
            row[1:3],
            xytext=(3, 3),
            textcoords='offset points',
            fontsize=6,
            zorder=9,
        )
    for time, at_fault in contacts:
        row = track[min(int(np.searchsorted(track[:, 0], time)), len(track) - 1)]
        colour = style.NLOS if at_fault else style.HALT
        axes.plot(row[1], row[2], 'x', color=colour, ms=9, mew=2.2, zorder=10)
    low, high = extent(scenario, track[:, 1:3])
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')


def _filled(ends_s: Sequence[float], track: Matrix) -> list[float]:
    """Return the ends of the ways, with the end of the track for those that have none."""
    ends = [end for end in ends_s if np.isfinite(end)]
    return ends if ends and len(ends) == len(ends_s) else [*ends, float(track[-1, 0])]
