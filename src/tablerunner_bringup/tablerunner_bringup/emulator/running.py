"""Runs an emulated robot until it is told to end."""

from __future__ import annotations

import contextlib
import math
import time
from dataclasses import dataclass
from pathlib import Path

from tablerunner.cli.console import Progress
from tablerunner.scenario import Scenario, load_scenario
from tablerunner_bringup.emulator.dwm1001 import Dwm1001
from tablerunner_bringup.emulator.robot import EmulatedRobot, Told, address_of
from tablerunner_bringup.emulator.wire import Wire
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.polling import bare_node

_PERIOD_S = 0.01


@dataclass(frozen=True)
class EmulationOptions:
    """What to emulate, and until when; without a port the ranges are on a topic."""

    scenario: Path
    seed: int = 1
    port: Path | None = None
    twist_stamped: bool = False
    namespace: str = ''
    domain: int | None = None
    duration_s: float = math.inf


def run(options: EmulationOptions, progress: Progress) -> Told:
    """Emulate until SIGINT, SIGTERM or the given duration; return what happened.

    Raises
    ------
    ConfigError
        The scenario cannot be used, or the port cannot be made.
    """
    scenario = load_scenario(options.scenario)
    with contextlib.ExitStack() as stack:
        interrupts = stack.enter_context(Interrupts())
        wire = stack.enter_context(Wire(options.port)) if options.port is not None else None
        node = stack.enter_context(bare_node('base', options.domain, options.namespace))
        stack.enter_context(progress)
        module = None if wire is None else Dwm1001(_places(scenario))
        robot = EmulatedRobot(node, scenario, options.seed, options.twist_stamped, module)
        progress.say(f'a robot in {scenario.name}; Ctrl-C ends it')
        if wire is not None:
            ids = ', '.join(_places(scenario))
            progress.say(f'its DWM1001 is at {wire.path}, the anchors are {ids}')
        begun = time.monotonic()
        while not interrupts.asked and time.monotonic() - begun < options.duration_s:
            robot.advance()
            if wire is not None and module is not None:
                now = time.monotonic()
                wire.write(module.hear(wire.read(), now) + module.tick(now))
            progress.show(_situation(robot))
            time.sleep(_PERIOD_S)
        return robot.told


def _places(scenario: Scenario) -> dict[str, tuple[float, float, float]]:
    return {
        address_of(anchor.id, index): anchor.position
        for index, anchor in enumerate(scenario.anchors)
    }


def _situation(robot: EmulatedRobot) -> str:
    truth = robot.truth
    pose = truth.pose
    lost_s = robot.told.lost_s
    lost = f', {lost_s:.1f} s lost' if lost_s else ''
    return (
        f'really at {pose.x:5.2f} {pose.y:5.2f} m {math.degrees(pose.heading):4.0f} deg, '
        f'{truth.linear_m_s:4.2f} m/s, {robot.told.commands} commands{lost}'
    )
