"""UWB positions on a recording of real ranges: the LIAS trolley, biases from its first half."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.lias_recording import FOLDER, LiasRecording, read_lias
from tablerunner.uwb.range_calibration import fit_calibration
from tablerunner.uwb.solvers.registry import solve
from tablerunner.uwb.solvers.rigid_body import BodyFix, solve_rigid_body

Array = NDArray[np.float64]

RANGE_STD_M = 0.1
_ROWS = (
    # name, solver, how far the calibration goes, bound [m], raw
    ('tag 0, linear, as measured', 'linear', 'none', None, True),
    ('tag 0, nonlinear, as measured', 'nonlinear', 'none', None, True),
    ('tag 0, linear, bias of each anchor', 'linear', 'bias', None, False),
    ('tag 0, nonlinear, bias of each anchor', 'nonlinear', 'bias', 0.14, False),
    ('tag 0, nonlinear, bias and scale of each anchor', 'nonlinear', 'scale', 0.14, False),
)


def run_lias(data: Path, progress: Progress) -> Outcome:
    """Calibrate on the first half of the recording, and judge the second.

    Parameters
    ----------
    data : Path
        Folder that holds `FOLDER`.
    progress : callable
        Told after each step.

    Raises
    ------
    ConfigError
        The recording is not there, or malformed.
    """
    recording = read_lias(data / FOLDER)
    half = len(recording.times) // 2
    true = recording.tag_positions()[half:, 0, :2]
    height = float(recording.tag_positions()[:half, 0, 2].mean())
    errors: dict[str, Array] = {}
    rows: list[Row] = []
    for done, (name, solver, kind, limit, raw) in enumerate(_ROWS):
        ranges = calibrate(recording, half, kind)[half:, :, 0]
        fix = solve(solver, recording.anchors, ranges, RANGE_STD_M, height)
        errors[name] = np.linalg.norm(fix.position - true, axis=1)
        bound = None if limit is None else Bound(high=limit)
        rows.append(Row(f'{name}, RMSE', 'm', Spread.of([rms(errors[name])]), None, raw, bound))
        progress(done + 1, len(_ROWS) + 1)
    body = pose_of(recording, half)
    place = np.linalg.norm(body.position[half:] - recording.position[half:, :2], axis=1)
    off = np.exp(1j * (body.heading - recording.heading))
    # Between the axes of the motion capture and those of the tags: a constant.
    rotation = float(np.angle(np.nanmean(off[:half])))
    turn = np.degrees(np.angle(off[half:] * np.exp(-1j * rotation)))
    rows += [
        Row(f'three tags, {name}', unit, Spread.of([value]))
        for name, unit, value in (
            ('position, RMSE', 'm', rms(place)),
            ('heading, RMSE', 'deg', rms(turn)),
            ('heading, mean', 'deg', float(np.nanmean(turn))),
            ('heading, median of the size', 'deg', float(np.nanmedian(np.abs(turn)))),
        )
    ]
    progress(len(_ROWS) + 1, len(_ROWS) + 1)
    return Outcome(
        'lias',
        'LIAS trolley: UWB positions of the second half, calibrated on the first',
        (0,),
        tuple(rows),
        partial(draw, times=recording.times[half:], errors=errors, turn=turn),
        {
            'epochs calibrated on': half,
            'epochs judged': len(true),
            'height of tag 0 [m]': height,
            'rotation of the tags against the motion capture [deg]': float(np.degrees(rotation)),
        },
        (
            'One recording, no seeds. Nothing is fitted to the second half.',
            (
                'The quaternion columns are read as they make sense for a trolley in the plane: '
                'docs/datasets.md.'
            ),
            ('The heading is against the truth turned by a constant, found on the first half.'),
        ),
    )


def calibrate(recording: LiasRecording, half: int, kind: str) -> Array:
    """Return ranges calibrated on the first half, shape (m, n, k) [m].

    `kind` is ``none``, ``bias``, or ``scale`` for bias and scale of each anchor and tag.
    """
    ranges: Array = np.array(recording.ranges)
    if kind == 'none':
        return ranges
    true = recording.true_ranges()
    span = np.inf if kind == 'bias' else 2.0
    for anchor in range(ranges.shape[1]):
        for tag in range(ranges.shape[2]):
            fit = fit_calibration(
                true[:half, anchor, tag], recording.ranges[:half, anchor, tag], least_span=span
            )
            ranges[:, anchor, tag] = fit.apply(recording.ranges[:, anchor, tag])
    return ranges


def pose_of(recording: LiasRecording, half: int) -> BodyFix:
    """Return position and heading of the trolley, from all three tags."""
    return solve_rigid_body(
        recording.anchors,
        recording.tags,
        calibrate(recording, half, 'scale'),
        RANGE_STD_M,
        float(recording.position[:half, 2].mean()),
    )


def rms(values: Array) -> float:
    """Return the root mean square of values that are there."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def draw(figure: Any, times: Array, errors: dict[str, Array], turn: Array) -> None:
    """Draw the errors over time, and of the heading."""
    above, below = figure.subplots(2, sharex=True)
    for (name, *_), colour in zip((_ROWS[1], _ROWS[4]), ('#E69F00', '#0072B2'), strict=True):
        above.plot(times, errors[name], color=colour, linewidth=0.8, label=name)
    above.set_ylabel('position error [m]')
    above.set_ylim(0.0, 0.6)
    above.legend(loc='upper right')
    above.set_title('LIAS trolley, second half', loc='left')
    below.plot(times, turn, color='#0072B2', linewidth=0.8)
    below.set_ylabel('heading error [deg]')
    below.set_xlabel('time [s]')
