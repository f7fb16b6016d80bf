"""Stops measured in the simulator against the formula."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.control import SafetyConfig, stopping_distance
from tablerunner.experiments import stopping
from tablerunner.experiments.guarded_drive import GuardedDrive
from tablerunner.experiments.stopping import (
    FAULT_M_S,
    SILENCES,
    Stop,
    at_walker,
    at_wall,
    emergency,
    run_stopping,
    silence,
)


@pytest.mark.parametrize('speed', stopping.SPEEDS_M_S)
def test_emergency_stop_takes_no_more_than_computed(speed: float) -> None:
    """And not much less than half: a base that stood at once would prove nothing."""
    config = SafetyConfig()
    for seed in range(3):
        stop = emergency(seed, speed)
        computed = stopping_distance(speed, config.delay, config.deceleration)
        assert stop.computed_m == pytest.approx(computed)
        assert 0.25 * computed < stop.way_m <= computed


@pytest.mark.parametrize('what', SILENCES)
def test_silence_stops_within_the_time_out_and_the_stopping_distance(what: str) -> None:
    for seed in range(3):
        stop = silence(seed, what)
        assert 0.5 * 0.4 < stop.way_m <= stop.computed_m
        assert stop.computed_m == pytest.approx(0.6 * 0.5 + 0.405)


@pytest.mark.parametrize('degrees', [0, 30, 60])
def test_robot_at_a_wall_could_always_stop_as_computed(degrees: int) -> None:
    for seed in range(3):
        stop = at_wall(seed, degrees, 0.6)
        assert stop.way_m <= stop.computed_m
        assert stop.needed <= 1.0
        assert stop.gap_m > 0.0


@pytest.mark.parametrize('side', stopping.SIDES_DEG)
@pytest.mark.parametrize('pace', [0.4, 1.0])
def test_walker_on_collision_course_is_not_hit(side: int, pace: float) -> None:
    """From every side, however fast, never giving way: he finds the robot all but standing.

    Seed 12: one who comes from 25 degrees so slowly that he may pass for a slanted wall.
    """
    for seed in (0, 1, 12):
        assert at_walker(seed, side, pace).touch_m_s <= FAULT_M_S


@pytest.mark.parametrize('pace', stopping.WALKERS_M_S)
def test_collision_course_is_seen_at_a_constant_angle(pace: float) -> None:
    """The robot drives along x at 0.6 m/s; the line of sight keeps its direction."""
    side = math.radians(25.0)
    course = stopping._collision_course(0.6, pace, side)
    assert np.hypot(*course) == pytest.approx(pace)
    closing = np.array([0.6, 0.0]) - course
    assert math.atan2(closing[1], closing[0]) == pytest.approx(side)


def test_robot_without_brakes_misses_the_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the test is for: a safety stop that lets everything pass is found out."""
    monkeypatch.setattr(
        GuardedDrive, '_send', lambda self, _: setattr(self, '_to_base', self._command)
    )
    assert emergency(0, 0.6).way_m > emergency(0, 0.6).computed_m
    assert at_walker(0, 0, 1.0).touch_m_s > 0.5
    assert at_wall(0, 0, 0.6).needed > 1.0


def test_outcome_fails_when_one_stop_of_many_was_too_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    good = [
        ('emergency stop', Stop('emergency', 0.6, 0.2, 0.405)),
        ('wall', Stop('wall', 0.1, 0.02, 0.03, 0.15, 0.0, 0.8)),
        ('walker', Stop('walker', 0.4, 0.3, 0.5, 0.2, 0.0)),
    ]
    worse = (
        (0, {'way_m': 0.41}),
        (1, {'way_m': 0.04}),
        (1, {'needed': 1.1}),
        (1, {'gap_m': -0.01}),
        (2, {'way_m': 0.6}),
        (2, {'touch_m_s': 0.06}),
    )
    none = (0, 0)
    monkeypatch.setattr(stopping, 'run_seeds', lambda *_: [(good, none), (good, none)])
    assert run_stopping(range(2), lambda done, count: None).holds
    monkeypatch.setattr(stopping, 'run_seeds', lambda *_: [(good, none), (good, (1, 0))])
    assert not run_stopping(range(2), lambda done, count: None).holds
    for index, changes in worse:
        bad = list(good)
        bad[index] = (good[index][0], replace(good[index][1], **changes))
        monkeypatch.setattr(stopping, 'run_seeds', lambda *_, bad=bad: [(good, none), (bad, none)])
        assert not run_stopping(range(2), lambda done, count: None).holds, changes
