from __future__ import annotations

import numpy as np
import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Camera, Light, Marker, Person, RobotGeometry, Scenario, Table
from tablerunner.simulation.camera import CeilingView, RobotView
from tablerunner.simulation.camera.rays import Rays
from tablerunner.simulation.truth import PersonState

EXACT = {'position_std': 0.0, 'angle_std': 0.0, 'focal_std': 0.0}
CLEAR = {**EXACT, 'noise': 0.0, 'blur': 0.0, 'light': Light(drift=0.0, tint=0.0, shadows=0)}
CAMERA = Camera((0.0, 0.0, 3.0), focal=(200.0, 200.0), width=320, height=240, **CLEAR)
MARKER = Marker()


def scenario_of(camera: Camera = CAMERA, **fields: object) -> Scenario:
    return Scenario('x', camera=camera, robot=RobotGeometry(marker=MARKER), **fields)


def is_marker(picture: np.ndarray) -> np.ndarray:
    return np.abs(picture.astype(int) - MARKER.colour[::-1]).max(axis=2) < 12


@pytest.mark.parametrize('seed', range(5))
def test_slopes_are_the_rays_of_the_pixels(seed: int) -> None:
    """A point along a pixel's ray is projected onto that pixel."""
    rng = np.random.default_rng(seed)
    camera = CAMERA.replace(yaw=float(rng.uniform(-3, 3)), tilt=tuple(rng.uniform(-0.2, 0.2, 2)))
    rays = Rays(camera)
    rows, columns = rng.integers(0, 240, 30), rng.integers(0, 320, 30)
    drop = rng.uniform(1.0, 3.0, 30)[:, None]
    points = np.concatenate([rays.slopes[rows, columns] * drop, 3.0 - drop], axis=1)
    # The slopes are kept with seven digits: a ten-thousandth of a pixel.
    assert rays.project(points) == pytest.approx(np.column_stack([columns, rows]), abs=5e-4)


def test_marker_is_drawn_where_it_projects() -> None:
    """Both discs' centres are of the marker's colour, the plate between them is dark."""
    view = CeilingView(scenario_of(), 0)
    pose = Pose2(0.5, 0.3, 0.7)
    picture = view.draw(0.0, [RobotView(pose, 0.25, MARKER)])
    places = pose.transform(np.array([[-0.06, 0.0], [0.14, 0.0], [0.0575, 0.0]]))
    points = np.column_stack([places, np.full(3, MARKER.height)])
    (disc, front, gap) = np.rint(view.rays.project(points)).astype(int)
    seen = is_marker(picture)
    assert seen[disc[1], disc[0]]
    assert seen[front[1], front[0]]
    assert picture[gap[1], gap[0]].max() < 100
    # All that is of the colour is as large as both discs are at that height.
    scale = 200.0 / (3.0 - MARKER.height)
    expected = np.pi * (0.09**2 + 0.055**2) * scale**2
    assert np.sum(picture[..., 2].astype(int) - picture[..., 1] > 98) == pytest.approx(
        expected, rel=0.15
    )


def test_moving_robot_is_smeared_about_the_middle_of_the_exposure() -> None:
    view = CeilingView(scenario_of(CAMERA.replace(exposure=0.1)), 0)
    still = view.draw(0.0, [RobotView(Pose2(), 0.25, MARKER)])
    moving = view.draw(0.0, [RobotView(Pose2(), 0.25, MARKER, linear_m_s=1.0)])
    columns = np.arange(320)
    weights = [
        np.clip(p[..., 2].astype(float) - p[..., 1] - 12.0, 0, None) for p in (still, moving)
    ]
    middles = [float((w.sum(axis=0) @ columns) / w.sum()) for w in weights]
    assert middles[1] == pytest.approx(middles[0], abs=0.15)
    # 0.1 m are 11 pixels: the whole colour is left in a narrower place.
    assert is_marker(moving).sum() < 0.6 * is_marker(still).sum()


@pytest.mark.parametrize(('distance', 'hidden'), [(0.35, True), (0.8, False)])
def test_person_between_camera_and_robot_hides_it(distance: float, hidden: bool) -> None:
    """1.7 m high and nearer to the point under the camera: seen from above, the head covers it."""
    person = Person('p', ((0.0, 0.0),))
    view = CeilingView(scenario_of(people=(person,)), 0)
    robot = RobotView(Pose2(1.2, 0.0, 0.0), 0.25, MARKER)
    free = is_marker(view.draw(0.0, [robot])).sum()
    state = PersonState('p', Pose2(1.2 - distance, 0.0), 0.0, 0.25)
    seen = is_marker(view.draw(0.0, [robot], [state])).sum()
    assert (seen < 0.5 * free) == hidden


def test_table_hides_what_is_behind_it_only() -> None:
    """A table 1.4 m high: its top hides the floor beyond, and nothing that is higher."""
    table = Table('t', 0.8, 0.0, (0.0, 0.0, 0.0), length=0.4, width=0.4, height=1.4)
    view = CeilingView(scenario_of(tables=(table,)), 0)
    empty = CeilingView(scenario_of(), 0)
    behind = RobotView(Pose2(1.05, 0.0, np.pi), 0.25, MARKER)
    before = RobotView(Pose2(-0.6, 0.0, np.pi), 0.25, MARKER)
    for robot, hidden in ((behind, True), (before, False)):
        free = is_marker(empty.draw(0.0, [robot])).sum()
        seen = is_marker(view.draw(0.0, [robot])).sum()
        assert (seen < 0.9 * free) == hidden


def test_same_seed_gives_the_same_pictures_and_another_seed_others() -> None:
    camera = CAMERA.replace(noise=4.0, light=Light(), clutter=5)
    robots = [RobotView(Pose2(), 0.25, MARKER)]
    pictures = [CeilingView(scenario_of(camera), seed).draw(1.0, robots) for seed in (1, 1, 2)]
    assert np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[0], pictures[2])


def test_noise_is_as_wide_as_asked_and_new_in_each_picture() -> None:
    view = CeilingView(scenario_of(CAMERA.replace(noise=5.0)), 0)
    first, second = (view.draw(0.0, []).astype(float) for _ in range(2))
    # The difference of two independent noises; rounded to grey levels (1/12 each).
    assert np.std(first - second) == pytest.approx(np.sqrt(2 * (25.0 + 1 / 12)), rel=0.02)


def test_camera_hangs_off_its_measured_place_by_its_deviations() -> None:
    camera = CAMERA.replace(position_std=0.01, angle_std=0.02)
    from tablerunner.simulation.camera.view import real_camera
    from tablerunner.simulation.streams import stream

    found = [real_camera(camera, stream(seed, 'camera mount')) for seed in range(300)]
    places = np.array([item.position for item in found]) - camera.position
    angles = np.array([(item.yaw, *item.tilt) for item in found])
    # 900 draws tell a deviation to 2.4 %; three of that.
    assert np.std(places) == pytest.approx(0.01, rel=0.075)
    assert np.std(angles) == pytest.approx(0.02, rel=0.075)


def test_robot_out_of_sight_is_not_drawn() -> None:
    view = CeilingView(scenario_of(), 0)
    empty = view.draw(0.0, [])
    for place in ((30.0, 0.0), (0.0, -8.0), (-500.0, 500.0)):
        assert np.array_equal(view.draw(0.0, [RobotView(Pose2(*place), 0.25, MARKER)]), empty)
