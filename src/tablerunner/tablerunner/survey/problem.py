"""Ranges and motions as one least-squares problem over knots, anchors and what sensors read wrong.

The values are, one after the other: x, y, heading of each knot; x, y, z, bias, scale of each
anchor; what the motion reads wrong. With p, h a knot, l the tag seen from it (z: its height), a an
anchor with bias b and scale s, R a rotation (docs/survey.md):

    range      (1 + s) |p + R(h) l - a| + b                                            (1)
    motion     R(-h) (p' - p) and h' - h, against what the wheels and the gyroscope say     (2)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from tablerunner.survey.adjust import PRIOR, Rows
from tablerunner.survey.track import rotated

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

RANGES, ALONG, TURN, ACROSS, GYRO, LINKS = 1, 2, 3, 4, 5, 6
GROUPS = 7
"""Groups of residuals: ranges; motions along, in turn and across; gyroscope; between anchors."""

PER_ANCHOR = 5
_FROM_HEADING = np.array([[0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True)
class Layout:
    """Which value stands where."""

    knots: int
    anchors: int
    motion: int

    @property
    def size(self) -> int:
        """Number of values."""
        return 3 * self.knots + PER_ANCHOR * self.anchors + self.motion

    def knot(self, index: Indices) -> Indices:
        """Return where the x of knots stands; y and heading follow."""
        return 3 * np.asarray(index, dtype=np.intp)

    def anchor(self, index: Indices | np.intp | int) -> Indices:
        """Return where the x of anchors stands; y, z, bias, scale follow."""
        return 3 * self.knots + PER_ANCHOR * np.asarray(index, dtype=np.intp)

    @property
    def first_motion(self) -> int:
        """Where what the motion reads wrong begins."""
        return 3 * self.knots + PER_ANCHOR * self.anchors

    def poses(self, values: Array) -> Array:
        """Return the knots, shape (knots, 3)."""
        return values[: 3 * self.knots].reshape(-1, 3)

    def places(self, values: Array) -> Array:
        """Return the anchors, shape (anchors, 5)."""
        return values[3 * self.knots : self.first_motion].reshape(-1, PER_ANCHOR)

    def wrongs(self, values: Array) -> Array:
        """Return what the motion reads wrong, shape (motion,)."""
        return values[self.first_motion :]


@dataclass(frozen=True)
class TagRanges:
    """Ranges between the tag and anchors.

    Attributes
    ----------
    knot, anchor : ndarray of int, shape (m,)
        From which knot the tag is seen, and to which anchor.
    lever : ndarray, shape (m, 3)
        Tag seen from its knot; z is its height over the floor [m].
    range_m : ndarray, shape (m,)
    std_m : ndarray, shape (m,)
    """

    knot: Indices
    anchor: Indices
    lever: Array
    range_m: Array
    std_m: Array


@dataclass(frozen=True)
class Links:
    """Distances between anchors as the anchors measured them.

    Attributes
    ----------
    first, second : ndarray of int, shape (m,)
    range_m, std_m : ndarray, shape (m,)
        One for each pair: the bias of a link does not average out.
    """

    first: Indices
    second: Indices
    range_m: Array
    std_m: Array


class Motions(Protocol):
    """What is measured of the motion between knots."""

    @property
    def count(self) -> int:
        """Number of values that stand for what is read wrong."""

    @property
    def priors(self) -> Array:
        """Standard deviations of those values, shape (count,)."""

    def told(self, wrongs: Array) -> tuple[Array, Array]:
        """Return the motions, shape (k, 3), and their derivatives, shape (k, 3, count)."""

    def whiteners(self) -> tuple[Array, Array, Array]:
        """Return `Pieces.whiteners` of the motions."""

    def turns(self, wrongs: Array) -> tuple[Array, Array, Array] | None:
        """Return what a gyroscope says besides; None without one.

        Its turns, shape (k,), their derivatives, shape (k, count), their deviations, (k,).
        """


Prior = tuple[int, float, float]
"""Index of a value, what it is believed to be, and the standard deviation of that."""


@dataclass(frozen=True)
class Problem:
    """Everything measured, as residuals over the values of a layout."""

    layout: Layout
    ranges: TagRanges
    motions: Motions
    links: Links | None = None
    priors: Sequence[Prior] = ()

    def rows(self, values: Array) -> Rows:
        """Return residuals and Jacobian at values, shape (layout.size,)."""
        parts = [_ranges(self.layout, self.ranges, values)]
        parts += _motions(self.layout, self.motions, values)
        if self.links is not None and len(self.links.range_m):
            parts.append(_links(self.layout, self.links, values))
        first = self.layout.first_motion
        believed = [(first + i, 0.0, float(s)) for i, s in enumerate(self.motions.priors)]
        parts.append(_priors([*self.priors, *believed], values))
        total = sum(len(part.residual) for part in parts)
        row, column, data = [], [], []
        begin = 0
        for part in parts:
            row.append(part.row + begin)
            column.append(part.column)
            data.append(part.data)
            begin += len(part.residual)
        jacobian = coo_matrix(
            (np.concatenate(data), (np.concatenate(row), np.concatenate(column))),
            shape=(total, self.layout.size),
        )
        return Rows(
            np.concatenate([part.residual for part in parts]),
            jacobian.tocsr(),
            np.concatenate([np.full(len(p.residual), p.group, dtype=np.intp) for p in parts]),
        )


@dataclass(frozen=True)
class _Part:
    residual: Array
    row: Indices
    column: Indices
    data: Array
    group: int

    @classmethod
    def of(
        cls, residual: Array, columns: Sequence[Indices], data: Sequence[Array], group: int
    ) -> _Part:
        """Return the part of residuals that each depend on equally many values."""
        rows = np.arange(len(residual))
        return cls(
            residual,
            np.concatenate([rows] * len(columns)),
            np.concatenate([np.broadcast_to(c, rows.shape) for c in columns]),
            np.concatenate(list(data)),
            group,
        )


def _ranges(layout: Layout, ranges: TagRanges, values: Array) -> _Part:
    knots, anchors = layout.poses(values)[ranges.knot], layout.places(values)[ranges.anchor]
    lever = rotated(ranges.lever[:, :2], knots[:, 2])
    tag = np.column_stack([knots[:, :2] + lever, ranges.lever[:, 2]])
    apart = tag - anchors[:, :3]
    distance = np.maximum(np.linalg.norm(apart, axis=1), 1e-6)
    scale = 1.0 + anchors[:, 4]
    weight = 1.0 / ranges.std_m
    residual = (scale * distance + anchors[:, 3] - ranges.range_m) * weight
    slope = (scale * weight / distance)[:, None] * apart
    at_knot, at_anchor = layout.knot(ranges.knot), layout.anchor(ranges.anchor)
    by_heading = slope[:, 1] * lever[:, 0] - slope[:, 0] * lever[:, 1]
    columns = [at_knot, at_knot + 1, at_knot + 2, *(at_anchor + i for i in range(PER_ANCHOR))]
    data = [slope[:, 0], slope[:, 1], by_heading, -slope[:, 0], -slope[:, 1], -slope[:, 2]]
    data += [weight, weight * distance]
    return _Part.of(residual, columns, data, RANGES)


def _motions(layout: Layout, motions: Motions, values: Array) -> list[_Part]:
    poses, wrongs = layout.poses(values), layout.wrongs(values)
    if len(poses) < 2:
        return []
    told, by_wrongs = motions.told(wrongs)
    before, step = poses[:-1], np.diff(poses, axis=0)
    moved = rotated(step[:, :2], -before[:, 2])
    error = np.column_stack([moved, step[:, 2]]) - told
    cos, sin = np.cos(before[:, 2]), np.sin(before[:, 2])
    count = len(before)
    # Derivatives of the error by both knots and by what is read wrong.
    slope = np.zeros((count, 3, 6 + motions.count))
    slope[:, 0, 3], slope[:, 0, 4] = cos, sin
    slope[:, 1, 3], slope[:, 1, 4] = -sin, cos
    slope[:, 2, 5] = 1.0
    slope[:, :, :3] = -slope[:, :, 3:6]
    slope[:, :2, 2] = moved @ _FROM_HEADING.T
    slope[:, :, 6:] = -by_wrongs
    at = layout.knot(np.arange(count))
    columns = [at, at + 1, at + 2, at + 3, at + 4, at + 5]
    columns += [np.full(count, layout.first_motion + i) for i in range(motions.count)]
    parts = []
    for white, group in zip(motions.whiteners(), (ALONG, TURN, ACROSS), strict=True):
        residual = np.einsum('ki,ki->k', white, error)
        by = np.einsum('ki,kij->kj', white, slope)
        parts.append(_Part.of(residual, columns, list(by.T), group))
    gyro = motions.turns(wrongs)
    if gyro is not None:
        turns, by_gyro, std = gyro
        residual = (step[:, 2] - turns) / std
        ones = np.ones(count) / std
        data = [-ones, ones, *(-by_gyro / std[:, None]).T]
        parts.append(_Part.of(residual, [at + 2, at + 5, *columns[6:]], data, GYRO))
    return parts


def _links(layout: Layout, links: Links, values: Array) -> _Part:
    places = layout.places(values)
    apart = places[links.first, :3] - places[links.second, :3]
    distance = np.maximum(np.linalg.norm(apart, axis=1), 1e-6)
    slope = apart / (distance * links.std_m)[:, None]
    first, second = layout.anchor(links.first), layout.anchor(links.second)
    columns = [first, first + 1, first + 2, second, second + 1, second + 2]
    data = [*slope.T, *(-slope.T)]
    return _Part.of((distance - links.range_m) / links.std_m, columns, data, LINKS)


def _priors(priors: Sequence[Prior], values: Array) -> _Part:
    index = np.array([item[0] for item in priors], dtype=np.intp)
    believed = np.array([item[1] for item in priors], dtype=float)
    std = np.array([item[2] for item in priors], dtype=float)
    return _Part.of((values[index] - believed) / std, [index], [1.0 / std], PRIOR)
