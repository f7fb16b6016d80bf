"""When the demo counts as failed."""

from __future__ import annotations

import pytest

from tablerunner_bringup.checks import Check
from tablerunner_bringup.delivery import Outcome
from tablerunner_bringup.demo import Trip
from tablerunner_bringup.monitor import Touch

REACHED = Outcome(True, '2 of 2 stops reached', ('table_3', 'kitchen'))
MISSED = Outcome(False, 'table_3 was missed', (), (('table_3', 'blocked'),))
HIT = Touch('the robot hit guest', 'person', robot_at_fault=True)
BUMPED = Touch('the robot was touched by guest', 'person', robot_at_fault=False)


def trip(outcome: Outcome | None, *touches: Touch) -> Trip:
    """Return a trip to table_3."""
    return Trip(('table_3',), outcome, touches)


def test_trip_arrived_and_nobody_hit_is_no_failure():
    """A guest who walks into a standing robot is told, and is not the robot's failure."""
    assert trip(REACHED).failures == ()
    assert trip(REACHED, BUMPED).failures == ()
    facts = trip(REACHED, BUMPED).facts(3, ())
    assert facts['delivered'] is True
    assert facts['contacts'] == [{'what': BUMPED.words, 'robot_at_fault': False}]


@pytest.mark.parametrize(
    ('outcome', 'touches', 'words'),
    [
        (MISSED, (), 'was missed'),
        (REACHED, (HIT,), 'hit guest'),
        (None, (), 'before the robot was back'),
    ],
)
def test_trip_missed_hit_or_cut_short_is_a_failure(outcome, touches, words):
    """Each way to fail is said in words."""
    (failure,) = trip(outcome, *touches).failures
    assert words in failure


def test_facts_hold_what_each_check_was_judged_by():
    """Meals may be delivered although a check failed; both are told."""
    check = Check('emergency stop', False, 'never tried', {'speed_m_s': 0.5})
    facts = trip(REACHED).facts(1, ['emergency stop: never tried'], [check])
    assert facts['delivered'] is True
    assert facts['failures'] == ['emergency stop: never tried']
    assert facts['checks'] == {
        'emergency stop': {'passed': False, 'words': 'never tried', 'speed_m_s': 0.5}
    }
