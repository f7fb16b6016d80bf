"""Mamdani inference: from numbers through words and rules to a number, for one or many inputs.

Fuzzify, conjunction by min or product, then the weighted average of Lv (12, 14). docs/fuzzy.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tablerunner.control.fuzzy.compiled import Compiled
from tablerunner.control.fuzzy.trace import Fired, Trace, TracedInput
from tablerunner.control.fuzzy.variable import Variable
from tablerunner.errors import ConfigError
from tablerunner.types import Matrix, Vector

CONJUNCTIONS = ('min', 'product')
DEFUZZIFICATIONS = ('weighted_average', 'centroid')

_BATCH = 4096  # inputs at a time: keeps the memory of many rules small


@dataclass(frozen=True, slots=True)
class Rule:
    """If all conditions hold, then the output is a word.

    Attributes
    ----------
    when : tuple of (int, int)
        Index of an input and of its set, for each condition; at most one for each input.
    then : int
        Index of the output's set.
    name : str
        For people, e.g. ``table II, row VII, column RS``.
    place : str
        Dotted path in the file, e.g. ``tables[0].cells.VII[3]``.
    """

    when: tuple[tuple[int, int], ...]
    then: int
    name: str = ''
    place: str = ''


@dataclass(frozen=True)
class RuleBase:
    """Inputs, an output and the rules between them; `read_base` makes one from a file.

    Attributes
    ----------
    name : str
    inputs : tuple of Variable
    output : Variable
    rules : tuple of Rule
        They must leave no combination of words uncovered: `check_rules`.
    conjunction : str
        ``min`` or ``product``.
    defuzzification : str
        ``weighted_average`` (Lv 12) or ``centroid`` (of the union of the clipped sets).
    title, source : str
        What it is for and where it is from.
    """

    name: str
    inputs: tuple[Variable, ...]
    output: Variable
    rules: tuple[Rule, ...]
    conjunction: str = 'min'
    defuzzification: str = 'weighted_average'
    title: str = ''
    source: str = ''

    def __post_init__(self) -> None:
        """Refuse unknown methods."""
        if self.conjunction not in CONJUNCTIONS:
            raise ConfigError('conjunction', self.conjunction, 'one of ' + ', '.join(CONJUNCTIONS))
        if self.defuzzification not in DEFUZZIFICATIONS:
            expected = 'one of ' + ', '.join(DEFUZZIFICATIONS)
            raise ConfigError('defuzzification', self.defuzzification, expected)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in the order of the columns that `infer` takes."""
        return tuple(item.name for item in self.inputs)

    @cached_property
    def _compiled(self) -> Compiled:
        return Compiled(
            self.inputs,
            self.output,
            [rule.when for rule in self.rules],
            [rule.then for rule in self.rules],
            product=self.conjunction == 'product',
            centroid=self.defuzzification == 'centroid',
        )

    def infer(self, values: Matrix) -> Vector:
        """Return the output for each row of inputs.

        Parameters
        ----------
        values : ndarray, shape (n, inputs)
            In the order of `input_names`; beyond a domain counts as its end, infinity too.

        Returns
        -------
        ndarray, shape (n,)
            NaN for a row that holds NaN.
        """
        compiled = self._compiled
        columns = np.asarray(values, dtype=float).T
        count = columns.shape[1]
        if count <= _BATCH:
            return compiled.output(compiled.strengths(columns))
        batches = (columns[:, start : start + _BATCH] for start in range(0, count, _BATCH))
        return np.concatenate([compiled.output(compiled.strengths(part)) for part in batches])

    def infer_one(self, *values: float) -> float:
        """Return the output for one row of inputs, as `infer`."""
        compiled = self._compiled
        return float(compiled.output(compiled.strengths(np.array(values)[:, None]))[0])

    def strengths(self, values: Matrix) -> Matrix:
        """Return how strongly each rule fires, shape (n, rules), for rows as in `infer`."""
        return np.asarray(self._compiled.strengths(np.asarray(values, dtype=float).T).T)

    def trace(self, values: Mapping[str, float]) -> Trace:
        """Return the decision for one set of inputs, and why.

        Parameters
        ----------
        values : mapping of str to float
            By input name.

        Raises
        ------
        ConfigError
            An input is unknown, missing or not a number.
        """
        row = self._row(values)
        strengths = self.strengths(row[None])[0]
        output = float(self.infer(row[None])[0])
        total = float(strengths.sum())
        centres = self.output.centres()
        order = np.argsort(-strengths, kind='stable')
        fired = tuple(
            Fired(
                rule.name,
                tuple((self.inputs[i].name, self.inputs[i].sets[k].name) for i, k in rule.when),
                self.output.sets[rule.then].name,
                float(strengths[index]),
                float(strengths[index]) / total,
                float(centres[rule.then]),
            )
            for index, rule in ((int(index), self.rules[int(index)]) for index in order)
            if strengths[index] > 0.0
        )
        inputs = tuple(
            _traced(variable, float(value))
            for variable, value in zip(self.inputs, row, strict=True)
        )
        return Trace(self.name, inputs, fired, output, self.output.name, self.output.unit)

    def _row(self, values: Mapping[str, float]) -> Vector:
        names = self.input_names
        for name in values:
            if name not in names:
                raise ConfigError(name, values[name], 'an input: ' + ', '.join(names))
        for variable in self.inputs:
            value = values.get(variable.name)
            if value is None or math.isnan(value):
                unit = f' [{variable.unit}]' if variable.unit else ''
                expected = f'a number from {variable.low:g} to {variable.high:g}{unit}'
                got = 'nothing' if value is None else value
                raise ConfigError(variable.name, got, expected)
        return np.array([float(values[name]) for name in names])


def _traced(variable: Variable, value: float) -> TracedInput:
    degrees = variable.degrees(np.array([value]))[:, 0]
    words = tuple(zip(variable.words, map(float, degrees), strict=True))
    used = min(max(value, variable.low), variable.high)
    return TracedInput(variable.name, variable.unit, value, used, words)
