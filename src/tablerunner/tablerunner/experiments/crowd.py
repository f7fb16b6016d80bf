"""A robot at full speed in a small hall with six people: how often does it hit one of them?"""

from __future__ import annotations

import numpy as np

from tablerunner.experiments.guarded_drive import GuardedDrive
from tablerunner.scenario import Person, Scenario, Wall
from tablerunner.types import Velocity, nanoseconds

TURNS_RAD_S = (0.0, 0.3, -0.3, 1.0, 0.0, -1.0)
"""The controller is out of its mind: 5 m/s, and each of these for 3 s."""

CROWD_S = 25.0
_PEOPLE = 6
_ALL_OUT_M_S = 5.0
_TURN_NS = nanoseconds(3.0)


def crowd_hall(seed: int, yield_probability: float) -> Scenario:
    """Return a bare hall of 10 m x 8 m in which six people walk there and back."""
    random = np.random.default_rng(seed)
    people = tuple(
        Person(
            name=f'person {number}',
            route=tuple(
                (float(random.uniform(0.6, 9.4)), float(random.uniform(0.6, 7.4)))
                for _ in range(3)
            ),
            speed=float(random.uniform(0.4, 1.2)),
            yield_probability=yield_probability,
            start_share=float(random.uniform(0.0, 1.0)),
        )
        for number in range(_PEOPLE)
    )
    corners = ((0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0))
    return Scenario(
        name='hall',
        walls=(Wall(name='wall', closed=True, points=corners),),
        people=people,
        start=(5.0, 4.0, float(random.uniform(-3.1, 3.1))),
    )


def all_out(now: int, seed: int) -> Velocity:
    """Return what a controller out of its mind commands at a time [ns]."""
    return Velocity(_ALL_OUT_M_S, TURNS_RAD_S[(now // _TURN_NS + seed) % len(TURNS_RAD_S)])


def hits_in_crowd(seed: int, yield_probability: float) -> int:
    """Return how many people the robot hits in 25 s; who runs into it is not counted."""
    drive = GuardedDrive(crowd_hall(seed, yield_probability), seed)
    for number in range(round(CROWD_S * 100)):
        drive.step(all_out(drive.now, seed) if number % 5 == 4 else None)
    return len(drive.faults)
