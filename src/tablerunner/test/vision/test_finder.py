from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Light, Marker
from tablerunner.simulation.camera import RobotView
from tablerunner.vision import CeilingCamera, MarkerConfig, MarkerFinder, Sighting
from tablerunner.vision.finder import AT_BORDER, DOUBLE, UNSEEN

CONFIG = MarkerConfig(hues=(329.0,))
GREEN, BLUE = Marker((30, 190, 60)), Marker((30, 90, 220))


def finder_of(room: object, config: MarkerConfig = CONFIG) -> MarkerFinder:
    return MarkerFinder(config, CeilingCamera(room.lens, room.mount))


def some_pose(rng: np.random.Generator) -> Pose2:
    return Pose2(*(float(v) for v in rng.uniform((-0.9, -0.6, -np.pi), (0.9, 0.6, np.pi))))


def error_of(sighting: Sighting, pose: Pose2) -> np.ndarray:
    found = sighting.pose
    return np.array([found.x - pose.x, found.y - pose.y, wrap(found.heading - pose.heading)])


def test_pose_is_found_to_a_fraction_of_a_pixel(room: object) -> None:
    """A pixel is 9 mm here: places are right to 0.5 mm rms, headings to 4 mrad."""
    finder, rng = finder_of(room), np.random.default_rng(3)
    poses = [some_pose(rng) for _ in range(40)]
    errors = [
        error_of(finder.find(room.picture(pose, speed=0.5))['robot'], pose) for pose in poses
    ]
    place, turn = np.sqrt(np.mean(np.square(errors)[:, :2])), np.std([e[2] for e in errors])
    assert place < 0.0005
    assert turn < 0.004


def test_covariance_covers_the_noise(room: object) -> None:
    """Of what noise does, not of the calibration: its share of the covariance is taken away."""
    config = CONFIG.replace(place_std=1e-6, heading_std=1e-6, pixel_noise=4.0)
    finder, rng = finder_of(room, config), np.random.default_rng(4)
    squares = []
    for _ in range(60):
        pose = some_pose(rng)
        found = finder.find(room.picture(pose))['robot']
        error = error_of(found, pose)
        squares.append(error @ np.linalg.solve(found.covariance, error))
    # Three numbers: 3 on average if it were exact. The steps of the pixels add a little, the
    # picture's blur takes some of the noise away.
    assert 0.5 < np.mean(squares) < 5.0


def test_three_robots_are_told_apart_by_their_colours(room: object) -> None:
    names = ('one', 'two', 'three')
    config = MarkerConfig(names, (329.0, 131.0, 221.0), (1.15,) * 3)
    finder, rng = finder_of(room, config), np.random.default_rng(5)
    for _ in range(10):
        places = rng.permutation([(-0.8, 0.5), (0.1, -0.4), (0.8, 0.4)])
        poses = [Pose2(*place, float(rng.uniform(-3, 3))) for place in places]
        robots = [
            RobotView(pose, 0.25, marker)
            for pose, marker in zip(poses, (Marker(), GREEN, BLUE), strict=True)
        ]
        found = finder.find(room.view.draw(0.0, robots))
        for name, pose in zip(names, poses, strict=True):
            assert np.abs(error_of(found[name], pose))[:2].max() < 0.003


@pytest.mark.parametrize('gain', [0.35, 0.6, 1.0, 1.4])
def test_light_does_not_move_a_marker(
    make_room: Callable[..., object], still_light: Light, gain: float
) -> None:
    room = make_room(light=still_light.replace(level=gain))
    finder, rng = finder_of(room), np.random.default_rng(6)
    for _ in range(5):
        pose = some_pose(rng)
        assert np.abs(error_of(finder.find(room.picture(pose))['robot'], pose))[:2].max() < 0.003


def test_shadow_across_a_disc_does_not_move_it(room: object) -> None:
    """Half of the marker in a shadow of 40 %: under 2 mm, not the 9 mm of the mere mean."""
    finder, pose = finder_of(room), Pose2(0.2, 0.1, 0.0)
    picture = room.picture(pose)
    row = round(room_pixel(room, pose)[1])
    picture[row:] = (picture[row:] * 0.6).astype(np.uint8)
    assert np.abs(error_of(finder.find(picture)['robot'], pose))[:2].max() < 0.002


def room_pixel(room: object, pose: Pose2) -> np.ndarray:
    return CeilingCamera(room.lens, room.mount).pixels([pose.x, pose.y, 1.15])


def test_two_markers_of_one_colour_are_refused(room: object) -> None:
    picture = room.picture(Pose2(-0.5, 0.0, 0.0), Pose2(0.5, 0.0, 1.0))
    assert finder_of(room).find(picture)['robot'] == DOUBLE


def test_marker_at_the_border_is_refused(room: object) -> None:
    """It is cut, and so its centre would be wrong."""
    camera = CeilingCamera(room.lens, room.mount)
    edge = camera.places([319.0, 120.0], 1.15)
    picture = room.picture(Pose2(float(edge[0]) + 0.06, float(edge[1]), 0.0))
    assert finder_of(room).find(picture)['robot'] == AT_BORDER


def test_marker_that_is_partly_hidden_is_refused(room: object) -> None:
    picture, pose = room.picture(Pose2(0.0, 0.0, 0.0)), Pose2(-0.06, 0.0)
    u, v = (round(value) for value in room_pixel(room, pose))
    picture[v + 3 : v + 30, u - 20 : u + 20] = 90
    assert finder_of(room).find(picture)['robot'] == UNSEEN


@pytest.mark.parametrize('radius', [5, 8, 10, 12, 20])
def test_coloured_disc_on_a_bright_floor_is_no_marker(room: object, radius: int) -> None:
    """Its like lies beside the right one, which is found all the same."""
    pose = Pose2(0.3, 0.2, 0.5)
    picture = room.picture(pose)
    cv2.circle(picture, (60, 190), radius, (140, 40, 235), -1, cv2.LINE_AA)
    cv2.circle(picture, (90, 190), max(radius // 2, 4), (140, 40, 235), -1, cv2.LINE_AA)
    assert np.abs(error_of(finder_of(room).find(picture)['robot'], pose))[:2].max() < 0.003
    alone = room.picture()
    cv2.circle(alone, (60, 190), radius, (140, 40, 235), -1, cv2.LINE_AA)
    assert finder_of(room).find(alone)['robot'] == UNSEEN


def test_discs_on_a_green_cloth_are_no_marker(room: object) -> None:
    """All is as on a marker, but for the plate, which is dark green."""
    picture = room.picture(Pose2(0.2, 0.1, 0.4))
    assert isinstance(finder_of(room).find(picture)['robot'], Sighting)
    u, v = (round(value) for value in room_pixel(room, Pose2(0.2, 0.1)))
    around = picture[v - 30 : v + 30, u - 30 : u + 30]
    around[around.max(axis=2) < 60] = (24, 60, 24)
    assert finder_of(room).find(picture)['robot'] == UNSEEN


def test_plain_disc_gives_a_place_and_no_heading(room: object) -> None:
    config = CONFIG.replace(front_radius=0.0, disc_x=0.0)
    marker = Marker(front_radius=0.0, disc_x=0.0)
    found = finder_of(room, config).find(room.picture(Pose2(0.4, -0.3, 2.0), marker=marker))
    sighting = found['robot']
    assert np.hypot(sighting.pose.x - 0.4, sighting.pose.y + 0.3) < 0.002
    assert np.isinf(sighting.covariance[2, 2])


def test_red_is_found_on_both_sides_of_zero(room: object) -> None:
    for hue, colour in ((2.0, (230, 30, 24)), (357.0, (230, 24, 34))):
        finder = finder_of(room, CONFIG.replace(hues=(hue,)))
        found = finder.find(room.picture(Pose2(), marker=Marker(colour)))['robot']
        assert isinstance(found, Sighting), hue


def test_marker_above_the_camera_is_refused(room: object) -> None:
    with pytest.raises(ConfigError, match=r'heights\[0\].*below the camera'):
        finder_of(room, CONFIG.replace(heights=(3.3,)))
