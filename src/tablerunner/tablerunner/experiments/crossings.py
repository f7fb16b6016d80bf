"""Three robots serve one room under one camera, and cross each other's ways all the time.

What is asked: that no pose is ever given to another robot than the one that was there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.meetings import AWAY_M, NEAR_M
from tablerunner.experiments.seeds import run_seeds
from tablerunner.experiments.shared_room import (
    CAMERA,
    COLOURS,
    DEPTH_M,
    MISTAKEN_M,
    SERVICE_S,
    SOURCES,
    WIDTH_M,
    Service,
    run_service,
)
from tablerunner.scenario import hue_of


def run_crossings(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Serve for ten minutes with each seed."""
    runs = run_seeds(run_service, tuple(seeds), progress)
    tallies = [run.tally for run in runs]
    rows = [
        _row('poses given to the wrong robot', '1', [t.mistaken for t in tallies], high=0.0),
        _row('poses', '1', [t.found for t in tallies]),
        _row('found, of robots in pictures, share', '1', [t.found / t.pictures for t in tallies]),
        _row(
            'found with another robot nearer than 1 m, share',
            '1',
            [t.found_near / max(t.seen_near, 1) for t in tallies],
        ),
        _row('place by the camera alone, max', 'm', [max(t.place_errors) for t in tallies]),
        _row('meetings nearer than 1 m', '1', [len(t.meetings.past) for t in tallies]),
        _row(
            'of these crossed',
            '1',
            [sum(meeting.crossed for meeting in t.meetings.past) for t in tallies],
            low=20.0,
        ),
        _row(
            'nearest two robots',
            'm',
            [min((m.nearest for m in t.meetings.past), default=math.inf) for t in tallies],
        ),
        _row('touches', '1', [t.contacts for t in tallies], high=0.0),
    ]
    for name in SOURCES:
        errors = [run.errors[name] for run in runs]
        rows.append(_row(f'ekf, {name}, mean', 'm', [e.mean() for e in errors], raw=False))
        rows.append(_row(f'ekf, {name}, max', 'm', [e.max() for e in errors], raw=False))
    return Outcome(
        'crossings',
        'Three robots serve for ten minutes under one camera, crossing each other',
        tuple(seeds),
        tuple(rows),
        partial(draw, run=runs[0]),
        {
            'service [s]': SERVICE_S,
            'room [m]': [WIDTH_M, DEPTH_M],
            'camera height [m]': CAMERA.position[2],
            'coloured things on the floor': CAMERA.clutter,
            'hues [deg]': [round(hue_of(colour), 1) for colour in COLOURS],
            'legs': [run.legs for run in runs],
            'not found, by reason': [run.tally.refused for run in runs],
        },
        (
            f'A pose more than {MISTAKEN_M:g} m (a radius) from its robot counts as of another.',
            'They cross when the direction from one to the other swings by more than 90 degrees '
            f'between coming nearer than {NEAR_M:g} m and being {AWAY_M:g} m apart.',
            'Robots are driven along their legs by the truth; estimates are of the live filter at '
            'each odometry (50 Hz), with pictures that arrive 60 ms late.',
            'The camera hangs where the scenario says to 3 mm and 1 mrad, its focal length is '
            'known to 0.05 %: that is most of the error.',
        ),
    )


def _row(
    name: str,
    unit: str,
    values: Sequence[float],
    low: float = -math.inf,
    high: float = math.inf,
    raw: bool = True,
) -> Row:
    bounded = math.isfinite(low) or math.isfinite(high)
    of = 'low' if math.isfinite(low) else 'high'
    bound = Bound(low=low, high=high, of=of) if bounded else None
    return Row(name, unit, Spread.of(values), raw=raw, bound=bound)


def draw(figure: Any, run: Service) -> None:
    """Draw the first seed's nearest meeting as the camera saw it, the ways, the errors."""
    from tablerunner.evaluation.plots import style

    seen, axes, below = figure.subplots(1, 3, width_ratios=(1.5, 1.2, 0.9))
    seen.imshow(run.view[..., ::-1])
    seen.set_axis_off()
    seen.set_title('The nearest meeting', loc='left')
    for path, colour in zip(run.paths.values(), COLOURS, strict=True):
        shade = tuple(value / 255.0 for value in colour)
        axes.plot(*path.T, color=shade, linewidth=0.5, alpha=0.7)
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')
    axes.set_title('Ways in ten minutes', loc='left')
    for (name, errors), ink in zip(run.errors.items(), (style.ESTIMATE, style.FIX), strict=True):
        share = np.linspace(0.0, 1.0, len(errors))
        below.plot(1e3 * np.sort(errors), share, color=ink, label=name)
    below.set_xlabel('error of the ekf [mm]')
    below.set_ylabel('share')
    below.set_title('Errors, all robots', loc='left')
    below.legend()
