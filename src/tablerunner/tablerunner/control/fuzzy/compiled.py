"""A rule base as arrays: a handful of NumPy calls whatever the number of rules and inputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tablerunner.control.fuzzy.membership import Gaussian, Trapezoid
from tablerunner.control.fuzzy.variable import Variable
from tablerunner.types import Matrix, Vector

_GRID = 401  # points over the output's domain at which the centroid is integrated


class Compiled:
    """Arrays of a rule base; values and strengths have one column for each input vector.

    Parameters
    ----------
    inputs : sequence of Variable
    output : Variable
    conditions : sequence of sequence of (int, int)
        Input and set of each condition of each rule.
    conclusions : sequence of int
        Set of the output of each rule.
    product : bool
        Conjunction by product, not by min.
    centroid : bool
        Defuzzify by the centroid, not by the weighted average.
    """

    def __init__(
        self,
        inputs: Sequence[Variable],
        output: Variable,
        conditions: Sequence[Sequence[tuple[int, int]]],
        conclusions: Sequence[int],
        *,
        product: bool,
        centroid: bool,
    ) -> None:
        self._low = np.array([[item.low] for item in inputs])
        self._high = np.array([[item.high] for item in inputs])
        members = [item.membership for variable in inputs for item in variable.sets]
        owner = [index for index, variable in enumerate(inputs) for _ in variable.sets]
        first = np.cumsum([0, *(len(variable.sets) for variable in inputs)])
        # One more row, always 1, is the condition of a rule that leaves an input open.
        self._owner = np.array([*owner, 0])
        sides = np.zeros((len(members) + 1, 4))
        sides[-1] = 0.0, 1.0, 0.0, 1.0
        self._bells: list[tuple[int, int, Gaussian]] = []
        for row, member in enumerate(members):
            if isinstance(member, Trapezoid):
                rising, falling = member.sides()
                sides[row] = *rising, *falling
            else:
                self._bells.append((row, owner[row], member))
        self._rise, self._rise0, self._fall, self._fall0 = (sides[:, [k]] for k in range(4))
        width = max((len(rule) for rule in conditions), default=1)
        table = np.full((max(width, 1), len(conditions)), len(members))
        for column, rule in enumerate(conditions):
            for place, (variable, word) in enumerate(rule):
                table[place, column] = first[variable] + word
        self._conditions = list(table)
        self._join = np.multiply if product else np.minimum
        self._then = np.asarray(conclusions, dtype=np.intp)
        self._centres = output.centres()[self._then]
        self._area = self._moment = np.empty(0)
        self._shapes = np.empty((0, 0))
        self.output = self._weighted_average
        if centroid:
            self._prepare(output)
            self.output = self._centroid

    def degrees(self, values: Matrix) -> Matrix:
        """Return the memberships in all sets of all inputs, and a last row of 1."""
        inside = np.minimum(np.maximum(values, self._low), self._high)
        spread = inside.take(self._owner, axis=0)
        degrees = spread * self._rise
        degrees += self._rise0
        spread *= self._fall
        spread += self._fall0
        np.minimum(degrees, spread, out=degrees)
        np.minimum(degrees, 1.0, out=degrees)
        np.maximum(degrees, 0.0, out=degrees)
        for row, owner, bell in self._bells:
            degrees[row] = bell.degrees(inside[owner])
        return np.asarray(degrees)

    def strengths(self, values: Matrix) -> Matrix:
        """Return how strongly each rule fires, shape (rules, n), for values (inputs, n)."""
        degrees = self.degrees(values)
        first, *others = self._conditions
        strengths = degrees.take(first, axis=0)
        for condition in others:
            self._join(strengths, degrees.take(condition, axis=0), out=strengths)
        return strengths

    def _weighted_average(self, strengths: Matrix) -> Vector:
        """Return Lv (12) for each column: sum of strength times centre over sum of strengths."""
        return np.asarray(self._centres @ strengths / strengths.sum(axis=0))

    def _prepare(self, output: Variable) -> None:
        """Set up the integrals of the centroid, exact for straight lines between grid points."""
        grid = np.linspace(output.low, output.high, _GRID)
        step = (output.high - output.low) / (_GRID - 1)
        inner = np.ones(_GRID)
        inner[[0, -1]] = 0.5
        self._area = step * inner
        moment = np.zeros(_GRID)
        moment[:-1] += step * (2.0 * grid[:-1] + grid[1:]) / 6.0
        moment[1:] += step * (grid[:-1] + 2.0 * grid[1:]) / 6.0
        self._moment = moment
        self._shapes = output.degrees(grid)

    def _centroid(self, strengths: Matrix) -> Vector:
        """Return the centre of area of the union of the clipped output sets, for each column."""
        union = np.zeros((_GRID, strengths.shape[1]))
        for word in range(len(self._shapes)):
            rules = self._then == word
            if rules.any():
                height = strengths[rules].max(axis=0)
                np.maximum(union, np.minimum(self._shapes[word, :, None], height), out=union)
        return np.asarray((self._moment @ union) / (self._area @ union))
