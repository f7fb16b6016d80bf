"""ROS parameters from the core's configuration dataclasses.

Default, unit, bounds and description of every parameter stand once, in a `Config` of the core;
here they become declared ROS parameters and back. What rclpy does, and what follows from it:

- A YAML ``1`` is an integer, and rclpy refuses it for a double. Here whole numbers are accepted
  wherever a number is expected, at start and at run time, and stored as doubles: no value is lost
  that way below 2**53. Nothing else is converted.
- An empty list in YAML arrives as "not set", and an empty Python list would be declared as bytes;
  both are put right, so that an empty list is an empty list of the field's own type.
- Ranges in descriptors are checked by rclpy only for scalars, inclusively and with a tolerance.
  They are given for the sake of tools; the `Config` is what decides.
- Declaring fires the callbacks, and each pre-set callback that is registered returns the whole
  list once more: so one set of callbacks per node, registered after the first declaration.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from tablerunner.config import Config, Document, Parameter, build, parameters_of
from tablerunner.errors import ConfigError

C = TypeVar('C', bound=Config)
Type = RosParameter.Type

_SCALARS = {float: Type.DOUBLE, int: Type.INTEGER, bool: Type.BOOL, str: Type.STRING}
_ARRAYS = {
    float: Type.DOUBLE_ARRAY,
    int: Type.INTEGER_ARRAY,
    bool: Type.BOOL_ARRAY,
    str: Type.STRING_ARRAY,
}
_WHOLE_FOR_REAL = {Type.DOUBLE: Type.INTEGER, Type.DOUBLE_ARRAY: Type.INTEGER_ARRAY}
_INT64_LOW, _INT64_HIGH = -(2**63), 2**63 - 1


class Field(NamedTuple):
    """One ROS parameter that comes from a field of a Config, nested Configs included."""

    name: str  # dotted, without the prefix that a node may add
    type_: RosParameter.Type
    info: Parameter


def fields_of(cls: type[Config], path: str = '') -> list[Field]:
    """Return the ROS parameters of a Config class in order of declaration, nested ones dotted.

    Raises
    ------
    TypeError
        A field has a type that no ROS parameter can hold: a mistake in the program.
    """
    fields: list[Field] = []
    for name, (kind, info) in parameters_of(cls).items():
        full = f'{path}.{name}' if path else name
        if type(None) in typing.get_args(kind):
            kind = next(item for item in typing.get_args(kind) if item is not type(None))
        if isinstance(kind, type) and issubclass(kind, Config):
            fields.extend(fields_of(kind, full))
            continue
        if isinstance(kind, type) and issubclass(kind, Enum):
            type_ = Type.STRING
        elif typing.get_origin(kind) is tuple:
            type_ = _ARRAYS.get(typing.get_args(kind)[0], Type.NOT_SET)
        else:
            type_ = _SCALARS.get(kind, Type.NOT_SET)
        if type_ == Type.NOT_SET:
            raise TypeError(f'{cls.__name__}.{name}: no ROS parameter can hold {kind}')
        fields.append(Field(full, type_, info))
    return fields


def declare_config(
    node: Node, cls: type[C], prefix: str = '', on_change: Callable[[C], None] | None = None
) -> C:
    """Declare every field of a Config as a ROS parameter and return the Config of this node.

    Parameters
    ----------
    node : rclpy.node.Node
        The overrides given to it (command line, parameter files) are read.
    cls : type
        The Config class. Nested Configs become dotted names.
    prefix : str
        Dotted prefix of the names; needed where two Configs of a node share a field's name.
    on_change : callable or None
        Called with the new Config after a parameter was changed at run time. Fields marked
        ``dynamic`` are then open to change; all others, and without it all, are read-only.

    Raises
    ------
    ConfigError
        A value is missing, of the wrong type or out of bounds; it names node, parameter, value
        and what would have been accepted.
    """
    overrides = _overrides(node)
    fields = fields_of(cls)
    group = _Group(cls, prefix, on_change, {field.name: field.type_ for field in fields})
    for field in fields:
        override = overrides.get(group.full(field.name))
        if override is not None:
            group.values[field.name] = _plain(override, field.type_)
    source = f'parameters of {node.get_fully_qualified_name()}'
    config = group.build({}, source)
    for field in fields:
        value = _value_in(config, field.name)
        group.values[field.name] = value
        descriptor = _descriptor(field, on_change is not None)
        _declare(node, group.full(field.name), field.type_, value, descriptor)
    _callbacks_of(node).groups.append(group)
    return typing.cast('C', config)


def undeclared_overrides(node: Node) -> list[str]:
    """Return the names of parameters that were given to the node but that it does not have."""
    return sorted(name for name in _overrides(node) if not node.has_parameter(name))


def warn_undeclared(node: Node) -> None:
    """Log a warning for each parameter that was given and is not known: mostly a typing slip."""
    for name in undeclared_overrides(node):
        node.get_logger().warning(f'parameter {name} is not known to this node: ignored')


def _overrides(node: Node) -> dict[str, RosParameter]:
    # rclpy has no public way to list overrides that were not declared; test_parameters.py fails
    # should this attribute ever go.
    return node._parameter_overrides  # noqa: SLF001


class _Group:
    """One declared Config of a node: its class, its present values, and whom to tell."""

    def __init__(
        self,
        cls: type[Config],
        prefix: str,
        on_change: Callable[[Any], None] | None,
        types: dict[str, RosParameter.Type],
    ) -> None:
        self.cls = cls
        self.prefix = prefix
        self.on_change = on_change
        self.types = types  # by dotted name without the prefix
        self.values: dict[str, Any] = {}

    def full(self, name: str) -> str:
        return f'{self.prefix}.{name}' if self.prefix else name

    def build(self, changes: dict[str, Any], source: str = '') -> Config:
        data: dict[str, Any] = {}
        for name, value in {**self.values, **changes}.items():
            *parents, last = name.split('.')
            place = data
            for parent in parents:
                place = place.setdefault(parent, {})
            place[last] = value
        try:
            return build(self.cls, Document(data))
        except ConfigError as error:
            raise error.located(source, prefix=self.prefix) from None

    def changes(self, parameters: list[RosParameter]) -> dict[str, Any]:
        given = {item.name: item for item in parameters}
        return {
            name: _plain(given[self.full(name)], type_)
            for name, type_ in self.types.items()
            if self.full(name) in given
        }


class _Callbacks:
    """What rclpy calls when parameters of a node are set; keeps the declared groups."""

    def __init__(self, node: Node) -> None:
        self.groups: list[_Group] = []
        node.add_pre_set_parameters_callback(self.before)
        node.add_on_set_parameters_callback(self.judge)
        node.add_post_set_parameters_callback(self.apply)

    def before(self, parameters: list[RosParameter]) -> list[RosParameter]:
        """Turn whole numbers into doubles where the field is one."""
        types = {
            group.full(name): type_ for group in self.groups for name, type_ in group.types.items()
        }
        return [_as_real(item, types.get(item.name)) for item in parameters]

    def judge(self, parameters: list[RosParameter]) -> SetParametersResult:
        """Build a trial Config of each group that is concerned; give the reason if it fails."""
        for group in self.groups:
            changes = group.changes(parameters)
            if not changes:
                continue
            try:
                group.build(changes)
            except ConfigError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply(self, parameters: list[RosParameter]) -> None:
        """Hand the new Config on, now that the change has been made."""
        for group in self.groups:
            changes = group.changes(parameters)
            if not changes:
                continue
            config = group.build(changes)
            group.values.update(changes)
            if group.on_change is not None:
                group.on_change(config)


_HELD_AS = '_tablerunner_parameter_callbacks'


def _callbacks_of(node: Node) -> _Callbacks:
    # Held by the node: a table here, even one with weak keys, would hold the node through the
    # groups' `on_change` for as long as the process lives, and its DDS participant with it.
    callbacks = vars(node).get(_HELD_AS)
    if not isinstance(callbacks, _Callbacks):
        callbacks = vars(node)[_HELD_AS] = _Callbacks(node)
    return callbacks


def _plain(item: RosParameter, type_: RosParameter.Type) -> Any:
    array = type_ in _ARRAYS.values()
    if array and (item.type_ == Type.NOT_SET or item.type_ == Type.BYTE_ARRAY):
        return []  # what rcl and rclpy make of an empty list
    value = item.value
    return value if value is None or isinstance(value, (str, bool, int, float)) else list(value)


def _as_real(item: RosParameter, type_: RosParameter.Type | None) -> RosParameter:
    if type_ is None or _WHOLE_FOR_REAL.get(type_) != item.type_:
        return item
    if type_ == Type.DOUBLE:
        return RosParameter(item.name, type_, float(item.value))
    return RosParameter(item.name, type_, [float(number) for number in item.value])


def _value_in(config: Config, name: str) -> Any:
    value: Any = config
    for part in name.split('.'):
        value = getattr(value, part)
    return value


def _declare(
    node: Node,
    name: str,
    type_: RosParameter.Type,
    value: Any,
    descriptor: ParameterDescriptor,
) -> None:
    if isinstance(value, Enum):
        value = value.value
    elif type_ == Type.DOUBLE and value is not None:
        value = float(value)
    elif type_ == Type.DOUBLE_ARRAY and value is not None:
        value = [float(number) for number in value]
    elif isinstance(value, tuple):
        value = list(value)
    if value is None:
        node.declare_parameter(name, type_, descriptor, ignore_override=True)
    elif value != []:
        node.declare_parameter(name, value, descriptor, ignore_override=True)
    else:
        # The type of an empty list cannot be told from it: declare it bare, set it, describe it.
        node.declare_parameter(name, type_, ParameterDescriptor(), ignore_override=True)
        node.set_parameters([RosParameter(name, type_, value)])
        descriptor.type = type_.value
        node.set_descriptor(name, descriptor)


def _descriptor(field: Field, changeable: bool) -> ParameterDescriptor:
    info = field.info
    description = f'{info.description} [{info.unit}]' if info.unit else info.description
    descriptor = ParameterDescriptor(
        name=field.name,
        description=description,
        read_only=not (changeable and info.dynamic),
        additional_constraints=info.expected('').strip(),
    )
    low = info.above if info.low is None else info.low
    if low is None and info.high is None:
        return descriptor
    if field.type_ == Type.DOUBLE:
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=-math.inf if low is None else float(low),
                to_value=math.inf if info.high is None else float(info.high),
            )
        ]
    elif field.type_ == Type.INTEGER:
        descriptor.integer_range = [
            IntegerRange(
                from_value=_INT64_LOW if low is None else math.ceil(low),
                to_value=_INT64_HIGH if info.high is None else math.floor(info.high),
            )
        ]
    return descriptor
