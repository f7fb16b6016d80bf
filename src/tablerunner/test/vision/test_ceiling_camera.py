from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.errors import ConfigError, GeometryError
from tablerunner.scenario import Camera
from tablerunner.simulation.camera.rays import Rays
from tablerunner.types import Lens
from tablerunner.vision import CameraMount, CeilingCamera, height_corrected, to_room
from tablerunner.vision.ground_map import ground_map

LENS = Lens(640, 480, (400.0, 410.0), (318.0, 243.0), (-0.2, 0.05, 0.001, -0.0005, -0.005))


def test_height_correction_is_that_of_similar_triangles() -> None:
    """Lamp post: H = 3 m, h = 1 m; what seems to lie 3 m from the foot stands at 2 m."""
    assert height_corrected([3.0, -1.5], 3.0, 1.0) == pytest.approx([2.0, -1.0])


@pytest.mark.parametrize('height', [3.0, 3.5])
def test_height_correction_above_the_camera_is_refused(height: float) -> None:
    with pytest.raises(GeometryError, match='not below the camera'):
        height_corrected([1.0, 1.0], 3.0, height)


def test_to_room_turns_counter_clockwise_then_shifts() -> None:
    assert to_room([[1.0, 0.0], [0.0, 2.0]], math.pi / 2, [5.0, 7.0]) == pytest.approx(
        np.array([[5.0, 8.0], [3.0, 7.0]])
    )


def test_level_camera_shows_the_room_as_a_plan() -> None:
    """With yaw zero, x of map is to the right in the picture and y upward."""
    lens = Lens(640, 480, (400.0, 400.0), (320.0, 240.0))
    camera = CeilingCamera(lens, CameraMount((1.0, 2.0, 4.0)))
    # 100 pixels at f = 400 and 4 m are 1 m on the floor, 0.75 m at a height of 1 m.
    assert camera.places([[420.0, 240.0], [320.0, 140.0]], 0.0) == pytest.approx(
        np.array([[2.0, 2.0], [1.0, 3.0]])
    )
    assert camera.places([420.0, 140.0], 1.0) == pytest.approx([1.75, 2.75])


@pytest.mark.parametrize('seed', range(10))
def test_places_and_pixels_are_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mount = CameraMount(
        (1.0, -2.0, float(rng.uniform(2.5, 6.0))),
        float(rng.uniform(-3.0, 3.0)),
        tuple(float(value) for value in rng.uniform(-0.3, 0.3, 2)),
    )
    camera = CeilingCamera(LENS, mount)
    pixels = rng.uniform((20, 20), (620, 460), (40, 2))
    height = float(rng.uniform(0.0, 1.8))
    places = camera.places(pixels, height)
    points = np.column_stack([places, np.full(len(places), height)])
    assert camera.pixels(points) == pytest.approx(pixels, abs=1e-5)


@pytest.mark.parametrize('seed', range(5))
def test_pixels_agree_with_the_simulated_camera(seed: int) -> None:
    """The simulator projects by OpenCV and vectors of its own: both mean the same room."""
    rng = np.random.default_rng(seed)
    position = (2.0, 3.0, float(rng.uniform(3.0, 5.0)))
    yaw, tilt = float(rng.uniform(-3, 3)), tuple(float(v) for v in rng.uniform(-0.3, 0.3, 2))
    rays = Rays(
        Camera(
            position, yaw, tilt, focal=LENS.focal, centre=LENS.centre, distortion=LENS.distortion
        )
    )
    points = rng.uniform((0.5, 1.5, 0.0), (3.5, 4.5, 1.8), (30, 3))
    camera = CeilingCamera(LENS, CameraMount(position, yaw, tilt))
    assert camera.pixels(points) == pytest.approx(rays.project(points), abs=1e-6)


def test_ray_above_the_horizon_has_no_place() -> None:
    camera = CeilingCamera(
        Lens(640, 480, (200.0, 200.0), (320.0, 240.0)), CameraMount(tilt=(1.0, 0.0))
    )
    places = camera.places([[320.0, 0.0], [320.0, 479.0]], 0.0)
    assert np.isnan(places).any(axis=1).sum() == 1


def test_ground_map_pixels_cover_their_area() -> None:
    """A straight camera's pixel covers (drop / f)^2 everywhere."""
    lens = Lens(64, 48, (40.0, 50.0), (31.5, 23.5))
    ground = ground_map(CeilingCamera(lens, CameraMount((0.0, 0.0, 3.0))), 1.0)
    assert ground.area == pytest.approx(np.full((48, 64), 2.0 / 40.0 * 2.0 / 50.0), rel=1e-4)
    assert (ground.x[24, 63], ground.y[0, 32]) == pytest.approx((31.5 / 20.0, 23.5 / 25.0))


@pytest.mark.parametrize(
    ('fields', 'field'),
    [
        ({'position': (1.0, 2.0)}, 'position'),
        ({'position': (1.0, 2.0, 0.0)}, 'position'),
        ({'tilt': (0.1,)}, 'tilt'),
    ],
)
def test_mount_that_cannot_be_is_refused(fields: dict, field: str) -> None:
    with pytest.raises(ConfigError, match=field):
        CameraMount(**fields)
