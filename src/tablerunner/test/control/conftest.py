"""Rooms and closed loops for the tests of control."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from tablerunner.control import (
    FollowerConfig,
    Mission,
    MissionConfig,
    MissionStatus,
    Planner,
    PurePursuit,
    SafetyConfig,
    Situation,
    home_of,
    make_planner,
)
from tablerunner.experiments.crowd import crowd_hall
from tablerunner.experiments.guarded_drive import GuardedDrive
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario, load_scenario
from tablerunner.types import Velocity

SCENARIOS = Path(__file__).parents[3] / 'tablerunner_bringup' / 'scenarios'


class Loop(GuardedDrive):
    """A simulated robot under a safety stop, driven by whatever asks for a velocity at 20 Hz."""

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        start: Pose2 | None = None,
        position_noise_m: float = 0.0,
        safety_config: SafetyConfig | None = None,
    ) -> None:
        super().__init__(scenario, seed, start, safety_config)
        self.position_noise_m = position_noise_m
        self.top_speed = 0.0
        self.random = np.random.default_rng(seed)
        self.offset = np.zeros(3)

    def believed(self) -> Pose2:
        """Return the true pose with an error that walks slowly."""
        true = self.pose
        if self.position_noise_m:
            sigma = np.array([self.position_noise_m, self.position_noise_m, 0.03])
            # First-order Gauss-Markov, 1 s, at 20 Hz.
            self.offset = 0.95 * self.offset + 0.31 * sigma * self.random.standard_normal(3)
        return Pose2(
            true.x + self.offset[0], true.y + self.offset[1], true.heading + self.offset[2]
        )

    def drive(self, controller: Callable[[int, Pose2], Velocity | None], limit_s: float) -> bool:
        """Drive until the controller returns None; return whether it did."""
        for number in range(round(limit_s * 100)):
            command = None
            if number % 5 == 4:
                command = controller(self.now, self.believed())
                if command is None:
                    return True
            self.step(command)
            self.top_speed = max(self.top_speed, abs(self.speed_m_s))
        return False


@dataclass
class Delivery:
    """A mission in a `Loop`."""

    loop: Loop
    planner: Planner
    config: MissionConfig = field(default_factory=MissionConfig)
    statuses: list[MissionStatus] = field(default_factory=list)
    events: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        controller = PurePursuit(FollowerConfig(), self.loop.limits)
        home = home_of(self.loop.scenario)
        self.mission = Mission(self.config, self.planner, controller, home)

    def step(self, now: int, pose: Pose2) -> Velocity | None:
        """Advance the mission; None when it is over."""
        decision = self.loop.decision
        situation = Situation(
            now,
            pose,
            now,
            0.05,
            0.05,
            decision.blocked and decision.velocity.linear_m_s == 0.0,
            decision.obstacle,
        )
        velocity, status = self.mission.step(situation)
        self.statuses.append(status)
        self.events.extend(f'{now / 1e9:.1f} {event}' for event in status.events)
        return None if status.state.is_final else velocity


@pytest.fixture(scope='session')
def restaurant() -> Scenario:
    """Return the restaurant of the demo."""
    return load_scenario(SCENARIOS / 'restaurant.yaml')


@pytest.fixture(scope='session')
def restaurant_planner(restaurant: Scenario) -> Planner:
    """Return a planner of the restaurant; making its floor takes a moment."""
    return make_planner(restaurant)


@pytest.fixture
def make_loop() -> type[Loop]:
    """Return the closed loop around the simulator."""
    return Loop


@pytest.fixture
def make_delivery() -> type[Delivery]:
    """Return the closed loop around a mission."""
    return Delivery


@pytest.fixture
def hall() -> Callable[[int, float], Scenario]:
    """Return a maker of rooms of 10 m x 8 m, bare but for six people."""
    return crowd_hall
