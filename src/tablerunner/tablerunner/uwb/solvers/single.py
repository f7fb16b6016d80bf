"""One epoch in plain floats: what arrays cost too much for.

The same steps as `minimiser`, so that both give the same position; a test holds them together.
"""

from __future__ import annotations

import math

import numpy as np

from tablerunner.uwb.epochs import Epochs
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.solvers.minimiser import (
    CONVERGED_M,
    CURVED,
    ITERATIONS,
    NEAREST_M,
    NO_PROGRESS,
)

Row = tuple[float, float, float, float, float]  # x, y, squared height, range, weight
Expansion = tuple[float, float, float, float, float, float, float, float, float]


def solve_single(epochs: Epochs, two_sided: float) -> PositionFix | None:
    """Return the fix of one epoch, or None where the general solver has to look at it.

    Parameters
    ----------
    epochs : Epochs
        One epoch.
    two_sided : float
        Flatness of the anchors' layout under which a second minimum has to be looked for.
    """
    ranges, deviations = epochs.ranges[0].tolist(), epochs.std[0].tolist()
    anchors = epochs.anchors.tolist()
    used = [measured == measured for measured in ranges]  # not NaN
    count = sum(used)
    if count < 3:
        return None
    # About the mean of all anchors, as the general solver, for the same rounding.
    centre_x = sum(anchor[0] for anchor in anchors) / len(anchors)
    centre_y = sum(anchor[1] for anchor in anchors) / len(anchors)
    rows: list[Row] = [
        (
            anchor[0] - centre_x,
            anchor[1] - centre_y,
            (anchor[2] - epochs.tag_height) ** 2,
            measured,
            1.0 / deviation**2,
        )
        for anchor, measured, deviation, use in zip(anchors, ranges, deviations, used, strict=True)
        if use
    ]
    if _flatness(rows) < two_sided:
        return None
    found = _descend(rows, *_linear(rows))
    if found is None:
        return None
    x, y, (cost, _, _, _, _, _, a, b, d) = found
    determinant = a * d - b * b
    if not determinant > 1e-6 * (a + d) ** 2:
        return None
    return PositionFix(
        np.array([[x + centre_x, y + centre_y]]),
        np.array([[[d / determinant, -b / determinant], [-b / determinant, a / determinant]]]),
        np.array([used]),
        *_residuals(rows, x, y, cost),
        np.array([FixState.SOLVED], dtype=np.int8),
    )


def _flatness(rows: list[Row]) -> float:
    mean_x = sum(row[0] for row in rows) / len(rows)
    mean_y = sum(row[1] for row in rows) / len(rows)
    a = b = d = 0.0
    for row in rows:
        dx, dy = row[0] - mean_x, row[1] - mean_y
        a, b, d = a + dx * dx, b + dx * dy, d + dy * dy
    large = 0.5 * (a + d) + math.hypot(0.5 * (a - d), b)
    return math.sqrt(max(a * d - b * b, 0.0)) / large if large > len(rows) * 1e-6 else 0.0


def _linear(rows: list[Row]) -> tuple[float, float]:
    total = sum(row[4] for row in rows)
    mean_x = sum(row[4] * row[0] for row in rows) / total
    mean_y = sum(row[4] * row[1] for row in rows) / total
    a = b = d = gx = gy = 0.0
    for x, y, height2, measured, weight in rows:
        cx, cy = 2.0 * (x - mean_x), 2.0 * (y - mean_y)
        right = weight * (x * x + y * y - measured * measured + height2)
        a, b, d = a + weight * cx * cx, b + weight * cx * cy, d + weight * cy * cy
        gx, gy = gx + cx * right, gy + cy * right
    determinant = a * d - b * b
    if not determinant > 1e-14 * (a + d) ** 2:
        return 0.0, 0.0
    return (d * gx - b * gy) / determinant, (a * gy - b * gx) / determinant


def _expand(rows: list[Row], px: float, py: float) -> Expansion:
    """Return cost, gradient x and y, second derivatives xx, xy, yy, and the same of J'WJ."""
    cost = gx = gy = ha = hb = hd = a = b = d = 0.0
    sqrt = math.sqrt
    for x, y, height2, measured, weight in rows:
        dx, dy = px - x, py - y
        predicted = sqrt(dx * dx + dy * dy + height2)
        inverse = 1.0 / (predicted if predicted > NEAREST_M else NEAREST_M)
        jx, jy = dx * inverse, dy * inverse
        residual = predicted - measured
        weighted = weight * residual
        cost += weighted * residual
        gx += weighted * jx
        gy += weighted * jy
        xx, xy, yy = jx * jx, jx * jy, jy * jy
        a += weight * xx
        b += weight * xy
        d += weight * yy
        bend = weighted * inverse
        ha += bend * (1.0 - xx)
        hb -= bend * xy
        hd += bend * (1.0 - yy)
    return cost, gx, gy, a + ha, b + hb, d + hd, a, b, d


def _descend(rows: list[Row], x: float, y: float) -> tuple[float, float, Expansion] | None:
    damping = 1e-9
    now = _expand(rows, x, y)
    for _ in range(ITERATIONS):
        cost, gx, gy, a, b, d, gauss_a, gauss_b, gauss_d = now
        added = damping * (gauss_a + gauss_d)
        if not (a * d - b * b > CURVED * (a + d) ** 2 and a + d > 0.0):
            a, b, d = gauss_a, gauss_b, gauss_d
            added = max(damping, 1e-3) * (gauss_a + gauss_d)
        a, d = a + added, d + added
        determinant = a * d - b * b
        if not determinant > 0.0:
            return None
        step_x, step_y = (d * gx - b * gy) / determinant, (a * gy - b * gx) / determinant
        trial = _expand(rows, x - step_x, y - step_y)
        if trial[0] <= cost * (1.0 + NO_PROGRESS):
            x, y, now = x - step_x, y - step_y, trial
            damping = max(damping * 0.01, 1e-9)
        else:
            damping = damping * 10.0 + 1e-4
        if math.hypot(step_x, step_y) < CONVERGED_M:
            return x, y, now
    return None


def _residuals(
    rows: list[Row], px: float, py: float, cost: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return residual RMS, chi-square and GDOP, each as an array of one."""
    squares = a = b = d = 0.0
    for x, y, height2, measured, _ in rows:
        dx, dy = px - x, py - y
        predicted = math.sqrt(dx * dx + dy * dy + height2)
        squares += (predicted - measured) ** 2
        inverse = 1.0 / max(predicted, NEAREST_M)
        jx, jy = dx * inverse, dy * inverse
        a, b, d = a + jx * jx, b + jx * jy, d + jy * jy
    determinant = a * d - b * b
    dilution = math.sqrt((a + d) / determinant) if determinant > 0.0 else math.inf
    return (
        np.array([math.sqrt(squares / len(rows))]),
        np.array([cost]),
        np.array([dilution]),
    )
