"""Several robots in one room: in each other's way, under one camera, sharing the air."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tablerunner.scenario import (
    Camera,
    Marker,
    Member,
    Person,
    RobotGeometry,
    Scenario,
    SensorErrors,
)
from tablerunner.simulation import Contact, Simulator, Team, Truth
from tablerunner.simulation.camera import CeilingView, RobotView
from tablerunner.types import (
    ExchangeSample,
    ImuSample,
    MagneticSample,
    Refusal,
    UltrasonicSample,
    Velocity,
    WheelSample,
    seconds,
)

MakeScenario = Callable[..., Scenario]
MakePerson = Callable[..., Person]
THREE = (
    Member('one', (3.0, 5.0, 0.0)),
    Member('two', (7.0, 5.0, math.pi), (30, 190, 60)),
    Member('three', (5.0, 8.0, 0.0), (30, 90, 220)),
)


def team_of(scenario: Scenario, seed: int = 0, robots: tuple[Member, ...] = THREE) -> Team:
    return Team(scenario.replace(robots=robots), seed, robots)


def run(team: Team, seconds: float, **commands: Velocity) -> dict[str, list[Any]]:
    """Drive robots by constant commands; return the samples of each, pictures under 'images'."""
    samples: dict[str, list[Any]] = {robot.name: [] for robot in team.robots}
    samples['images'] = []
    for _ in range(round(seconds * 100)):
        step = team.step(commands)
        for name, items in step.samples.items():
            samples[name] += items
        if step.image is not None:
            samples['images'].append(step.image)
    return samples


def of(kind: type[Any], samples: list[Any]) -> list[Any]:
    return [sample for sample in samples if isinstance(sample, kind)]


def test_team_robots_obey_their_own_commands(make_scenario: MakeScenario) -> None:
    team = team_of(make_scenario())
    samples = run(team, 2.0, two=Velocity(0.3), three=Velocity(math.nan))
    last = {name: of(Truth, samples[name])[-1].pose for name in ('one', 'two', 'three')}
    assert (last['one'].x, last['one'].y) == (3.0, 5.0)
    # 0.6 m less what the acceleration of 0.6 m/s^2 (v^2 / 2a) and the motor's lag (v T) cost.
    assert last['two'].x == pytest.approx(7.0 - 0.6 + 0.075 + 0.024, abs=0.01)
    assert (last['three'].x, last['three'].y) == (5.0, 8.0)
    assert {item.reason for item in of(Refusal, samples['three'])} == {'not finite'}
    assert not of(Refusal, samples['one'] + samples['two'])


def test_team_robots_err_each_in_its_own_way(make_scenario: MakeScenario) -> None:
    """Wheels, gyroscopes, magnetometers, ranges, false echoes: nothing is a copy of another's."""
    rough = SensorErrors()
    rough = rough.replace(ultrasonic=rough.ultrasonic.replace(false_probability=0.5))
    team = team_of(make_scenario().replace(sensors=rough))
    assert len({robot.drive.left_radius_m for robot in team.robots}) == 3
    assert len({robot.radio.bias_m['A0'] for robot in team.robots}) == 3
    samples = run(team, 1.0)
    one, two = samples['one'], samples['two']
    for kind, value in (
        (WheelSample, lambda s: s.left_angle_rad),
        (ImuSample, lambda s: s.yaw_rate_rad_s),
        (MagneticSample, lambda s: s.field_z_t),
        # Nothing is in reach: what is heard are false echoes.
        (UltrasonicSample, lambda s: s.range_m if s.sensor == 'ultrasonic_front' else None),
    ):
        first, second = ([value(sample) for sample in of(kind, items)] for items in (one, two))
        assert len(first) == len(second) > 4
        assert first != second, kind


def test_team_repeats_itself(make_scenario: MakeScenario) -> None:
    rough = make_scenario().replace(sensors=Scenario('x').sensors)
    first, again, other = (run(team_of(rough, seed), 0.5, one=Velocity(0.3)) for seed in (3, 3, 4))
    assert repr(first) == repr(again)
    assert repr(first['one']) != repr(other['one'])


def test_team_of_one_named_robot_ranges_like_the_only_one(make_scenario: MakeScenario) -> None:
    """Alone in the air it has every slot: as often, and as far, as a simulator's one robot."""
    scenario = make_scenario()
    alone = run(team_of(scenario, robots=THREE[:1]), 2.0)
    simulator = Simulator(scenario.replace(start=THREE[0].start), 0)
    only = [sample for _ in range(200) for sample in simulator.step()]
    ours, theirs = of(ExchangeSample, alone['one']), of(ExchangeSample, only)
    assert [(s.stamp, s.anchor_id) for s in ours] == [(s.stamp, s.anchor_id) for s in theirs]


def test_team_tags_take_turns(make_scenario: MakeScenario) -> None:
    """No two in one slot; each anchor hears each tag a third as often, all anchors in turn."""
    samples = run(team_of(make_scenario()), 6.0)
    heard = {member.name: of(ExchangeSample, samples[member.name]) for member in THREE}
    stamps = [sample.stamp for items in heard.values() for sample in items]
    assert len(set(stamps)) == len(stamps) == 6 * 40
    for name, items in heard.items():
        assert {item.tag_id for item in items} == {name}
        assert len(items) == 80
        assert [item.anchor_id for item in items[:5]] == ['A0', 'A1', 'A2', 'A3', 'A0']


def test_team_tags_share_the_clocks_of_the_anchors(make_scenario: MakeScenario) -> None:
    """An anchor is one device, whoever asks it: its counter runs on evenly between tags.

    By a clock that walks a thousand times more than usual: three of that kind would be apart by
    1e-3 of a slot after some seconds.
    """
    errors = {'uwb': {'clock_error_ppm': 0.0, 'clock_walk_ppm': 20.0}}
    samples = run(team_of(make_scenario(errors=errors), 1), 6.0)
    heard = [
        item
        for member in THREE
        for item in of(ExchangeSample, samples[member.name])
        if item.anchor_id == 'A2'
    ]
    heard.sort(key=lambda item: item.stamp)
    steps = np.diff([item.poll_rx for item in heard]) % (1 << 40)
    elapsed = np.diff([item.stamp for item in heard]) * 1e-9 * 499.2e6 * 128
    # The rate of one clock walks by 20 ppm in a second: 49 in six, times three.
    assert np.abs(steps / elapsed - 1.0).max() < 150e-6


def test_team_ultrasonics_hear_the_other_robot(make_scenario: MakeScenario) -> None:
    """Face to face 4 m apart nothing (3 m reach); driven nearer, the other's rim."""
    team = team_of(make_scenario())
    ahead = [
        s for s in of(UltrasonicSample, run(team, 0.3)['one']) if s.sensor == 'ultrasonic_front'
    ]
    assert all(math.isinf(sample.range_m) for sample in ahead)
    run(team, 4.0, one=Velocity(0.5))
    run(team, 1.0)
    heard = of(UltrasonicSample, run(team, 0.4)['one'])
    front = [sample for sample in heard if sample.sensor == 'ultrasonic_front'][-1]
    gap = team.robot('two').drive.pose.x - team.robot('one').drive.pose.x - 0.25 - 0.22
    assert front.range_m == pytest.approx(gap, abs=0.03)


def test_team_contact_blames_who_drives(make_scenario: MakeScenario) -> None:
    """One drives at the other, which stands: both feel it, one is at fault, nobody passes."""
    team = team_of(make_scenario())
    samples = run(team, 12.0, one=Velocity(0.5))
    hits, felt = of(Contact, samples['one']), of(Contact, samples['two'])
    assert [(c.kind, c.name, c.robot_at_fault) for c in hits] == [('robot', 'two', True)]
    assert [(c.kind, c.name, c.robot_at_fault) for c in felt] == [('robot', 'one', False)]
    assert hits[0].closing_m_s == pytest.approx(0.5, abs=0.01)
    poses = [robot.drive.pose for robot in team.robots]
    assert poses[0].distance_to(poses[1]) == pytest.approx(0.5, abs=0.01)


def test_team_head_on_both_are_at_fault(make_scenario: MakeScenario) -> None:
    samples = run(team_of(make_scenario()), 6.0, one=Velocity(0.5), two=Velocity(0.5))
    for name in ('one', 'two'):
        assert [c.robot_at_fault for c in of(Contact, samples[name])] == [True]


def test_team_people_yield_to_the_robot_in_their_way(
    make_scenario: MakeScenario, make_person: MakePerson
) -> None:
    """Whichever it is: the walk along y = 5 ends before robot two, not before robot one."""
    walk = make_person(route=((6.0, 4.0), (6.0, 9.5)), patience=1e9)
    robots = (THREE[0], Member('two', (6.0, 7.0, 0.0), (30, 190, 60)))
    team = team_of(make_scenario(people=(walk,)), robots=robots)
    run(team, 8.0)
    # Free space of 0.6 m, radii of 0.25 m.
    assert team.people[0].pose.y == pytest.approx(7.0 - 0.6 - 0.5, abs=0.02)


def test_team_camera_sees_each_in_its_colour(make_scenario: MakeScenario) -> None:
    """The picture is that of a view told of three robots in these colours, pixel by pixel.

    One of them turns while the picture is exposed.
    """
    camera = Camera((5.0, 6.0, 6.0), width=160, height=120, focal=(100.0, 100.0), exposure=0.1)
    scenario = make_scenario(camera=camera, robot=RobotGeometry(marker=Marker()))
    team = team_of(scenario, 4)
    run(team, 1.0, one=Velocity(0.3, 1.4))
    truths = [robot.truth(team.now_ns) for robot in team.robots]
    (image,) = run(team, 0.1)['images']
    assert image.stamp == truths[0].stamp
    colours = (Marker().colour, (30, 190, 60), (30, 90, 220))
    views = [
        RobotView(truth.pose, 0.25, Marker(colour), truth.linear_m_s, truth.angular_rad_s)
        for truth, colour in zip(truths, colours, strict=True)
    ]
    # Noise is drawn for each picture anew: a view that has drawn as many is in step.
    seen = CeilingView(scenario, 4)
    for _ in range(9):
        seen.draw(0.0, [])
    assert np.array_equal(image.pixels, seen.draw(seconds(truths[0].stamp), views))
