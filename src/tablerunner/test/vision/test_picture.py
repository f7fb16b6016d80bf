from __future__ import annotations

import numpy as np
import pytest

from tablerunner.types import Lens
from tablerunner.vision import picture_fault

LENS = Lens(320, 240, (200.0, 200.0), (160.0, 120.0))


def noisy(level: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(level, 4.0, (240, 320, 3))
    return np.clip(noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ('picture', 'fault'),
    [
        (noisy(120.0), ''),
        (noisy(30.0), ''),
        (noisy(225.0), ''),
        (noisy(0.0), 'picture is black'),
        (noisy(255.0), 'picture is white'),
        (np.full((240, 320, 3), 255, np.uint8), 'picture is white'),
        (noisy(120.0)[:, :300], 'picture is not of the size that camera_info says'),
        (noisy(120.0)[..., 0], 'picture is not of the size that camera_info says'),
    ],
)
def test_picture_fault(picture: np.ndarray, fault: str) -> None:
    assert picture_fault(picture, LENS) == fault


@pytest.mark.parametrize('fill', [(0, 0, 0), (128, 128, 128), (0, 135, 0)])
def test_picture_that_breaks_off_is_torn(fill: tuple) -> None:
    picture = noisy(120.0)
    picture[200:] = fill
    assert picture_fault(picture, LENS) == 'picture is torn'
