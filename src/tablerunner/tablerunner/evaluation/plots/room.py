"""The plan of a room: walls, furniture, anchors, the kitchen, where people walk."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from tablerunner.evaluation.plots import style
from tablerunner.scenario import Scenario
from tablerunner.types import Anchor, Matrix, Vector

_MARGIN = 0.03
_NOTE = {'fc': 'white', 'ec': 'none', 'alpha': 0.7, 'pad': 1.0}


def draw_room(axes: Any, scenario: Scenario) -> None:
    """Draw everything that stands in the room."""
    from matplotlib.patches import Circle, Polygon

    unmapped = {box.name for box in scenario.boxes if box.unmapped}
    for outline in scenario.outlines:
        if not outline.is_solid:
            corners = outline.corners
            if outline.closed:
                corners = np.vstack([corners, corners[:1]])
            axes.plot(*corners.T, color=style.WALL, lw=2.6, solid_capstyle='round', zorder=3)
            continue
        table = outline.kind == 'table'
        axes.add_patch(
            Polygon(
                outline.corners,
                closed=True,
                fc=style.TABLE_FACE if table else style.BOX_FACE,
                ec=style.TABLE_EDGE if table else style.BOX_EDGE,
                lw=0.9,
                hatch='////' if outline.name in unmapped else None,
                zorder=1.5,
            )
        )
        x, y = outline.corners.mean(axis=0)
        label = outline.name.removeprefix('table_') if table else ''
        axes.text(x, y, label, ha='center', va='center', color=style.TABLE_EDGE, zorder=1.6)
        if outline.name in unmapped:
            note = f'{outline.name}, not on the map'
            axes.text(x, y, note, fontsize=7, ha='center', va='center', zorder=6.2, bbox=_NOTE)
    for person in scenario.people:
        route = np.array(person.route)
        if len(route) == 1:  # stands there
            body = Circle(person.route[0], person.radius, fc=style.HALT, ec='none', alpha=0.5)
            axes.add_patch(body)
            axes.annotate(
                person.name,
                person.route[0],
                xytext=(10, 6),
                textcoords='offset points',
                fontsize=7,
            )
            continue
        if person.loop:
            route = np.vstack([route, route[:1]])
        axes.plot(*route.T, color='#C9C9C9', lw=0.9, ls=(0, (1, 2.5)), zorder=1.2)
    kitchen = scenario.kitchen
    if kitchen is not None:
        axes.annotate(
            kitchen.name,
            (kitchen.stop_pose.x, kitchen.stop_pose.y),
            xytext=(0, 15),
            textcoords='offset points',
            ha='center',
            color=style.SUBDUED,
            fontweight='bold',
            zorder=6,
        )


def draw_anchors(axes: Any, anchors: Iterable[Anchor]) -> None:
    """Draw the anchors, each with its name written towards the middle of the picture."""
    places = list(anchors)
    if not places:
        return
    middle = np.mean([anchor.position[:2] for anchor in places], axis=0)
    for anchor in places:
        x, y = anchor.position[:2]
        axes.plot(
            x, y, marker='^', ms=9, mfc=style.ANCHOR, mec='white', mew=0.8, zorder=7, clip_on=False
        )
        away = 1 if x < middle[0] else -1
        axes.annotate(
            anchor.anchor_id,
            (x, y),
            xytext=(9 * away, 0),
            textcoords='offset points',
            ha='left' if away > 0 else 'right',
            va='center',
            color=style.ANCHOR,
            fontweight='bold',
            zorder=7,
        )


def extent(scenario: Scenario | None, points: Matrix) -> tuple[Vector, Vector]:
    """Return the least and greatest x, y that hold the room and all points, with a margin.

    Parameters
    ----------
    scenario : Scenario or None
        The room.
    points : ndarray, shape (n, 2)
        Rows that are not finite are left out.
    """
    parts = [points[np.isfinite(points).all(axis=1)]]
    if scenario is not None:
        low_x, low_y, high_x, high_y = scenario.bounds
        parts.append(np.array([[low_x, low_y], [high_x, high_y]]))
    everything = np.concatenate(parts)
    if not len(everything):
        everything = np.zeros((1, 2))
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = _MARGIN * max(float((high - low).max()), 1.0)
    return low - margin, high + margin
