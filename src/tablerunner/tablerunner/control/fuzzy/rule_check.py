"""What a rule base must not leave open, and must not say twice."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.config import Document
from tablerunner.control.fuzzy.rule_base import Rule
from tablerunner.control.fuzzy.variable import Variable
from tablerunner.errors import ConfigError

LEAST_DEGREE = 0.01
"""A value of a domain to which no set belongs by more than this is not covered."""

MOST_COMBINATIONS = 1_000_000
"""A rule base with more combinations of sets than this is refused: nobody can check it."""


def check_domain(variable: Variable, place: str, document: Document, covered: bool) -> None:
    """Refuse sets whose centre lies outside the domain, and values that no set covers.

    Parameters
    ----------
    variable : Variable
    place : str
        Dotted path of the variable in the document.
    document : Document
    covered : bool
        Whether every value needs a set: of inputs, not of the output.

    Raises
    ------
    ConfigError
    """
    for item in variable.sets:
        where = f'{place}.sets.{item.name}'
        centre = item.membership.centre(variable.low, variable.high)
        degree = item.membership.degrees(np.array([centre]))[0]
        if not variable.low <= centre <= variable.high or degree < 1.0 - 1e-9:
            raise _error(
                document,
                where,
                item.name,
                f'a set that is 1 somewhere within the domain, {_domain(variable)}',
            )
    value, degree = variable.barest()
    if covered and degree < LEAST_DEGREE:
        raise _error(
            document,
            f'{place}.sets',
            list(variable.words),
            f'sets that cover the domain, {_domain(variable)}: none holds {value:g}',
        )


def check_rules(
    inputs: Sequence[Variable], output: Variable, rules: Sequence[Rule], document: Document
) -> None:
    """Refuse rules that are stated twice or contradict each other, and combinations without rule.

    Two rules contradict each other when some combination of sets meets the conditions of both and
    they conclude different things.

    Raises
    ------
    ConfigError
    """
    shape = tuple(len(variable.sets) for variable in inputs)
    if math.prod(shape) > MOST_COMBINATIONS:
        words = f'at most {MOST_COMBINATIONS} combinations of sets'
        raise _error(document, 'inputs', math.prod(shape), words)
    used = {index for rule in rules for index, _ in rule.when}
    for index, variable in enumerate(inputs):
        if index not in used:
            words = 'an input that a rule has a condition on'
            raise _error(document, f'inputs.{variable.name}', variable.name, words)
    said_by = np.full(shape, -1)  # index of a rule for each combination
    seen: dict[tuple[tuple[int, int], ...], Rule] = {}
    for number, rule in enumerate(rules):
        twin = seen.setdefault(rule.when, rule)
        block = _where(rule, len(shape))
        others = np.unique(said_by[block])
        clash = next((rules[k] for k in others if k >= 0 and rules[k].then != rule.then), None)
        said = output.sets[rule.then].name
        if clash is not None:
            words = f'{output.sets[clash.then].name}, as {_named(clash, document)} says'
            raise _error(document, rule.place, said, f'no contradiction: {words}')
        if twin is not rule:
            words = f'each rule once: {_named(twin, document)} says the same'
            raise _error(document, rule.place, said, words)
        said_by[block] = number
    _check_gaps(inputs, rules, said_by, document)


def _check_gaps(
    inputs: Sequence[Variable],
    rules: Sequence[Rule],
    said_by: NDArray[np.intp],
    document: Document,
) -> None:
    gaps = np.argwhere(said_by < 0)
    if not len(gaps):
        return
    gap = [int(word) for word in gaps[0]]
    # The rule that comes nearest tells where in the file the missing one belongs.
    near = max(rules, key=lambda rule: sum(gap[index] == word for index, word in rule.when))
    place = near.place.rsplit('.cells', 1)[0] if '.cells' in near.place else 'rules'
    words = ', '.join(
        f'{variable.name} {variable.sets[word].name}'
        for variable, word in zip(inputs, gap, strict=True)
    )
    count = f' (and {len(gaps) - 1} more)' if len(gaps) > 1 else ''
    raise _error(document, place, 'no rule', f'a rule for {words}{count}')


def _where(rule: Rule, size: int) -> tuple[slice, ...]:
    """Return the block of combinations that meets a rule's conditions."""
    block = [slice(None)] * size
    for index, word in rule.when:
        block[index] = slice(word, word + 1)
    return tuple(block)


def _named(rule: Rule, document: Document) -> str:
    line = document.line(rule.place)
    return rule.name + (f' in line {line}' if line is not None else '')


def _domain(variable: Variable) -> str:
    unit = f' {variable.unit}' if variable.unit else ''
    return f'{variable.low:g} to {variable.high:g}{unit}'


def _error(document: Document, place: str, value: object, expected: str) -> ConfigError:
    return ConfigError(place, value, expected, document.source, document.line(place))
