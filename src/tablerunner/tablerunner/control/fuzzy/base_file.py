"""Rule bases from YAML, checked so that an error names file, line, field and value."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path

from tablerunner.config import Document, build
from tablerunner.control.fuzzy.base_spec import SITUATIONS, BaseSpec, TableSpec, VariableSpec
from tablerunner.control.fuzzy.rule_base import Rule, RuleBase
from tablerunner.control.fuzzy.rule_check import check_domain, check_rules
from tablerunner.control.fuzzy.variable import FuzzySet, Variable
from tablerunner.errors import ConfigError

_BASES = Path(__file__).parent / 'bases'

Conditions = dict[str, str]


def base_names() -> tuple[str, ...]:
    """Return the names of the rule bases that come with the core."""
    return tuple(sorted(path.stem for path in _BASES.glob('*.yaml')))


def base_path(name: str) -> Path:
    """Return the file of a rule base that comes with the core: to read, or to copy and change.

    Raises
    ------
    ConfigError
        There is none of that name.
    """
    known = base_names()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f'did you mean {near[0]}?' if near else 'there are ' + ', '.join(known)
        raise ConfigError('', name, f'a YAML file or the name of a rule base ({hint})')
    return _BASES / f'{name}.yaml'


def load_base(name: str | Path) -> RuleBase:
    """Read a rule base that comes with the core, by name, or a user's own, by path.

    Raises
    ------
    ConfigError
        It cannot be found, read or used; with its place.
    """
    path = Path(name)
    if path.suffix in ('.yaml', '.yml') or path.is_file():
        return read_base(Document.load(path), path.stem)
    return read_base(Document.load(base_path(str(name))), str(name))


def read_base(document: Document, name: str) -> RuleBase:
    """Make a rule base of a document.

    Raises
    ------
    ConfigError
        Anything that cannot be used: unknown sets or variables, parts of a domain that no set
        covers, combinations that no rule covers, rules that contradict each other.
    """
    reader = _Reader(document, build(BaseSpec, document))
    for kind, variables in (('inputs', reader.inputs), ('output', [reader.output])):
        for variable in variables:
            check_domain(variable, f'{kind}.{variable.name}', document, kind == 'inputs')
    rules = reader.rules()
    check_rules(reader.inputs, reader.output, rules, document)
    spec = reader.spec
    return RuleBase(
        name,
        tuple(reader.inputs),
        reader.output,
        tuple(rules),
        spec.conjunction,
        spec.defuzzification,
        spec.title,
        spec.source,
    )


class _Reader:
    """Turns names into indices, and complains with their place about those it does not know."""

    def __init__(self, document: Document, spec: BaseSpec) -> None:
        self.document = document
        self.spec = spec
        self.inputs = [_variable(name, item) for name, item in spec.inputs.items()]
        ((name, item),) = spec.output.items()
        self.output = _variable(name, item)
        self._index = {item.name: index for index, item in enumerate(self.inputs)}
        for name, conditions in spec.situations.items():
            self._conditions(conditions, f'{SITUATIONS}.{name}')

    def rules(self) -> list[Rule]:
        """Return all rules, those of tables first."""
        found = [
            rule for index, table in enumerate(self.spec.tables) for rule in self._of(table, index)
        ]
        for index, item in enumerate(self.spec.rules):
            place = f'rules[{index}]'
            when = self._conditions(item.when, f'{place}.when')
            then = self._word(self.output, item.then, f'{place}.then')
            found.append(Rule(when, then, f'rule {index + 1}', place))
        return found

    def _of(self, table: TableSpec, index: int) -> Iterable[Rule]:
        here = f'tables[{index}]'
        self._conditions(table.when, f'{here}.when')
        rows = self._axis(table.rows, f'{here}.rows')
        columns = self._axis(table.columns, f'{here}.columns')
        self._check_order(table, columns, f'{here}.order')
        for row, cells in table.cells.items():
            place = f'{here}.cells.{row}'
            if row not in rows:
                raise self._error(place, row, f'a row of {table.rows}: ' + ', '.join(rows))
            if len(cells) != len(table.order):
                words = f'{len(table.order)} cells, for ' + ', '.join(table.order)
                raise self._error(place, list(cells), words)
            for number, (column, cell) in enumerate(zip(table.order, cells, strict=True)):
                spot = f'{place}[{number}]'
                if cell is None:
                    words = f'a set of {self.output.name}: a gap at {table.columns} {column}'
                    raise self._error(spot, 'nothing', words)
                when: Conditions = {}
                for part in (table.when, rows[row], columns[column]):
                    self._join(when, part, spot)
                then = self._word(self.output, cell, spot)
                name = f'{table.name}, {row}/{column}'
                yield Rule(self._conditions(when, spot), then, name, spot)

    def _axis(self, name: str, place: str) -> Mapping[str, Conditions]:
        """Return what each row or column of that name stands for."""
        if name == SITUATIONS:
            return self.spec.situations
        if name not in self._index:
            words = ', '.join([*self._index, SITUATIONS])
            raise self._error(place, name, f'an input or {SITUATIONS}: {words}')
        return {word: {name: word} for word in self.inputs[self._index[name]].words}

    def _check_order(
        self, table: TableSpec, columns: Mapping[str, Conditions], place: str
    ) -> None:
        for number, word in enumerate(table.order):
            if word not in columns:
                words = f'a column of {table.columns}: ' + ', '.join(columns)
                raise self._error(f'{place}[{number}]', word, words)
            if word in table.order[:number]:
                raise self._error(f'{place}[{number}]', word, 'each column once')

    def _join(self, when: Conditions, part: Conditions, place: str) -> None:
        for name, word in part.items():
            if when.setdefault(name, word) != word:
                words = f'one condition on {name}, not also {when[name]}'
                raise self._error(place, f'{name} {word}', words)

    def _conditions(self, when: Conditions, place: str) -> tuple[tuple[int, int], ...]:
        found = []
        for name, word in when.items():
            if name not in self._index:
                raise self._error(f'{place}.{name}', name, f'an input{_hint(name, self._index)}')
            index = self._index[name]
            found.append((index, self._word(self.inputs[index], word, f'{place}.{name}')))
        return tuple(sorted(found))

    def _word(self, variable: Variable, word: str, place: str) -> int:
        if word not in variable.words:
            words = f'a set of {variable.name}{_hint(word, variable.words)}'
            raise self._error(place, word, words)
        return variable.words.index(word)

    def _error(self, place: str, value: object, expected: str) -> ConfigError:
        line = self.document.line(place)
        return ConfigError(place, value, expected, self.document.source, line)


def _variable(name: str, spec: VariableSpec) -> Variable:
    sets = tuple(FuzzySet(word, item.membership) for word, item in spec.sets.items())
    return Variable(name, *spec.domain, sets, spec.unit, spec.description)


def _hint(name: str, known: Iterable[str]) -> str:
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1)
    return f' (did you mean {near[0]}?)' if near else ': ' + ', '.join(names)
