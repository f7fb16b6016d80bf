"""The parts of the core that nav_controller runs, put together from its parameters."""

from __future__ import annotations

from typing import NamedTuple

from nav_controller.params import NavNodeConfig
from tablerunner.control import (
    Controller,
    Mission,
    Planner,
    configure_controller,
    home_of,
    limits_within,
    make_controller,
    make_planner,
    make_surroundings,
)
from tablerunner.scenario import Scenario


class Assembly(NamedTuple):
    """A mission and what it drives with."""

    scenario: Scenario
    planner: Planner
    controller: Controller
    mission: Mission

    def configure(self, config: NavNodeConfig) -> None:
        """Use other settings from now on; a mission under way goes on."""
        limits = limits_within(config.limits, self.scenario.robot.limits)
        configure_controller(self.controller, limits, config.controllers)
        self.controller.explain(config.publish_trace)
        self.mission.configure(
            config.mission,
            self.planner.configured(config.planner),
            config.caution,
            config.blockade,
        )


def assemble(config: NavNodeConfig, scenario: Scenario) -> Assembly:
    """Return a mission in a room.

    Raises
    ------
    ConfigError
        The robot lacks a sensor that the controller needs, or settings do not fit together.
    """
    limits = limits_within(config.limits, scenario.robot.limits)
    frames = config.ultrasonic_frames
    controller = make_controller(
        config.controller, limits, scenario.robot, config.controllers, frames
    )
    controller.explain(config.publish_trace)
    planner = make_planner(scenario, config.planner)
    found = make_surroundings(scenario, planner, config.surroundings, frames)
    mission = Mission(
        config.mission,
        planner,
        controller,
        home_of(scenario),
        found,
        config.caution,
        config.blockade,
    )
    return Assembly(scenario, planner, controller, mission)
