"""Touches: who, whose fault, and that nobody passes through anybody."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Person, Scenario, Table, Wall
from tablerunner.simulation import Contact, Simulator
from tablerunner.types import Velocity

MakeScenario = Callable[..., Scenario]
MakePerson = Callable[..., Person]


def contacts_of(simulator: Simulator, command: Velocity, seconds: float) -> list[Contact]:
    samples = [sample for _ in range(round(seconds * 100)) for sample in simulator.step(command)]
    return [sample for sample in samples if isinstance(sample, Contact)]


def test_bumper_robot_at_a_wall_is_at_fault_and_held(make_scenario: MakeScenario) -> None:
    """One record for one touch, with the speed; the robot stays in the room."""
    scenario = make_scenario(
        walls=(*make_scenario().walls, Wall(points=((6, 0), (6, 10)), name='w'))
    )
    simulator = Simulator(scenario, 0)
    contacts = contacts_of(simulator, Velocity(0.5), 5.0)
    assert [(c.kind, c.name, c.robot_at_fault) for c in contacts] == [('wall', 'w', True)]
    assert contacts[0].closing_m_s == pytest.approx(0.5, abs=0.01)
    assert 5.74 < simulator.truth.pose.x <= 5.75


def test_bumper_second_touch_is_counted_anew(make_scenario: MakeScenario) -> None:
    """Backed off and driven on again: two touches."""
    scenario = make_scenario(tables=(Table(name='t', x=6.2, y=5.0, stop=(4.9, 5.0, 0.0)),))
    simulator = Simulator(scenario, 0)
    first = contacts_of(simulator, Velocity(0.3), 3.0)
    assert contacts_of(simulator, Velocity(-0.2), 2.0) == []
    second = contacts_of(simulator, Velocity(0.3), 3.0)
    assert [(c.kind, c.name) for c in first + second] == [('table', 't')] * 2


def test_bumper_robot_turning_before_a_wall_touches_nothing(make_scenario: MakeScenario) -> None:
    """The footprint is round: it may turn a millimetre away from the wall."""
    simulator = Simulator(make_scenario(), 0, start=Pose2(0.251, 5.0, 0.0))
    assert contacts_of(simulator, Velocity(0.0, 1.0), 5.0) == []


@pytest.mark.parametrize('heading', [0.0, 0.6, -0.9])
def test_bumper_robot_driving_at_a_standing_person_is_at_fault(
    make_scenario: MakeScenario, make_person: MakePerson, heading: float
) -> None:
    at = (5.0 + 1.5 * math.cos(heading), 5.0 + 1.5 * math.sin(heading))
    scenario = make_scenario(people=(make_person(route=(at,)),), start=(5.0, 5.0, heading))
    simulator = Simulator(scenario, 0)
    contacts = contacts_of(simulator, Velocity(0.5), 5.0)
    assert [(c.kind, c.robot_at_fault) for c in contacts] == [('person', True)]
    gap = math.dist(at, (simulator.truth.pose.x, simulator.truth.pose.y)) - 0.5
    assert gap == pytest.approx(0.0, abs=0.006)


def test_bumper_person_walking_into_a_standing_robot_is_not_its_fault(
    make_scenario: MakeScenario, make_person: MakePerson
) -> None:
    person = make_person(yield_probability=0.0)
    contacts = contacts_of(Simulator(make_scenario(people=(person,)), 0), Velocity(), 6.0)
    assert [(c.name, c.robot_at_fault) for c in contacts] == [('somebody', False)]
    assert contacts[0].closing_m_s == 0.0


def test_bumper_person_walking_into_the_side_of_a_driving_robot_is_not_its_fault(
    make_scenario: MakeScenario, make_person: MakePerson
) -> None:
    """The robot moves, but not towards the person."""
    person = make_person(route=((6.5, 3.0), (6.5, 8.0)), yield_probability=0.0, speed=1.2)
    simulator = Simulator(make_scenario(people=(person,), start=(6.15, 5.0, 0.0)), 0)
    contacts = contacts_of(simulator, Velocity(0.5), 3.0)
    assert [c.robot_at_fault for c in contacts] == [False]


def test_bumper_person_who_comes_again_is_counted_anew(
    make_scenario: MakeScenario, make_person: MakePerson
) -> None:
    """Turned away after waiting, and back into the robot from the end of the route: two."""
    person = make_person(yield_probability=0.0, patience=1.0)
    contacts = contacts_of(Simulator(make_scenario(people=(person,)), 0), Velocity(), 10.0)
    assert [c.name for c in contacts] == ['somebody', 'somebody']


def test_bumper_people_who_yield_are_not_touched_by_a_standing_robot(
    make_scenario: MakeScenario, make_person: MakePerson
) -> None:
    scenario = make_scenario(people=(make_person(yield_probability=1.0),))
    assert contacts_of(Simulator(scenario, 0), Velocity(), 30.0) == []
