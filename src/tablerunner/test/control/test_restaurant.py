"""Deliveries in the simulated restaurant: planner, follower, mission and safety stop together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tablerunner.control import (
    MissionState,
    Planner,
    home_of,
    table_stop,
)
from tablerunner.errors import ConfigError
from tablerunner.scenario import Scenario

TABLES = tuple(f'table_{number}' for number in range(1, 12))


def test_every_table_can_be_reached_from_every_other(
    restaurant: Scenario, restaurant_planner: Planner
) -> None:
    """No stop of the restaurant lies too near an obstacle, and ways are no great detours."""
    home = home_of(restaurant).pose
    for name, pose in restaurant.stops.items():
        path = restaurant_planner.plan(home, pose)
        assert path.length <= 1.8 * home.distance_to(pose) + 0.5, name


def test_unknown_table_names_those_there_are(restaurant: Scenario) -> None:
    with pytest.raises(ConfigError, match=r'table_99.*table_11'):
        table_stop(restaurant, 'table_99')


@pytest.mark.parametrize('number', range(len(TABLES)))
def test_meal_arrives_and_the_robot_returns_without_touching_anybody(
    number: int,
    restaurant: Scenario,
    restaurant_planner: Planner,
    make_loop: Callable[..., Any],
    make_delivery: Callable[..., Any],
) -> None:
    """Each table with a seed of its own, people walking, and an error of 5 cm on the position."""
    loop = make_loop(restaurant, 50 + number, position_noise_m=0.05)
    delivery = make_delivery(loop, restaurant_planner)
    delivery.mission.start((table_stop(restaurant, TABLES[number], 1.0),), return_home=True)
    assert loop.drive(delivery.step, 240.0), delivery.events
    status = delivery.statuses[-1]
    assert status.state is MissionState.DONE, delivery.events
    assert status.reached == (TABLES[number], 'kitchen')
    assert loop.faults == [], delivery.events
    assert loop.simulator.truth.pose.distance_to(home_of(restaurant).pose) < 0.4
