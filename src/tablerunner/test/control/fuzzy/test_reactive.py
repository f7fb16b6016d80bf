"""Lv's controller: the tables as printed, the mapping to a differential drive, driving."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.control import VelocityLimits
from tablerunner.control.fuzzy import ReactiveConfig, ReactiveController, Readings, load_base
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

LIMITS = VelocityLimits()
FREE = Readings((math.inf,) * 5)
ANGLES = dict(zip(('LB', 'LS', 'FR', 'RS', 'RB'), (180.0, 90.0, 0.0, -90.0, -180.0), strict=True))
DIFFERENCES = dict(zip(('LM', 'LS', 'Z', 'RS', 'RM'), (1.0, 0.5, 0.0, -0.5, -1.0), strict=True))
TURNS = {'L': 1.0, 'LS': 0.5, 'Z': 0.0, 'RS': -0.5, 'R': -1.0}
# As printed; table I numbers the situations in this order of LF, F, RF.
SITUATIONS = ('FFF', 'FFN', 'FNF', 'FNN', 'NFF', 'NFN', 'NNF', 'NNN')
TABLE_II = """\
L LS Z RS R
L LS Z Z Z
L LS L RS R
L LS L L L
Z Z Z RS R
Z Z Z Z Z
R R R RS R"""
TABLE_III = """\
L L L L L
L L L R R
L L L R R
L L R R R
R R R R R"""
TABLE_IV = """\
S M H
S M M
S M M
S M M
S M M
S M H
S M M
S S S"""


def distances(situation: str) -> tuple[float, ...]:
    """Return distances at which each sensor's word holds altogether."""
    return tuple(0.3 if word == 'N' else 2.5 for word in situation)


def cells(table: str) -> list[list[str]]:
    return [row.split() for row in table.splitlines()]


def test_corner_base_is_tables_i_to_iii() -> None:
    """Where every input is the peak of a word, one rule fires and its centre comes out."""
    base = load_base('lv_corner')
    for situation, row in zip(SITUATIONS[:7], cells(TABLE_II), strict=True):
        for angle, cell in zip(ANGLES.values(), row, strict=True):
            for difference in DIFFERENCES.values():  # of no matter before situation VIII
                turn = base.infer_one(*distances(situation), difference, angle)
                assert turn == pytest.approx(TURNS[cell], abs=1e-12), (situation, angle)
    for difference, row in zip(DIFFERENCES.values(), cells(TABLE_III), strict=True):
        for angle, cell in zip(ANGLES.values(), row, strict=True):
            turn = base.infer_one(*distances('NNN'), difference, angle)
            assert turn == pytest.approx(TURNS[cell], abs=1e-12), (difference, angle)


def test_speed_base_is_table_iv() -> None:
    base = load_base('lv_speed')
    speeds = {'S': 0.0, 'M': 0.5, 'H': 1.0}
    for situation, row in zip(SITUATIONS, cells(TABLE_IV), strict=True):
        for away, cell in zip((0.2, 1.5, 9.0), row, strict=True):
            share = base.infer_one(*distances(situation), away)
            assert share == pytest.approx(speeds[cell], abs=1e-12), (situation, away)


def test_free_robot_turns_by_the_angle_of_the_target() -> None:
    """Equally spaced sets make (12), (13) the corner model (10) with lambda_g = 1."""
    controller = ReactiveController(ReactiveConfig(), LIMITS)
    for heading in np.linspace(-3.1, 3.1, 63):
        step = controller.step(FREE, Pose2(1.0, 2.0, heading), (1.0, 7.0))
        expected = math.remainder(math.pi / 2 - heading, math.tau)
        assert step.target_angle_rad == pytest.approx(expected)
        assert step.turn_rad == pytest.approx(expected, abs=1e-9)
        assert step.target_distance_m == pytest.approx(5.0)


def test_angle_becomes_a_turn_rate_and_slows_the_robot() -> None:
    """In turn_time; the speed keeps its part in the new direction, none from 90 deg on."""
    controller = ReactiveController(ReactiveConfig(turn_time=2.0), LIMITS)
    far = (100.0, 0.0)
    straight = controller.step(FREE, Pose2(), far)
    assert straight.velocity == Velocity(pytest.approx(0.6), pytest.approx(0.0))
    for angle in (-2.0, -0.9, -0.4, 0.4, 0.9, 2.0):
        step = controller.step(FREE, Pose2(0.0, 0.0, -angle), far)
        assert step.velocity.angular_rad_s == pytest.approx(angle / 2.0)
        expected = 0.6 * max(math.cos(angle), 0.0)
        assert step.velocity.linear_m_s == pytest.approx(expected)


def test_speed_keeps_15_within_11() -> None:
    config = ReactiveConfig()
    controller = ReactiveController(config, LIMITS)
    step = controller.step(FREE, Pose2(), (1.5, 0.0))
    assert step.speed_m_s == pytest.approx((0.6 + 0.1) / 2.0)  # (15) at v = 1/2
    step = controller.step(FREE, Pose2(), (0.1, 0.0))
    assert step.speed_m_s == pytest.approx(config.target_gain * 0.1)  # (11), below min_speed
    near = Readings((math.inf, 0.25, math.inf, math.inf, math.inf))
    step = controller.step(near, Pose2(), (9.0, 0.0))
    assert step.speed_m_s == pytest.approx(config.obstacle_gain * 0.25 + config.creep_speed)
    step = controller.step(FREE, Pose2(), (0.0, 0.0))
    assert step.velocity == Velocity(0.0, 0.0)


def test_velocity_is_within_the_limits_whatever_comes() -> None:
    limits = VelocityLimits(max_speed=0.3, max_turn_rate=0.4)
    rng = np.random.default_rng(2)
    for steering in ('rules', 'model'):
        controller = ReactiveController(ReactiveConfig(steering=steering), limits)
        for _ in range(300):
            readings = Readings(
                tuple(rng.choice([0.0, 0.2, 0.7, 2.0, math.inf, math.nan], 5)),
                tuple(rng.choice([0.0, 0.1, 0.7, math.inf], 5)),
            )
            pose = Pose2(*rng.uniform(-9.0, 9.0, 3))
            step = controller.step(readings, pose, tuple(rng.uniform(-9.0, 9.0, 2)))
            assert 0.0 <= step.velocity.linear_m_s <= 0.3
            assert abs(step.velocity.angular_rad_s) <= 0.4


def test_older_readings_bound_the_speed_the_lower() -> None:
    """By (11) on what is left of the nearest one ahead; the table is no bound: it has a corridor
    (situation VI) driven faster than past a single wall.
    """
    config = ReactiveConfig()
    controller = ReactiveController(config, LIMITS)
    rng = np.random.default_rng(6)
    for _ in range(100):
        heard = tuple(rng.uniform(0.1, 3.0, 5))
        for age in (0.0, 0.1, 0.3, 0.5):
            left = max(min(heard[1:4]) - config.closing_speed * age, 0.0)
            step = controller.step(Readings(heard, (age,) * 5), Pose2(), (9.0, 0.0))
            bound = config.creep_speed + config.obstacle_gain * left
            assert 0.0 <= step.speed_m_s <= bound + 1e-12


def test_stale_reading_counts_as_an_obstacle_and_makes_it_creep() -> None:
    config = ReactiveConfig()
    controller = ReactiveController(config, LIMITS)
    for sensor, name in enumerate(('left', 'left_front', 'front', 'right_front', 'right')):
        ages = [0.0] * 5
        ages[sensor] = 0.51
        step = controller.step(Readings((math.inf,) * 5, tuple(ages)), Pose2(), (9.0, 0.0))
        assert step.stale == (name,)
        assert step.distances_m[sensor] == 0.0
        assert step.speed_m_s == config.creep_speed
        ages[sensor] = 0.49
        step = controller.step(Readings((math.inf,) * 5, tuple(ages)), Pose2(), (9.0, 0.0))
        assert step.stale == ()
        assert step.speed_m_s > 0.5


def test_what_is_beside_bends_the_way_away_but_does_not_hold_a_turn_on_the_spot() -> None:
    config = ReactiveConfig()
    controller = ReactiveController(config, LIMITS)
    touching_left = Readings((0.0, math.inf, math.inf, math.inf, math.inf))
    step = controller.step(touching_left, Pose2(), (5.0, 0.0))
    assert step.turn_rad == pytest.approx(-config.side_turn)
    step = controller.step(touching_left, Pose2(), (5.0, 5.0))  # target to the left
    assert step.turn_rad == pytest.approx(-config.side_turn)
    step = controller.step(touching_left, Pose2(), (5.0, -1.0))  # to the right: both
    assert step.turn_rad == pytest.approx(-config.side_turn - math.atan2(1.0, 5.0))
    step = controller.step(touching_left, Pose2(), (-5.0, 1.0))
    assert step.turn_rad == pytest.approx(math.atan2(1.0, -5.0))
    assert step.velocity.linear_m_s == 0.0
    both = Readings((0.2, math.inf, math.inf, math.inf, 0.2))  # midway between two walls
    assert controller.step(both, Pose2(), (5.0, 0.0)).turn_rad == pytest.approx(0.0)


def test_traces_tell_the_same_as_the_step() -> None:
    controller = ReactiveController(ReactiveConfig(side_turn=0.0, side_clearance=0.01), LIMITS)
    readings = Readings((1.0, 0.8, 1.1, 0.9, 0.7), (0.0, 0.03, 0.06, 0.09, 0.12))
    plain = controller.step(readings, Pose2(0.0, 0.0, 0.4), (4.0, 0.0))
    traced = controller.step(readings, Pose2(0.0, 0.0, 0.4), (4.0, 0.0), traced=True)
    assert plain.traces == ()
    assert replace(traced, traces=()) == plain
    corner, speed = traced.traces
    assert (corner.base, speed.base) == ('lv_corner', 'lv_speed')
    assert math.pi * corner.output == pytest.approx(plain.turn_rad)
    used = {item.name: item.given for item in corner.inputs}
    assert used['left_front'] == pytest.approx(0.8 - 0.6 * 0.03)
    assert used['side_difference'] == pytest.approx(0.8 - 0.6 * 0.03 - (0.9 - 0.6 * 0.09))
    assert used['target_angle'] == pytest.approx(-math.degrees(0.4))


def test_model_steers_in_place_of_the_rules() -> None:
    controller = ReactiveController(ReactiveConfig(steering='model'), LIMITS)
    assert controller.step(FREE, Pose2(), (1.0, 1.0)).turn_rad == pytest.approx(math.pi / 4)
    wall = Readings((math.inf, 0.6, 0.9, 0.9, math.inf))
    assert controller.step(wall, Pose2(), (5.0, 0.0)).turn_rad < -0.5


def test_unusable_bases_and_settings_are_refused() -> None:
    config = ReactiveConfig()
    with pytest.raises(ConfigError, match=r'lv_speed.inputs: .*expected left_front, front'):
        ReactiveController(config, LIMITS, corner=load_base('lv_speed'))
    with pytest.raises(ConfigError, match=r'min_speed: got 0\.1, expected at most max_speed'):
        ReactiveController(config, VelocityLimits(max_speed=0.05))
    with pytest.raises(ConfigError, match='steering'):
        ReactiveConfig(steering='guess')
    controller = ReactiveController(config, LIMITS)
    with pytest.raises(ValueError, match='finite'):
        controller.step(FREE, Pose2(math.nan, 0.0, 0.0), (1.0, 1.0))
    with pytest.raises(ValueError, match='finite'):
        controller.step(FREE, Pose2(), (1.0, math.inf))


# Driving: a round robot of 0.25 m radius, sensors on its rim, round posts in a room of 10 m.

CONE = np.linspace(-0.24, 0.24, 7)
BEARINGS = np.radians([90.0, 40.0, 0.0, -40.0, -90.0])
Post = tuple[float, float, float]


def heard(pose: Pose2, posts: list[Post]) -> Readings:
    """Return what the five sensors hear of posts and walls, by casting seven rays for each."""
    rays = (pose.heading + BEARINGS[:, None] + CONE).ravel()
    around = np.repeat(pose.heading + BEARINGS, len(CONE))
    x, y = pose.x + 0.22 * np.cos(around), pose.y + 0.22 * np.sin(around)
    cos, sin = np.cos(rays), np.sin(rays)
    walls_x = np.where(cos > 0.0, 10.0 - x, -x) / np.where(cos == 0.0, 1e-12, cos)
    walls_y = np.where(sin > 0.0, 10.0 - y, -y) / np.where(sin == 0.0, 1e-12, sin)
    nearest = np.minimum(walls_x, walls_y)
    for post_x, post_y, radius in posts:
        along = (post_x - x) * cos + (post_y - y) * sin
        room = radius**2 - ((post_x - x) ** 2 + (post_y - y) ** 2 - along**2)
        way = along - np.sqrt(np.maximum(room, 0.0))
        nearest = np.where((room > 0.0) & (along > 0.0), np.minimum(nearest, way), nearest)
    nearest = np.maximum(nearest.reshape(5, -1).min(axis=1), 0.0)
    return Readings(tuple(np.where(nearest < 3.0, nearest, np.inf)), (0.12, 0.09, 0.06, 0.03, 0.0))


def drive(start: Pose2, target: tuple[float, float], posts: list[Post]) -> tuple[float, float]:
    """Return way over the straight line, and the least gap to a post, of a drive that arrives."""
    controller, dt = ReactiveController(ReactiveConfig(), LIMITS), 0.1
    pose, velocity, way, gap = start, Velocity(), 0.0, math.inf
    for _ in range(800):
        step = controller.step(heard(pose, posts), pose, target)
        if step.target_distance_m < 0.12:
            straight = math.hypot(target[0] - start.x, target[1] - start.y)
            return way / straight, gap
        velocity = LIMITS.approach(velocity, step.velocity, dt)
        turn, moved = velocity.angular_rad_s * dt, velocity.linear_m_s * dt
        pose = pose @ Pose2(moved * math.cos(turn / 2), moved * math.sin(turn / 2), turn)
        way += moved
        gaps = [math.hypot(pose.x - x, pose.y - y) - r - 0.25 for x, y, r in posts]
        gap = min([gap, *gaps])
    raise AssertionError(f'did not arrive, {step.target_distance_m:.2f} m are left')


@pytest.mark.parametrize('heading', [0.0, 0.8, 2.0, -2.5])
def test_free_drive_is_hardly_longer_than_the_straight_line(heading: float) -> None:
    """Issue 5 asks for at most 1.05 on Lv's room (fig. 10)."""
    ratio, _ = drive(Pose2(2.0, 2.0, heading), (8.0, 8.0), [])
    assert ratio <= 1.05


def test_one_post_is_passed_without_touching_on_a_way_of_at_most_a_quarter_more() -> None:
    """Posts of any size and place across the straight line (fig. 11; issue 5 asks for 1.25)."""
    rng = np.random.default_rng(7)
    for _ in range(10):
        radius, share, aside = rng.uniform(0.2, 0.7), rng.uniform(0.3, 0.7), rng.uniform(-0.5, 0.5)
        post = (2.0 + 6.0 * share - 0.7 * aside, 2.0 + 6.0 * share + 0.7 * aside, radius)
        ratio, gap = drive(Pose2(2.0, 2.0, math.pi / 4), (8.0, 8.0), [post])
        assert ratio <= 1.25, post
        assert gap > 0.05, post
