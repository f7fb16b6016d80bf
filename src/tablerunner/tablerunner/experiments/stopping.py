"""How far the robot runs before it stands, measured in the simulator against what is computed.

The safety stop promises `stopping_distance`: v t + v^2 / (2 a) + u (t + v / a). Here a command of
full speed never ends, and something stops the robot: the emergency stop, silence, a wall, somebody
who walks up to it and never gives way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.control import SafetyConfig, stopping_distance
from tablerunner.experiments.crowd import hits_in_crowd
from tablerunner.experiments.experiment import Bound, Outcome, Progress, Row, Spread
from tablerunner.experiments.guarded_drive import POSE, GuardedDrive
from tablerunner.experiments.seeds import run_seeds
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Person, Scenario, Wall
from tablerunner.types import Velocity

Array = NDArray[np.float64]

SPEEDS_M_S = (0.15, 0.3, 0.45, 0.6)
ANGLES_DEG = (15, 30, 45, 60, 75)
"""Between the robot's way and the wall's normal."""

WALKERS_M_S = (0.4, 0.7, 1.0)
SIDES_DEG = (0, 25, 40, 60)
"""From where somebody walks up to the robot, seen from it: always on collision course."""

CROWDS = {'crowd that never gives way': 0.0, 'crowd of whom nine in ten do': 0.9}
MOST_HITS = 0.1
"""In each run, on average: one in ten runs."""

SILENCES = ('command', 'pose', 'ultrasonic_left')
FAULT_M_S = 0.05
"""Who is touched by a robot that moves towards him faster has been hit by it."""

_SIDE_M = 24.0
_CENTRE = (6.0, 12.0)
_UP_TO_SPEED_S = 3.0
_STANDS_M_S = 0.005
_LONGEST_S = 20.0
_MEET_S = 5.0  # from the start until robot and walker would meet
_WALKER = 'walker'


@dataclass(frozen=True)
class Stop:
    """One stop.

    Attributes
    ----------
    kind : str
        What stopped the robot.
    speed_m_s : float
        At which the reason began: as commanded; at walls and walkers the true one when the
        safety stop said zero.
    way_m : float
        What the robot drove from then until it stood; with a walker, what the gap lost. NaN where
        the robot had not to stop.
    computed_m : float
        What that may be, from that speed.
    gap_m : float
        Between the hull and what is in the way, when the robot stood; NaN for nothing.
    touch_m_s : float
        Speed of the robot towards what it touched; 0 for no touch.
    needed : float
        Largest share of the way to the wall that stopping as computed would have taken.
    """

    kind: str
    speed_m_s: float
    way_m: float
    computed_m: float
    gap_m: float = math.nan
    touch_m_s: float = 0.0
    needed: float = 0.0


def run_stopping(seeds: Sequence[int], progress: Progress) -> Outcome:
    """Measure all stops for many seeds."""
    stops: dict[str, list[Stop]] = {}
    hits: list[tuple[int, ...]] = []
    for run, counts in run_seeds(_run_seed, list(seeds), progress):
        hits.append(counts)
        for name, stop in run:
            stops.setdefault(name, []).append(stop)
    rows = [row for name, some in stops.items() for row in _rows(name, some)]
    rows += [
        Row(f'{name}, hits', '1', Spread.of(counts), bound=Bound(high=MOST_HITS))
        for name, counts in zip(CROWDS, zip(*hits, strict=True), strict=True)
    ]
    config = SafetyConfig()
    return Outcome(
        'stop-test',
        'Until the robot stands: measured in the simulator, against what is computed',
        tuple(seeds),
        tuple(rows),
        partial(draw, stops=[stop for some in stops.values() for stop in some]),
        {
            'delay [s]': config.delay,
            'deceleration [m/s^2]': config.deceleration,
            'margin [m]': config.margin,
            'time-outs [s]': config.command_timeout,
            'speeds at the wall ahead [m/s]': list(SPEEDS_M_S),
            'speeds of walkers [m/s]': list(WALKERS_M_S),
        },
        (
            'Way: asked for is what is computed, v t + v^2 / (2 a), after a silence and the way '
            'of the time-out. Of computed: the same as a share, from where the safety stop says '
            'zero until the robot stands; what a walker walks meanwhile counts in both.',
            "Walls: degrees between the robot's way and the wall's normal. Needed: the largest "
            'share of the way left to the wall that a stop as computed would have taken.',
            'Walkers come from so many degrees aside, seen from the robot, on collision course, '
            'and never give way; those too slow for that walk across. A robot that moves at more '
            f'than {FAULT_M_S} m/s towards whom it touches has hit him.',
            'Crowd: 25 s in a hall of 10 m x 8 m with six people, some of whom start or turn so '
            'near before the robot that no brakes would do.',
        ),
    )


def _run_seed(seed: int) -> tuple[list[tuple[str, Stop]], tuple[int, ...]]:
    return stops_of(seed), tuple(hits_in_crowd(seed, gives_way) for gives_way in CROWDS.values())


def _rows(name: str, stops: Sequence[Stop]) -> list[Row]:
    kind = stops[0].kind
    if kind in ('emergency', 'silence'):
        way = Spread.of([stop.way_m for stop in stops])
        bound = Bound(high=stops[0].computed_m, of='high')
        return [Row(f'{name}, way', 'm', way, bound=bound)]
    shares = [stop.way_m / stop.computed_m for stop in stops if not math.isnan(stop.way_m)]
    bound = Bound(high=1.0, of='high')
    rows = [Row(f'{name}, of computed', '1', Spread.of(shares), bound=bound)] if shares else []
    if kind == 'wall':
        needed = Spread.of([stop.needed for stop in stops])
        rows.append(Row(f'{name}, needed', '1', needed, bound=Bound(high=1.0, of='high')))
        gaps = Spread.of([stop.gap_m for stop in stops])
        rows.append(Row(f'{name}, gap left', 'm', gaps, bound=Bound(low=0.0, of='low')))
    else:
        touch = Spread.of([stop.touch_m_s for stop in stops])
        rows.append(
            Row(f'{name}, speed at touch', 'm/s', touch, bound=Bound(high=FAULT_M_S, of='high'))
        )
    return rows


def stops_of(seed: int) -> list[tuple[str, Stop]]:
    """Return every stop of one seed, each with the name under which it is counted."""
    stops = [(f'emergency stop from {v:g} m/s', emergency(seed, v)) for v in SPEEDS_M_S]
    stops += [(f'silent {what}', silence(seed, what)) for what in SILENCES]
    stops += [('wall ahead', at_wall(seed, 0, speed)) for speed in SPEEDS_M_S]
    stops += [
        (f'wall at {degrees} deg', at_wall(seed, degrees, SPEEDS_M_S[-1]))
        for degrees in ANGLES_DEG
    ]
    stops += [
        (f'walker from {side} deg', at_walker(seed, side, pace))
        for side in SIDES_DEG
        for pace in WALKERS_M_S
    ]
    return stops


def emergency(seed: int, speed_m_s: float) -> Stop:
    """Trigger the emergency stop at a speed, the way ahead being free."""
    drive = GuardedDrive(_hall(), seed, Pose2(*_CENTRE))
    drive.run(Velocity(speed_m_s, 0.0), _UP_TO_SPEED_S + 0.01 * (seed % 20))
    drive.safety.trigger()
    return _stopped(drive, 'emergency', speed_m_s, speed_m_s)


def silence(seed: int, what: str, speed_m_s: float = SPEEDS_M_S[-1]) -> Stop:
    """Let commands, poses or a sensor fall silent at a speed, the way ahead being free."""
    drive = GuardedDrive(_hall(), seed, Pose2(*_CENTRE))
    drive.run(Velocity(speed_m_s, 0.0), _UP_TO_SPEED_S + 0.01 * (seed % 20))
    drive.withheld.add(POSE if what == 'pose' else what)
    command = None if what == 'command' else speed_m_s
    return _stopped(drive, 'silence', speed_m_s, command, drive.safety.config.command_timeout)


def _stopped(
    drive: GuardedDrive,
    kind: str,
    speed_m_s: float,
    command_m_s: float | None,
    timeout_s: float = 0.0,
) -> Stop:
    """Measure the way from now until a robot at a speed stands, whatever is commanded."""
    config, begin = drive.safety.config, drive.pose
    command = None if command_m_s is None else Velocity(command_m_s, 0.0)
    for number in range(round(_LONGEST_S * 100)):
        drive.step(command if number % 5 == 0 else None)
        if abs(drive.speed_m_s) < _STANDS_M_S:
            break
    computed = stopping_distance(speed_m_s, config.delay, config.deceleration)
    return Stop(kind, speed_m_s, drive.pose.distance_to(begin), speed_m_s * timeout_s + computed)


def at_wall(seed: int, degrees: float, speed_m_s: float) -> Stop:
    """Drive at a wall at an angle between way and normal, from about 3 m away."""
    random = np.random.default_rng(seed)
    side = 1.0 if random.random() < 0.5 else -1.0
    away = 3.0 + 0.3 * float(random.random())
    heading = math.radians(degrees) * side
    start = Pose2(_SIDE_M - away * math.cos(heading), _CENTRE[1], heading)
    drive = GuardedDrive(_hall(), seed, start)
    config, radius = drive.safety.config, drive.scenario.robot.footprint_radius
    full = Velocity(speed_m_s, 0.0)
    needed = 0.0
    stop = _Watch(drive)
    for number in range(round(_LONGEST_S * 300)):
        drive.step(full if number % 5 == 0 else None)
        pose = drive.pose
        way = (_SIDE_M - pose.x - radius) / max(math.cos(pose.heading), 1e-6)
        computed = stopping_distance(max(drive.speed_m_s, 0.0), config.delay, config.deceleration)
        needed = max(needed, computed / max(way, 1e-6))
        if stop.ended(pose.x):
            break
    began_m_s, began = stop.began
    computed = stopping_distance(began_m_s, config.delay, config.deceleration)
    return Stop(
        'wall',
        began_m_s,
        (drive.pose.x - began) / math.cos(heading),
        computed,
        _SIDE_M - drive.pose.x - radius,
        stop.touch_m_s,
        needed,
    )


def at_walker(seed: int, side_deg: float, pace_m_s: float) -> Stop:
    """Drive at full speed while somebody walks up on collision course and does not give way."""
    random = np.random.default_rng(seed)
    speed = SPEEDS_M_S[-1]
    meet_x = _CENTRE[0] + speed * (_MEET_S - 0.6) + 0.2 * float(random.random())
    course = _collision_course(speed, pace_m_s, math.radians(side_deg))
    course[1] *= 1.0 if random.random() < 0.5 else -1.0
    meet = np.array([meet_x, _CENTRE[1]])
    route = tuple((float(x), float(y)) for x, y in (meet - course * _MEET_S, meet + course * 4.0))
    walker = Person(name=_WALKER, route=route, speed=pace_m_s, yield_probability=0.0, pause=0.0)
    drive = GuardedDrive(_hall((walker,)), seed, Pose2(*_CENTRE))
    config, full = drive.safety.config, Velocity(speed, 0.0)
    stop = _Watch(drive)
    for number in range(round((_MEET_S + 3.0) * 100)):
        drive.step(full if number % 5 == 0 else None)
        if stop.ended(drive.gap_to(_WALKER)) or drive.contacts:
            break
    began_m_s, began_m = stop.began
    gap = drive.gap_to(_WALKER)
    computed = stopping_distance(began_m_s, config.delay, config.deceleration, pace_m_s)
    return Stop('walker', began_m_s, began_m - gap, computed, gap, stop.touch_m_s)


def _collision_course(speed_m_s: float, pace_m_s: float, side_rad: float) -> Array:
    """Return the velocity of somebody whom a robot on the x axis sees at a constant angle.

    His velocity less the robot's points along the line of sight to the robot. Who is too slow to
    meet the robot from that angle walks across its way.
    """
    across = speed_m_s * math.sin(side_rad)
    if pace_m_s <= across:
        return np.array([0.0, -pace_m_s])
    towards = speed_m_s * math.cos(side_rad) + math.sqrt(pace_m_s**2 - across**2)
    return np.array([speed_m_s - towards * math.cos(side_rad), -towards * math.sin(side_rad)])


class _Watch:
    """Notes when the safety stop first says zero and tells when the robot stands after that."""

    def __init__(self, drive: GuardedDrive) -> None:
        self._drive = drive
        self._began: tuple[float, float] | None = None

    def ended(self, place: float) -> bool:
        """Return whether the robot stands after a stop; `place` is what is measured."""
        drive = self._drive
        drives = drive.speed_m_s > _STANDS_M_S
        if self._began is None and drives and drive.decision.velocity.linear_m_s == 0.0:
            self._began = drive.speed_m_s, place
        return self._began is not None and not drives

    @property
    def began(self) -> tuple[float, float]:
        """Speed [m/s] and place when the stop began; NaN for none."""
        return self._began or (math.nan, math.nan)

    @property
    def touch_m_s(self) -> float:
        """Largest speed of the robot towards what it touched; 0 without a touch."""
        return max((contact.closing_m_s for contact in self._drive.contacts), default=0.0)


def _hall(people: tuple[Person, ...] = ()) -> Scenario:
    corners = ((0.0, 0.0), (_SIDE_M, 0.0), (_SIDE_M, _SIDE_M), (0.0, _SIDE_M))
    return Scenario(
        name='hall', walls=(Wall(name='wall', closed=True, points=corners),), people=people
    )


_MARKS = {
    'emergency': ('o', '#0072B2'),
    'silence': ('s', '#009E73'),
    'wall': ('^', '#E69F00'),
    'walker': ('x', '#CC79A7'),
}


def draw(figure: Any, stops: Sequence[Stop]) -> None:
    """Draw measured against computed ways."""
    axes = figure.add_subplot()
    for kind, (mark, colour) in _MARKS.items():
        some = [stop for stop in stops if stop.kind == kind]
        axes.plot(
            [stop.computed_m for stop in some],
            [stop.way_m for stop in some],
            mark,
            color=colour,
            markersize=3,
            label=kind,
        )
    top = float(np.nanmax([stop.computed_m for stop in stops])) * 1.05
    axes.plot([0.0, top], [0.0, top], color='#000000', linewidth=0.8)
    axes.set_xlabel('computed [m]')
    axes.set_ylabel('measured [m]')
    axes.set_title('Way until the robot stands', loc='left')
    axes.legend(loc='upper left')
