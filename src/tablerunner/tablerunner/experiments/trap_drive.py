"""A simulated drive to a target by Lv's controller, with and without contours to follow.

Echoes and wheels are those of the simulator, with all their errors; the pose is the true one, for
localisation is not the question here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.control import VelocityLimits, limits_within, sensor_mounts
from tablerunner.control.contour import ContourConfig, ContourNavigator, Mode
from tablerunner.control.fuzzy import (
    SENSORS,
    ReactiveConfig,
    ReactiveController,
    UltrasonicRing,
)
from tablerunner.geometry.segments import distance_to_segments
from tablerunner.scenario import Scenario
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.sonar import Sonar
from tablerunner.simulation.streams import stream
from tablerunner.types import NANOSECONDS, Velocity, nanoseconds

CONTROL_SLOTS = 2
"""A control step comes after so many sensors have fired: at 16.7 Hz."""

LONGEST_S = 2400.0
"""A drive that has not ended by itself by then is endless."""


@dataclass(frozen=True, eq=False)
class TrapDrive:
    """One drive.

    Attributes
    ----------
    mode : Mode
        How it ended; `APPROACH` or `CONTOUR`: it did not.
    reason : str
        Why the target was given up.
    track : ndarray, shape (n, 2)
        base_link in map at each control step [m].
    way_m : float
        True length of the way.
    gap_m : float
        Least true gap between hull and anything; up to 0: a collision.
    time_s : float
    contours : int
        How often a contour was taken up.
    """

    mode: Mode
    reason: str
    track: NDArray[np.float64]
    way_m: float
    gap_m: float
    time_s: float
    contours: int

    @property
    def arrived(self) -> bool:
        """Whether it ended at the target."""
        return self.mode is Mode.ARRIVED


def drive_to(
    scenario: Scenario,
    target: tuple[float, float],
    seed: int,
    config: ContourConfig | None = None,
    longest_s: float = LONGEST_S,
) -> TrapDrive:
    """Drive from the scenario's start to a target in map [m].

    Parameters
    ----------
    scenario : Scenario
        People in it are not simulated.
    target : tuple of float
    seed : int
        Of the errors of wheels and echoes.
    config : ContourConfig, optional
    longest_s : float
    """
    robot, errors = scenario.robot, scenario.sensors
    base = Drive(robot, errors.wheels, scenario.start_pose, stream(seed, 'drive'))
    sonar = Sonar(scenario, stream(seed, 'sonar'))
    limits = limits_within(VelocityLimits(), robot.limits)
    mounts = sensor_mounts(robot)
    navigator = ContourNavigator(
        config or ContourConfig(),
        ReactiveController(ReactiveConfig(), limits),
        tuple(mounts[f'ultrasonic_{name}'] for name in SENSORS),
    )
    navigator.go(target)
    ring, velocity = UltrasonicRing(), Velocity()
    segments = scenario.obstacle_segments()
    now, way, contours, mode, reason = NANOSECONDS, 0.0, 0, Mode.APPROACH, ''
    track = []
    slot_s = errors.ultrasonic.slot
    control_s = CONTROL_SLOTS * slot_s
    for number in range(round(longest_s / slot_s)):
        ring.add(sonar.fire(now, base.pose, ()), now)
        if number >= len(SENSORS) and number % CONTROL_SLOTS == 0:
            track.append((base.pose.x, base.pose.y))
            step = navigator.step(ring.readings(now), base.pose, control_s)
            contours += step.mode is Mode.CONTOUR and mode is not Mode.CONTOUR
            mode, reason = step.mode, step.reason
            if mode in (Mode.ARRIVED, Mode.UNREACHABLE):
                break
            velocity = limits.approach(velocity, step.velocity, control_s)
            base.command(now, velocity)
        now += nanoseconds(slot_s)
        before = base.pose
        base.step(now, slot_s)
        way += math.hypot(base.pose.x - before.x, base.pose.y - before.y)
    places = np.array(track)
    gap = float(distance_to_segments(places, segments).min()) - robot.footprint_radius
    time_s = (now - NANOSECONDS) / NANOSECONDS
    return TrapDrive(mode, reason, places, way, gap, time_s, contours)
