"""The records of an experiment: spread, bounds, and what is written."""

import math

import pytest

from tablerunner.errors import ConfigError
from tablerunner.experiments.experiment import Bound, Outcome, Row, Spread
from tablerunner.experiments.seeds import run_seeds


def outcome(*rows):
    return Outcome('x', 'X', (0, 1), rows, lambda figure: None, {'noise': 0.1}, ('A note.',))


def test_spread_of_known_values():
    spread = Spread.of([1.0, 2.0, 6.0])
    assert (spread.mean, spread.median, spread.low, spread.high) == (3.0, 2.0, 1.0, 6.0)
    assert spread.std == pytest.approx(math.sqrt(7.0))
    assert spread.count == 3


def test_spread_of_one_seed_has_no_deviation():
    assert Spread.of([2.0]).std == 0.0


def test_spread_of_nothing_is_refused():
    with pytest.raises(ConfigError, match='at least one'):
        Spread.of([])


@pytest.mark.parametrize(
    ('bound', 'words', 'holds'),
    [
        (Bound(high=3.0), '<= 3', True),
        (Bound(high=2.9), '<= 2.9', False),
        (Bound(high=2.0, of='median'), 'median <= 2', True),
        (Bound(low=3.1), '>= 3.1', False),
        (Bound.within(0.25, 4.0), '3 .. 5', True),
        (Bound.within(0.1, 4.0), '3.6 .. 4.4', False),
    ],
)
def test_bound_judges_the_figure_it_names(bound, words, holds):
    assert str(bound) == words
    assert bound.holds(Spread.of([1.0, 2.0, 6.0])) is holds


def test_bound_does_not_hold_for_nan():
    """A solver that finds nothing has not met its bound."""
    assert not Bound(high=1.0).holds(Spread.of([float('nan')]))


def test_outcome_one_missed_bound_is_enough():
    good = Row('good', 'm', Spread.of([1.0]), bound=Bound(high=1.0))
    bad = Row('bad', 'm', Spread.of([2.0]), bound=Bound(high=1.0))
    assert outcome(good).holds
    assert not outcome(good, bad).holds


def test_outcome_as_json_holds_what_makes_it_again():
    row = Row('a', 'm', Spread.of([1.0, 3.0]), 2.5, True, Bound(high=2.0))
    content = outcome(row).as_json()
    assert content['seeds'] == [0, 1]
    assert content['settings'] == {'noise': 0.1}
    assert content['rows'][0] | {'std': 0.0} == {
        'name': 'a',
        'unit': 'm',
        'raw': True,
        'paper': 2.5,
        'mean': 2.0,
        'std': 0.0,
        'median': 2.0,
        'min': 1.0,
        'max': 3.0,
        'bound': '<= 2',
        'holds': True,
    }


def test_outcome_row_by_name():
    row = Row('a', 'm', Spread.of([1.0]))
    assert outcome(row).row('a') is row
    with pytest.raises(KeyError):
        outcome(row).row('b')


def square(seed: int) -> int:
    return seed * seed


@pytest.mark.parametrize('workers', [1, 3])
def test_run_seeds_keeps_the_order_and_tells_how_far_it_is(workers):
    told = []
    results = run_seeds(square, [3, 1, 2], lambda done, count: told.append((done, count)), workers)
    assert results == [9, 1, 4]
    assert told == [(1, 3), (2, 3), (3, 3)]
