"""Every solver by name, all called alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from numpy.typing import ArrayLike

from tablerunner.errors import ConfigError
from tablerunner.uwb.epochs import Epochs
from tablerunner.uwb.fix import PositionFix, join_fixes
from tablerunner.uwb.solvers.centroid import solve_centroid, solve_twice_centroid
from tablerunner.uwb.solvers.hyperbolic import solve_hyperbolic
from tablerunner.uwb.solvers.linear import solve_linear
from tablerunner.uwb.solvers.nonlinear import check_layout, solve_nonlinear
from tablerunner.uwb.solvers.residual_weighted import solve_residual_weighted
from tablerunner.uwb.solvers.three_circle import solve_three_circle
from tablerunner.uwb.solvers.two_anchor import solve_two_anchor

Solver = Callable[[Epochs], PositionFix]
"""From checked epochs to their positions."""

SOLVERS: Mapping[str, Solver] = MappingProxyType(
    {
        'nonlinear': solve_nonlinear,
        'linear': solve_linear,
        'three_circle': solve_three_circle,
        'centroid': solve_centroid,
        'twice_centroid': solve_twice_centroid,
        'residual_weighted': solve_residual_weighted,
        'hyperbolic': solve_hyperbolic,
        'two_anchor': solve_two_anchor,
    }
)
"""The solvers by the names under which a parameter chooses them."""

CHUNK = 65_536
"""Epochs that are worked on at a time: temporary arrays stay within some ten megabytes."""


def solver_named(name: str) -> Solver:
    """Return a solver by its name.

    Raises
    ------
    ConfigError
        There is none of that name.
    """
    try:
        return SOLVERS[name]
    except KeyError:
        raise ConfigError('solver', name, 'one of ' + ', '.join(SOLVERS)) from None


def solve(
    name: str,
    anchors: ArrayLike,
    ranges: ArrayLike,
    std: ArrayLike,
    tag_height: float,
    nlos: ArrayLike = float('nan'),
    progress: Callable[[int, int], None] | None = None,
) -> PositionFix:
    """Return the positions of m epochs of ranges to n anchors by the solver of that name.

    Parameters
    ----------
    name : str
        One of `SOLVERS`.
    anchors, ranges, std, tag_height, nlos
        As for `Epochs.of`.
    progress : callable, optional
        Called after each chunk with the epochs done and all epochs.

    Raises
    ------
    ConfigError
        No such solver.
    GeometryError
        Shapes that do not fit, too few anchors, anchors in one line.
    CovarianceError
        A standard deviation that is not positive.
    """
    solver = solver_named(name)
    epochs = Epochs.of(anchors, ranges, std, tag_height, nlos)
    check_layout(epochs.anchors)
    count = len(epochs)
    parts: list[PositionFix] = []
    for first in range(0, max(count, 1), CHUNK):
        parts.append(solver(epochs.some(slice(first, first + CHUNK))))
        if progress is not None:
            progress(min(first + CHUNK, count), count)
    return parts[0] if len(parts) == 1 else join_fixes(parts)
