from __future__ import annotations

import cv2
import numpy as np
import pytest

from tablerunner.types import Lens
from tablerunner.vision import distort, undistort

RNG = np.random.default_rng(5)


def some_lens(rng: np.random.Generator) -> Lens:
    return Lens(
        640,
        480,
        (float(rng.uniform(300, 600)), float(rng.uniform(300, 600))),
        (float(rng.uniform(300, 340)), float(rng.uniform(220, 260))),
        tuple(float(value) for value in rng.normal(0.0, [0.1, 0.03, 0.002, 0.002, 0.005])),
    )


@pytest.mark.parametrize('seed', range(10))
def test_distort_agrees_with_opencv(seed: int) -> None:
    """The model is the one that ROS means by plumb_bob, with its order of coefficients."""
    rng = np.random.default_rng(seed)
    lens = some_lens(rng)
    rays = rng.uniform(-0.6, 0.6, (50, 2))
    matrix = np.array(
        [[lens.focal[0], 0, lens.centre[0]], [0, lens.focal[1], lens.centre[1]], [0, 0, 1]]
    )
    theirs, _ = cv2.projectPoints(
        np.column_stack([rays, np.ones(50)]),
        np.zeros(3),
        np.zeros(3),
        matrix,
        np.array(lens.distortion),
    )
    assert distort(lens, rays) == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


@pytest.mark.parametrize('seed', range(10))
def test_undistort_takes_distort_back(seed: int) -> None:
    """To 1e-8, which is a millionth of a pixel."""
    rng = np.random.default_rng(seed)
    lens = some_lens(rng)
    rays = rng.uniform(-0.5, 0.5, (4, 25, 2))
    assert undistort(lens, distort(lens, rays)) == pytest.approx(rays, abs=1e-8)


def test_undistort_where_the_lens_folds_is_nan() -> None:
    """With k1 = -0.3 no ray comes farther out than r = 1.05 (2/3): beyond it there is nothing."""
    lens = Lens(640, 480, (300.0, 300.0), (320.0, 240.0), (-0.3, 0.0, 0.0, 0.0, 0.0))
    edge = 320.0 + 300.0 * (2.0 / 3.0) / np.sqrt(3.0 * 0.3)
    rays = undistort(lens, [[edge - 1.0, 240.0], [edge + 1.0, 240.0]])
    assert np.all(np.isfinite(rays[0]))
    assert np.all(np.isnan(rays[1]))
