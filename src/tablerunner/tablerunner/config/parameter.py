"""Fields that know their unit, bounds and meaning, and the dataclass base that checks them."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

from tablerunner.errors import ConfigError

_KEY = 'tablerunner'
C = TypeVar('C', bound='Config')

_PARAMETERS: dict[type, dict[str, tuple[Any, Parameter]]] = {}  # resolving hints is slow


@dataclass(frozen=True, slots=True)
class Parameter:
    """What is known of one configuration field beside its type and default.

    Attributes
    ----------
    description : str
        One line, for people.
    unit : str
        SI unit; empty for a number without one.
    low, high : float or None
        Inclusive bounds (of each element, for a sequence).
    above : float or None
        Exclusive lower bound.
    choices : tuple of str
        The words that are accepted; empty for any.
    dynamic : bool
        Whether a running node accepts a change.
    """

    description: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    above: float | None = None
    choices: tuple[str, ...] = ()
    dynamic: bool = False

    def expected(self, kind: str) -> str:
        """Return in words what is accepted for a field of this kind."""
        words = kind
        if self.choices:
            words = 'one of ' + ', '.join(self.choices)
        bounds = []
        if self.above is not None:
            bounds.append(f'above {self.above:g}')
        if self.low is not None:
            bounds.append(f'at least {self.low:g}')
        if self.high is not None:
            bounds.append(f'at most {self.high:g}')
        if bounds:
            words += ' ' + ' and '.join(bounds)
        if self.unit:
            words += f' [{self.unit}]'
        return words


def parameter(
    default: Any = dataclasses.MISSING,
    *,
    description: str,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    choices: tuple[str, ...] = (),
    dynamic: bool = False,
    factory: Any = dataclasses.MISSING,
) -> Any:
    """Declare a field of a `Config`; without default or factory it must be given."""
    metadata = {_KEY: Parameter(description, unit, low, high, above, choices, dynamic)}
    if factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=factory, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def parameters_of(cls: type[Config]) -> dict[str, tuple[Any, Parameter]]:
    """Return name -> (type, Parameter) of a Config class, in order of declaration."""
    known = _PARAMETERS.get(cls)
    if known is None:
        hints = typing.get_type_hints(cls)
        known = {
            item.name: (hints[item.name], item.metadata.get(_KEY, Parameter('')))
            for item in dataclasses.fields(cls)
        }
        _PARAMETERS[cls] = known
    return known


@dataclass(frozen=True)
class Config:
    """Base of configuration records: every field is checked when the record is made.

    Subclasses are frozen dataclasses whose fields are declared by `parameter`; rules between
    fields go into `check`.
    """

    def __post_init__(self) -> None:
        """Check every field against its type and bounds, then the rules between them."""
        for name, (kind, info) in parameters_of(type(self)).items():
            _check(name, getattr(self, name), kind, info)
        self.check()

    def check(self) -> None:
        """Check rules between fields; raise `ConfigError`."""

    def replace(self: C, **changes: Any) -> C:
        """Return a copy with some fields changed, checked again."""
        return dataclasses.replace(self, **changes)


def _check(name: str, value: Any, kind: Any, info: Parameter) -> None:
    origin = typing.get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        if value is None:
            return
        kind = next(arg for arg in typing.get_args(kind) if arg is not type(None))
        origin = typing.get_origin(kind)
    if origin is tuple:
        for index, (item, item_kind) in enumerate(_items(name, value, kind, info)):
            _check(f'{name}[{index}]', item, item_kind, info)
        return
    if origin is dict:
        if not isinstance(value, dict):
            raise ConfigError(name, value, 'a mapping')
        for key, item in value.items():
            _check(f'{name}.{key}', item, typing.get_args(kind)[1], info)
        return
    if kind is float:
        number = isinstance(value, float) or (isinstance(value, int) and value is not True)
        if not number or isinstance(value, bool) or not math.isfinite(value):
            raise ConfigError(name, value, info.expected('a finite number'))
        _check_bounds(name, value, 'a number', info)
    elif kind is int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise ConfigError(name, value, info.expected('a whole number'))
        _check_bounds(name, value, 'a whole number', info)
    elif isinstance(kind, type) and not isinstance(value, kind):
        raise ConfigError(name, value, info.expected(_word(kind)))
    elif kind is str and info.choices and value not in info.choices:
        raise ConfigError(name, value, info.expected('a word'))


def _items(name: str, value: Any, kind: Any, info: Parameter) -> Iterator[tuple[Any, Any]]:
    arguments = typing.get_args(kind)
    if not isinstance(value, tuple):
        raise ConfigError(name, value, 'a list')
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return iter([(item, arguments[0]) for item in value])
    if len(value) != len(arguments):
        raise ConfigError(name, value, info.expected(f'{len(arguments)} values'))
    return iter(list(zip(value, arguments, strict=True)))


def _check_bounds(name: str, value: float, kind: str, info: Parameter) -> None:
    below = (info.low is not None and value < info.low) or (
        info.above is not None and value <= info.above
    )
    if below or (info.high is not None and value > info.high):
        raise ConfigError(name, value, info.expected(kind))


def _word(kind: type) -> str:
    if kind is str:
        return 'text'
    if kind is bool:
        return 'true or false'
    if issubclass(kind, Enum):
        return 'one of ' + ', '.join(str(item.value) for item in kind)
    return f'a {kind.__name__}'
