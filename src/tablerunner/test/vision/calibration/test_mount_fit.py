from __future__ import annotations

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.types import Lens
from tablerunner.vision import CameraMount, CeilingCamera
from tablerunner.vision.calibration import fit_mount

LENS = Lens(640, 480, (400.0, 405.0), (321.0, 238.0), (-0.2, 0.05, 0.0005, -0.0005, -0.005))


def some_mount(rng: np.random.Generator) -> CameraMount:
    return CameraMount(
        (float(rng.uniform(-3, 3)), float(rng.uniform(-3, 3)), float(rng.uniform(2.5, 5))),
        float(rng.uniform(-3.1, 3.1)),
        tuple(float(value) for value in rng.uniform(-0.25, 0.25, 2)),
    )


def marked(
    mount: CameraMount, rng: np.random.Generator, count: int, top: float = 1.2
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels and places of points between floor and a height."""
    pixels = rng.uniform((40, 40), (600, 440), (count, 2))
    heights = rng.uniform(0.0, top, count) if top else np.zeros(count)
    camera = CeilingCamera(LENS, mount)
    places = [camera.places(pixel, float(h)) for pixel, h in zip(pixels, heights, strict=True)]
    return pixels, np.column_stack([places, heights])


@pytest.mark.parametrize('seed', range(12))
@pytest.mark.parametrize('top', [0.0, 1.2])
def test_exact_points_give_the_mount(seed: int, top: float) -> None:
    """On the floor only, or at several heights."""
    rng = np.random.default_rng(seed)
    mount = some_mount(rng)
    found = fit_mount(LENS, *marked(mount, rng, 8, top)).mount
    assert found.position == pytest.approx(mount.position, abs=1e-4)
    assert np.cos(found.yaw - mount.yaw) == pytest.approx(1.0, abs=1e-8)
    assert found.tilt == pytest.approx(mount.tilt, abs=1e-4)


def test_standard_errors_are_those_of_many_calibrations() -> None:
    """Clicks off by 0.7 pixel: 60 fits tell the deviation to 10 %, hence a factor 1.5."""
    rng = np.random.default_rng(3)
    mount = some_mount(rng)
    pixels, places = marked(mount, rng, 10)
    fits = [fit_mount(LENS, pixels + rng.normal(0, 0.7, pixels.shape), places) for _ in range(60)]
    spread = np.std([fit.mount.position for fit in fits], axis=0)
    told = np.mean([fit.position_std for fit in fits], axis=0)
    assert np.all(spread < 1.5 * told)
    assert np.all(told < 1.5 * spread)


def test_swapped_points_are_refused() -> None:
    rng = np.random.default_rng(4)
    pixels, places = marked(some_mount(rng), rng, 8)
    places[[1, 5]] = places[[5, 1]]
    with pytest.raises(GeometryError, match=r'miss the best fit|would not look down'):
        fit_mount(LENS, pixels, places)


def test_points_that_say_too_little_are_refused() -> None:
    rng = np.random.default_rng(5)
    pixels, places = marked(some_mount(rng), rng, 8)
    with pytest.raises(GeometryError, match='3 points'):
        fit_mount(LENS, pixels[:3], places[:3])
    line = np.column_stack([np.linspace(0, 3, 6), np.linspace(0, 1, 6), np.zeros(6)])
    with pytest.raises(GeometryError, match='one line'):
        fit_mount(LENS, pixels[:6], line)
