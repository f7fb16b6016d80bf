"""What a rule base's YAML file holds, as configuration records; docs/fuzzy.md shows one."""

from __future__ import annotations

from dataclasses import dataclass, fields

from tablerunner.config import Config, parameter
from tablerunner.control.fuzzy.membership import (
    LARGEST,
    LEAST_SIDE,
    Gaussian,
    Membership,
    Trapezoid,
    left_shoulder,
    right_shoulder,
    triangle,
)
from tablerunner.control.fuzzy.rule_base import CONJUNCTIONS, DEFUZZIFICATIONS
from tablerunner.errors import ConfigError

SITUATIONS = 'situations'
"""What a table's rows or columns are called when they are the named situations."""


@dataclass(frozen=True)
class SetSpec(Config):
    """The shape of one set; exactly one of the fields."""

    triangle: tuple[float, float, float] | None = parameter(
        None, description='0 at the first and last number, 1 at the middle one'
    )
    trapezoid: tuple[float, float, float, float] | None = parameter(
        None, description='0 at the first and last number, 1 between the middle two'
    )
    left_shoulder: tuple[float, float] | None = parameter(
        None, description='1 up to the first number, 0 from the second on'
    )
    right_shoulder: tuple[float, float] | None = parameter(
        None, description='0 up to the first number, 1 from the second on'
    )
    gaussian: tuple[float, float] | None = parameter(
        None, description='mean and standard deviation of a bell'
    )

    def check(self) -> None:
        """Refuse none or several shapes, and corners that do not go up."""
        given = self._given()
        if len(given) != 1:
            names = ', '.join(item.name for item in fields(self))
            raise ConfigError('', ' and '.join(given) or 'nothing', f'exactly one of {names}')
        try:
            _ = self.membership
        except ValueError as error:
            raise ConfigError(given[0], list(getattr(self, given[0])), str(error)) from None

    def _given(self) -> list[str]:
        return [item.name for item in fields(self) if getattr(self, item.name) is not None]

    @property
    def membership(self) -> Membership:
        """The set's membership function."""
        make = {
            'triangle': triangle,
            'trapezoid': Trapezoid,
            'left_shoulder': left_shoulder,
            'right_shoulder': right_shoulder,
            'gaussian': Gaussian,
        }
        name = self._given()[0]
        return make[name](*getattr(self, name))  # type: ignore[no-any-return, operator]


@dataclass(frozen=True)
class VariableSpec(Config):
    """An input or the output."""

    domain: tuple[float, float] = parameter(
        description='least and greatest value', low=-LARGEST, high=LARGEST
    )
    sets: dict[str, SetSpec] = parameter(description='the words and their sets')
    unit: str = parameter('', description='unit, for people')
    description: str = parameter('', description='what it is, for people')

    def check(self) -> None:
        """Refuse a domain that is upside down, and no sets."""
        if self.domain[1] - self.domain[0] < LEAST_SIDE:
            words = f'the smaller value first, the other larger by at least {LEAST_SIDE:g}'
            raise ConfigError('domain', list(self.domain), words)
        if not self.sets:
            raise ConfigError('sets', {}, 'at least one set')


@dataclass(frozen=True)
class TableSpec(Config):
    """Rules in rows and columns."""

    name: str = parameter(description='name of the table, for people')
    rows: str = parameter(description='the input (or `situations`) that the rows are about')
    columns: str = parameter(description='the same of the columns')
    order: tuple[str, ...] = parameter(description='sets (or situations), column by column')
    cells: dict[str, tuple[str | None, ...]] = parameter(
        description='by set (or situation) of the row: the output set of each column'
    )
    when: dict[str, str] = parameter(
        factory=dict, description='conditions of all its rules: input and set'
    )


@dataclass(frozen=True)
class RuleSpec(Config):
    """A rule by itself."""

    when: dict[str, str] = parameter(description='conditions: input and set')
    then: str = parameter(description='set of the output')


@dataclass(frozen=True)
class BaseSpec(Config):
    """A whole rule base."""

    inputs: dict[str, VariableSpec] = parameter(description='the inputs by name')
    output: dict[str, VariableSpec] = parameter(description='the one output by name')
    title: str = parameter('', description='what it decides, for people')
    source: str = parameter('', description='where it is from, for people')
    conjunction: str = parameter(
        'min', description='how conditions are joined', choices=CONJUNCTIONS
    )
    defuzzification: str = parameter(
        'weighted_average',
        description='how the output becomes a number',
        choices=DEFUZZIFICATIONS,
    )
    situations: dict[str, dict[str, str]] = parameter(
        factory=dict, description='named conjunctions: input and set, by name'
    )
    tables: tuple[TableSpec, ...] = parameter((), description='rules in tables')
    rules: tuple[RuleSpec, ...] = parameter((), description='rules by themselves')

    def check(self) -> None:
        """Refuse several outputs, and a base without inputs or rules."""
        if not self.inputs:
            raise ConfigError('inputs', {}, 'at least one input')
        if len(self.output) != 1:
            raise ConfigError('output', list(self.output), 'exactly one output by name')
        if not self.tables and not self.rules:
            raise ConfigError('rules', 'nothing', 'at least one of tables and rules')
        if SITUATIONS in self.inputs:
            raise ConfigError(f'inputs.{SITUATIONS}', SITUATIONS, 'another name for an input')
