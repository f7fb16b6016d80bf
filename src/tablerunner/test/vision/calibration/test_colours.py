from __future__ import annotations

import colorsys

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.vision.calibration import fit_colour

PLACES = [(30, 20), (60, 50)]


def picture_of(*colours: tuple[float, float, float], noise: float = 3.0) -> np.ndarray:
    """Return a grey picture with a patch of each colour (hue, saturation, value)."""
    picture = np.full((80, 100, 3), 110.0)
    for (u, v), hsv in zip(PLACES, colours, strict=False):
        bgr = np.array(colorsys.hsv_to_rgb(*hsv)[::-1]) * 255
        picture[v - 5 : v + 6, u - 5 : u + 6] = bgr
    noisy = picture + np.random.default_rng(0).normal(0, noise, picture.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


@pytest.mark.parametrize('degrees', [2.0, 131.0, 221.0, 329.0, 358.0])
def test_colour_is_that_of_the_patches(degrees: float) -> None:
    hsv = (degrees / 360, 0.8, 0.7)
    found = fit_colour(picture_of(hsv, hsv), PLACES)
    assert abs((found.hue - degrees + 180) % 360 - 180) < 2.0
    assert found.least_saturation == pytest.approx(0.6 * 0.8, rel=0.1)
    assert found.least_value == pytest.approx(0.25 * 0.7, rel=0.1)
    assert found.pixels == 18


@pytest.mark.parametrize(
    ('colours', 'points', 'words'),
    [
        ([(0.9, 0.1, 0.7)] * 2, PLACES, 'hardly any colour'),
        ([(0.9, 0.8, 0.7), (0.4, 0.8, 0.7)], PLACES, 'several colours'),
        ([(0.9, 0.8, 0.7)] * 2, [(30, 20), (200, 20)], r'pixels\[1\] lies outside'),
        ([(0.9, 0.8, 0.7)] * 2, [], 'no points'),
    ],
)
def test_no_one_colour_is_refused(colours: list, points: list, words: str) -> None:
    with pytest.raises(GeometryError, match=words):
        fit_colour(picture_of(*colours), points)
