"""Rooms and robots for the tests of the simulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import (
    AnchorPlace,
    DriveLimits,
    Person,
    RobotGeometry,
    Scenario,
    SensorErrors,
    Wall,
    WheelErrors,
)
from tablerunner.simulation.drive import Drive

HULL = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))


@pytest.fixture
def make_scenario() -> Callable[..., Scenario]:
    """Return a maker of rooms of 10 m x 10 m with four anchors and sensors without errors."""

    def make(**changes: Any) -> Scenario:
        sensors = SensorErrors().ideal()
        sensors = sensors.replace(
            **{
                name: getattr(sensors, name).replace(**values)
                for name, values in changes.pop('errors', {}).items()
            }
        )
        values: dict[str, Any] = {
            'name': 'room',
            'walls': (Wall(points=HULL, closed=True, name='hull'),),
            'anchors': tuple(
                AnchorPlace(id=f'A{index}', position=(x, y, 2.25))
                for index, (x, y) in enumerate(HULL)
            ),
            'start': (5.0, 5.0, 0.0),
            'sensors': sensors,
        }
        return Scenario(**{**values, **changes})

    return make


@pytest.fixture
def make_drive() -> Callable[..., Drive]:
    """Return a maker of bases that follow commands at once, but for what is given."""

    def make(seed: int = 0, limits: DriveLimits | None = None, **errors: float) -> Drive:
        quick = DriveLimits(
            speed=100.0,
            reverse_speed=100.0,
            turn_rate=100.0,
            acceleration=1e6,
            deceleration=1e6,
            turn_acceleration=1e6,
        )
        wheels = SensorErrors().ideal().wheels.replace(**{'motor_lag': 0.0, **errors})
        robot = RobotGeometry(limits=limits or quick)
        return Drive(robot, wheels, Pose2(), np.random.default_rng(seed))

    return make


@pytest.fixture
def still_drive() -> Drive:
    """Return a base that stands at the origin."""
    return Drive(RobotGeometry(), WheelErrors(), Pose2(), np.random.default_rng(0))


@pytest.fixture
def make_person() -> Callable[..., Person]:
    """Return a maker of people who never pause and always yield, but for what is given."""

    def make(**changes: Any) -> Person:
        values: dict[str, Any] = {
            'name': 'somebody',
            'route': ((2.0, 5.0), (8.0, 5.0)),
            'pause_probability': 0.0,
            'yield_probability': 1.0,
            'speed': 1.0,
        }
        return Person(**{**values, **changes})

    return make
