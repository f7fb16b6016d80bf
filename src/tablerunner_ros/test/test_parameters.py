"""Parameters from dataclasses: what is declared, accepted, refused, and in which words."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner_ros.parameters import declare_config, fields_of, undeclared_overrides
from tablerunner_ros.testing.domain import lease_domain

Type = RosParameter.Type


class Colour(Enum):
    """Something to choose from."""

    RED = 'red'
    BLUE = 'blue'


@dataclass(frozen=True)
class Inner(Config):
    """A part of a Config."""

    gain: float = parameter(2.0, description='A gain', unit='m/s', above=0.0, dynamic=True)


@dataclass(frozen=True)
class Sample(Config):
    """One field of each kind."""

    rate: float = parameter(5.0, description='A rate', unit='Hz', low=0.0, high=10.0, dynamic=True)
    lower: float = parameter(1.0, description='Below rate', low=0.0, high=10.0, dynamic=True)
    count: int = parameter(3, description='A number', low=1, high=9)
    name: str = parameter('a', description='A word', choices=('a', 'b'))
    switch: bool = parameter(True, description='A switch')
    colour: Colour = parameter(Colour.RED, description='A colour')
    names: tuple[str, ...] = parameter((), description='Words')
    places: tuple[float, ...] = parameter((1.0, 2.0), description='Places', unit='m', low=0.0)
    triple: tuple[float, float, float] = parameter((0.0, 0.0, 1.0), description='Three')
    perhaps: float | None = parameter(None, description='May be left out')
    inner: Inner = parameter(factory=Inner, description='A part')

    def check(self) -> None:
        """Check the rule between two fields."""
        if self.lower > self.rate:
            raise ConfigError('lower', self.lower, f'at most rate ({self.rate:g})')


@dataclass(frozen=True)
class Needy(Config):
    """A Config with a field that must be given."""

    port: str = parameter(description='Where the radio is')


@pytest.fixture
def context() -> Iterator[Context]:
    item = Context()
    with lease_domain() as domain:
        rclpy.init(args=[], context=item, domain_id=domain)
        yield item
        rclpy.shutdown(context=item)


@pytest.fixture
def make(context: Context) -> Iterator[Any]:
    nodes: list[Node] = []

    def _make(node_name: str = 'node', node_namespace: str = '', **overrides: Any) -> Node:
        given = [RosParameter(key.replace('__', '.'), value=v) for key, v in overrides.items()]
        node = Node(
            node_name, context=context, namespace=node_namespace, parameter_overrides=given
        )
        nodes.append(node)
        return node

    yield _make
    for node in nodes:
        node.destroy_node()


def test_declare_config_without_overrides_returns_defaults(make: Any) -> None:
    """Every default comes from the dataclass and nowhere else."""
    node = make()
    assert declare_config(node, Sample) == Sample()
    assert node.get_parameter('rate').value == 5.0
    assert node.get_parameter('colour').value == 'red'
    assert node.get_parameter('inner.gain').value == 2.0


def test_declare_config_types_empty_lists_and_nothing_are_typed(make: Any) -> None:
    """An empty list keeps its element type, and what is not given keeps its scalar type."""
    node = make()
    declare_config(node, Sample)
    assert node.get_parameter('names').type_ == Type.STRING_ARRAY
    assert node.describe_parameter('names').type == Type.STRING_ARRAY.value
    assert node.describe_parameter('names').read_only
    assert node.describe_parameter('perhaps').type == Type.DOUBLE.value


def test_declare_config_overrides_reach_the_config(make: Any) -> None:
    """Values from files and command line replace the defaults, nested and in lists."""
    node = make(rate=7.5, name='b', colour='blue', names=['x', 'y'], inner__gain=3.0, perhaps=1.5)
    config = declare_config(node, Sample)
    assert config.rate == 7.5
    assert config.name == 'b'
    assert config.colour is Colour.BLUE
    assert config.names == ('x', 'y')
    assert config.inner.gain == 3.0
    assert config.perhaps == 1.5


def test_declare_config_whole_numbers_for_doubles_are_accepted(make: Any) -> None:
    """A YAML `1` is as good as `1.0` where a number is expected, alone and in lists."""
    node = make(rate=7, places=[1, 2, 3])
    config = declare_config(node, Sample)
    assert config.rate == 7.0
    assert isinstance(config.rate, float)
    assert config.places == (1.0, 2.0, 3.0)
    assert node.get_parameter('rate').type_ == Type.DOUBLE
    assert node.get_parameter('places').type_ == Type.DOUBLE_ARRAY


def test_declare_config_empty_list_override_is_an_empty_list(make: Any) -> None:
    """`[]` in a file is an empty list, not the default."""
    node = make()
    node._parameter_overrides['places'] = RosParameter('places', Type.NOT_SET, None)
    assert declare_config(node, Sample).places == ()


def test_declare_config_descriptor_carries_unit_range_and_read_only(make: Any) -> None:
    """Tools see unit, bounds and whether a change is allowed."""
    node = make()
    declare_config(node, Sample, on_change=lambda config: None)
    rate = node.describe_parameter('rate')
    assert rate.description == 'A rate [Hz]'
    assert (rate.floating_point_range[0].from_value, rate.floating_point_range[0].to_value) == (
        0.0,
        10.0,
    )
    assert not rate.read_only
    count = node.describe_parameter('count')
    assert (count.integer_range[0].from_value, count.integer_range[0].to_value) == (1, 9)
    assert count.read_only
    assert 'one of a, b' in node.describe_parameter('name').additional_constraints


@pytest.mark.parametrize(
    ('overrides', 'words'),
    [
        ({'rate': 'fast'}, "rate: got 'fast', expected a finite number"),
        ({'rate': True}, 'rate: got True, expected a finite number'),
        ({'rate': float('nan')}, 'rate: got nan, expected a finite number'),
        ({'rate': 11.0}, r'rate: got 11.0, expected a number at least 0 and at most 10 \[Hz\]'),
        ({'count': 2.5}, 'count: got 2.5, expected a whole number'),
        ({'count': 0}, 'count: got 0, expected a whole number at least 1'),
        ({'name': 'c'}, "name: got 'c', expected one of a, b"),
        ({'colour': 'green'}, "colour: got 'green', expected one of red, blue"),
        ({'switch': 1}, 'switch: got 1, expected true or false'),
        ({'names': [1, 2]}, r'names\[0\]: got 1, expected text'),
        ({'names': 'x'}, "names: got 'x', expected a list"),
        ({'places': [1.0, -1.0]}, r'places\[1\]: got -1.0, expected a number at least 0'),
        ({'triple': [1.0]}, 'triple: got .*, expected 3 values'),
        ({'inner__gain': 0.0}, r'inner.gain: got 0.0, expected a number above 0 \[m/s\]'),
        ({'lower': 6.0}, r'lower: got 6.0, expected at most rate \(5\)'),
    ],
)
def test_declare_config_bad_value_names_node_parameter_and_value(
    make: Any, overrides: dict[str, Any], words: str
) -> None:
    """The error says where, what was found and what would have done."""
    node = make('mine', '/robot', **overrides)
    with pytest.raises(ConfigError, match=f'parameters of /robot/mine: {words}'):
        declare_config(node, Sample)


def test_declare_config_required_parameter_missing_is_an_error(make: Any) -> None:
    """What has no default must be given; the error says what it is for."""
    with pytest.raises(ConfigError, match=r"port: got 'nothing', .*Where the radio is"):
        declare_config(make(), Needy)


def test_declare_config_prefix_stands_before_names_and_in_errors(make: Any) -> None:
    """Two Configs with equal field names live side by side under prefixes."""
    node = make(left__rate=2.0, right__rate=20.0)
    assert declare_config(node, Sample, 'left').rate == 2.0
    with pytest.raises(ConfigError, match=r'right\.rate: got 20.0'):
        declare_config(node, Sample, 'right')


def test_set_parameter_dynamic_reaches_on_change(make: Any) -> None:
    """A change at run time yields a new Config; a whole number does for a double."""
    node, seen = make(), []
    declare_config(node, Sample, on_change=seen.append)
    result = node.set_parameters([RosParameter('rate', value=7)])[0]
    assert result.successful, result.reason
    assert [config.rate for config in seen] == [7.0]
    assert node.get_parameter('rate').value == 7.0
    node.set_parameters([RosParameter('inner.gain', value=4.0)])
    assert seen[-1] == Sample(rate=7.0, inner=Inner(gain=4.0))


@pytest.mark.parametrize(
    ('name', 'value', 'words'),
    [
        ('lower', 9.0, 'lower: got 9.0, expected at most rate'),
        ('inner.gain', 0.0, 'inner.gain: got 0.0, expected a number above 0'),
        ('rate', 'x', 'Wrong parameter type'),
        ('rate', 99.0, 'out of range'),
        ('count', 4, 'read-only'),
    ],
)
def test_set_parameter_refused_gives_reason_and_changes_nothing(
    make: Any, name: str, value: Any, words: str
) -> None:
    """Nothing of a refused change remains."""
    node, seen = make(), []
    declare_config(node, Sample, on_change=seen.append)
    before = node.get_parameter(name).value
    result = node.set_parameters([RosParameter(name, value=value)])[0]
    assert not result.successful
    assert words in result.reason
    assert seen == []
    assert node.get_parameter(name).value == before


def test_set_parameters_atomically_checks_them_together(make: Any) -> None:
    """Two values that are only good together are accepted together."""
    node, seen = make(), []
    declare_config(node, Sample, on_change=seen.append)
    both = [RosParameter('rate', value=9.0), RosParameter('lower', value=8.0)]
    assert node.set_parameters_atomically(both).successful
    assert (seen[-1].rate, seen[-1].lower) == (9.0, 8.0)


def test_set_parameter_of_two_groups_reaches_only_its_own(make: Any) -> None:
    """One set of callbacks serves several Configs, and nothing is set twice."""
    node, left, right = make(), [], []
    declare_config(node, Sample, 'left', on_change=left.append)
    declare_config(node, Sample, 'right', on_change=right.append)
    assert node.set_parameters([RosParameter('left.rate', value=6.0)])[0].successful
    assert (len(left), len(right)) == (1, 0)


def test_declare_config_without_on_change_is_read_only(make: Any) -> None:
    """Without anybody to apply it no change is accepted, `dynamic` or not."""
    node = make()
    declare_config(node, Sample)
    assert node.describe_parameter('rate').read_only


def test_undeclared_overrides_are_named(make: Any) -> None:
    """A slip in a name is found; rclpy's own parameters are no slips."""
    node = make(rate=7.0, rte=8.0, use_sim_time=False)
    declare_config(node, Sample)
    assert undeclared_overrides(node) == ['rte']


def test_fields_of_unknown_type_is_a_type_error() -> None:
    """A field that no ROS parameter can hold is a mistake of the program, found at once."""

    @dataclass(frozen=True)
    class Odd(Config):
        table: dict[str, float] = parameter(factory=dict, description='A table')

    with pytest.raises(TypeError, match=r'Odd\.table'):
        fields_of(Odd)


class Changing(Node):
    """A node that listens for changes itself, as nodes do, and then cannot start."""

    def __init__(self, **options: Any) -> None:
        super().__init__('changing', **options)
        declare_config(self, Sample, on_change=self.take)
        raise ConfigError('port', '', 'a port')

    def take(self, config: Sample) -> None:
        """Do nothing with it."""


def test_node_that_could_not_start_is_let_go(context: Context) -> None:
    """Or it would speak in its domain for as long as the process lives."""
    with pytest.raises(ConfigError, match='a port'):
        Changing(context=context)
    gc.collect()
    assert not [item for item in gc.get_objects() if isinstance(item, Changing)]
