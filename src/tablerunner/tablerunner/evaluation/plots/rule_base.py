"""Pictures of a rule base: its sets, and what it decides over two of its inputs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tablerunner.control.fuzzy import RuleBase, Variable
from tablerunner.evaluation.plots import style
from tablerunner.types import Matrix, Vector

_POINTS = 121
_BANDS = 20
_SKY = '#56B4E9'  # one more of the palette of Okabe and Ito
_COLOURS = (style.ESTIMATE, style.FIX, style.ANCHOR, style.NLOS, style.HALT, style.SUBDUED, _SKY)


def draw_rule_base(
    figure: Any, base: RuleBase, over: tuple[str, str], values: Mapping[str, float], marked: bool
) -> None:
    """Draw the sets of all variables, and beside them the output over two inputs.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty.
    base : RuleBase
    over : tuple of str
        The two inputs that the surface spans; twice the same for a line over one.
    values : mapping of str to float
        All inputs: what the others are held at.
    marked : bool
        Whether to mark the values themselves.
    """
    left, right = figure.subfigures(1, 2, width_ratios=(3, 2))
    draw_memberships(left, base, values if marked else {})
    if over[0] == over[1]:
        _draw_line(right.subplots(), base, over[0], values, marked)
    else:
        draw_surface(right.subplots(), base, over, values, marked)
    figure.suptitle(f'{base.name}: {base.title}' if base.title else base.name, x=0.01, ha='left')


def draw_memberships(figure: Any, base: RuleBase, values: Mapping[str, float]) -> None:
    """Draw the sets of every variable, and values given by name as lines."""
    variables = (*base.inputs, base.output)
    columns = 1 if len(variables) <= 3 else 2
    rows = math.ceil(len(variables) / columns)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(variables) :]:
        axes.set_axis_off()
    for axes, variable in zip(grid, variables, strict=False):
        points = np.unique(
            np.concatenate(
                [
                    np.linspace(variable.low, variable.high, _POINTS),
                    *(_inside(item.membership.corners, variable) for item in variable.sets),
                ]
            )
        )
        for index, (word, degrees) in enumerate(
            zip(variable.words, variable.degrees(points), strict=True)
        ):
            colour = _COLOURS[index % len(_COLOURS)]
            axes.plot(points, degrees, color=colour, lw=1.4)
            top = points[degrees >= degrees.max() - 1e-9].mean()
            # Names at the ends of the domain stay clear of the ticks and the next axes.
            share = (top - variable.low) / (variable.high - variable.low)
            side = 'left' if share < 0.02 else 'right' if share > 0.98 else 'center'
            axes.annotate(
                word, (top, 1.0), (0, 2), textcoords='offset points', ha=side, color=colour
            )
        if variable.name in values:
            value = min(max(values[variable.name], variable.low), variable.high)
            axes.axvline(value, color=style.TRUTH, lw=0.9, ls=(0, (4, 2)))
        axes.set_xlim(variable.low, variable.high)
        axes.set_ylim(0.0, 1.18)
        axes.set_yticks([0.0, 1.0])
        axes.set_xlabel(_label(variable), labelpad=1.0)


def draw_surface(
    axes: Any, base: RuleBase, over: tuple[str, str], values: Mapping[str, float], marked: bool
) -> None:
    """Draw the output over two inputs as bands of colour, the others held at their values."""
    across, up = (base.inputs[base.input_names.index(name)] for name in over)
    x = np.linspace(across.low, across.high, _POINTS)
    y = np.linspace(up.low, up.high, _POINTS)
    grid_x, grid_y = np.meshgrid(x, y)
    output = _outputs(base, values, {over[0]: grid_x.ravel(), over[1]: grid_y.ravel()})
    output = output.reshape(grid_x.shape)
    low, high = base.output.low, base.output.high
    signed = low < 0.0 < high
    levels = np.linspace(low, high, _BANDS + 1)
    # Plateaus lie right on the edges of bands: what rounding adds to them would show as specks.
    even = np.clip(np.round(output, 9), low, high)
    colours = axes.contourf(x, y, even, levels, cmap='PuOr' if signed else 'viridis')
    if marked:
        place = [min(max(values[item.name], item.low), item.high) for item in (across, up)]
        axes.plot(*place, 'o', ms=7, mfc='none', mec=style.TRUTH, mew=1.6, clip_on=False)
    axes.figure.colorbar(colours, ax=axes, ticks=levels[::5], label=_label(base.output))
    axes.set_xlabel(_label(across))
    axes.set_ylabel(_label(up))
    _note_others(axes, base, over, values)


def _draw_line(
    axes: Any, base: RuleBase, name: str, values: Mapping[str, float], marked: bool
) -> None:
    variable = base.inputs[base.input_names.index(name)]
    x = np.linspace(variable.low, variable.high, 4 * _POINTS)
    axes.plot(x, _outputs(base, values, {name: x}), color=style.ESTIMATE)
    if marked:
        value = min(max(values[name], variable.low), variable.high)
        axes.axvline(value, color=style.TRUTH, lw=0.9, ls=(0, (4, 2)))
    axes.set_xlabel(_label(variable))
    axes.set_ylabel(_label(base.output))
    axes.set_ylim(base.output.low, base.output.high)
    _note_others(axes, base, (name, name), values)


def _outputs(base: RuleBase, values: Mapping[str, float], varied: Mapping[str, Vector]) -> Vector:
    count = len(next(iter(varied.values())))
    rows: Matrix = np.empty((count, len(base.inputs)))
    for column, name in enumerate(base.input_names):
        rows[:, column] = varied.get(name, values[name])
    return base.infer(rows)


def _note_others(
    axes: Any, base: RuleBase, over: tuple[str, str], values: Mapping[str, float]
) -> None:
    """Write above the axes what the other inputs are held at, two to a line."""
    others = [
        f'{item.name} {values[item.name]:g} {item.unit}'.rstrip()
        for item in base.inputs
        if item.name not in over
    ]
    lines = [', '.join(others[index : index + 2]) for index in range(0, len(others), 2)]
    axes.set_title('\n'.join(lines), loc='left', fontsize=8, color=style.SUBDUED)


def _inside(points: tuple[float, ...], variable: Variable) -> list[float]:
    return [point for point in points if variable.low <= point <= variable.high]


def _label(variable: Variable) -> str:
    name = variable.name.replace('_', ' ')
    return f'{name} [{variable.unit}]' if variable.unit else name
