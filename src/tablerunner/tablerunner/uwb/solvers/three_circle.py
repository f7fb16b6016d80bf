"""The closed form for three circles (Sun 16-17)."""

from __future__ import annotations

import numpy as np

from tablerunner.uwb.epochs import Array, Epochs
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.solvers.judge import judge
from tablerunner.uwb.solvers.linear import MINIMUM_RANGES
from tablerunner.uwb.solvers.triples import choose_triples, triples_by_area


def solve_three_circle(epochs: Epochs) -> PositionFix:
    """Return where the common chords of three circles meet.

    With more than three ranges, those three whose anchors span the widest triangle are taken.
    """
    plane = epochs.plane_ranges()
    usable = np.isfinite(plane)
    chosen, found = choose_triples(triples_by_area(epochs.anchors), usable)
    rows = np.arange(len(epochs))[:, None]
    distance = np.where(found[:, None], plane[rows, chosen], 1.0)
    # About the mean of the anchors: squares of far coordinates would eat digits.
    origin = epochs.anchors[:, :2].mean(axis=0)
    corners = epochs.anchors[chosen, :2] - origin
    place, gain = three_circles(corners, distance**2)
    error = np.where(
        found[:, None], -2.0 * epochs.ranges[rows, chosen] * epochs.std[rows, chosen], 0.0
    )
    scaled = gain * error[:, None, :]
    used = np.zeros(usable.shape, dtype=bool)
    used[rows[found], chosen[found]] = True
    state = np.where(found, FixState.SOLVED, FixState.IN_LINE).astype(np.int8)
    state[usable.sum(axis=1) < MINIMUM_RANGES] = FixState.TOO_FEW
    return judge(epochs, place + origin, scaled @ scaled.transpose(0, 2, 1), used, state)


def three_circles(corners: Array, squares: Array) -> tuple[Array, Array]:
    """Return where m triples of circles meet.

    Subtracting the third circle from the first and second leaves two lines,
    2 (x_i - x_3) x + 2 (y_i - y_3) y = C_i, which Cramer's rule solves. (Sun 17 prints y with the
    anchors' y where it takes their x.)

    Parameters
    ----------
    corners : ndarray, shape (m, 3, 2)
        Centres [m].
    squares : ndarray, shape (m, 3)
        Squared radii [m^2].

    Returns
    -------
    place : ndarray, shape (m, 2)
        NaN where the centres are in one line.
    gain : ndarray, shape (m, 2, 3)
        d(place)/d(squares) [1/m].
    """
    x, y = corners[:, :, 0], corners[:, :, 1]
    constant = x**2 + y**2 - squares
    c1, c2 = constant[:, 0] - constant[:, 2], constant[:, 1] - constant[:, 2]
    x13, x23 = x[:, 0] - x[:, 2], x[:, 1] - x[:, 2]
    y13, y23 = y[:, 0] - y[:, 2], y[:, 1] - y[:, 2]
    c = 2.0 * (x13 * y23 - x23 * y13)
    with np.errstate(divide='ignore', invalid='ignore'):
        inverse = np.where(c != 0.0, 1.0 / c, np.nan)
    place = np.stack([c1 * y23 - c2 * y13, c2 * x13 - c1 * x23], axis=1) * inverse[:, None]
    # c1 falls with the first square and rises with the third; c2 with the second likewise.
    first = np.stack([-y23, x23], axis=1)
    second = np.stack([y13, -x13], axis=1)
    gain = np.stack([first, second, -(first + second)], axis=2) * inverse[:, None, None]
    return place, gain
