"""Pictures of a chequerboard held under a simulated camera, drawn once for all that need them."""

from __future__ import annotations

import numpy as np
import pytest

PLACES = (
    (-0.4, -0.25, 0.5, 0.1),
    (0.4, -0.25, -0.4, 0.4),
    (-0.4, 0.25, 0.3, -0.5),
    (0.4, 0.25, -0.3, -0.4),
    (0.0, 0.0, 0.5, 0.3),
    (0.0, 0.1, -0.1, 0.6),
    (-0.2, 0.0, 0.6, -0.2),
)
"""Of the board: x, y [m], turns about x and y [rad]."""


@pytest.fixture(scope='session')
def board_camera() -> object:
    """Return the camera of the pictures."""
    # Here: the other tests of the core do without.
    from tablerunner.scenario import Camera

    return Camera(
        (0.0, 0.0, 3.0),
        width=400,
        height=300,
        focal=(260.0, 264.0),
        centre=(203.0, 148.0),
        distortion=(-0.25, 0.08, 0.001, -0.0005, -0.01),
        noise=3.0,
    )


@pytest.fixture(scope='session')
def boards(board_camera: object) -> list[np.ndarray]:
    """Return pictures of a board of 7 x 5 inner corners and squares of 8 cm."""
    import cv2

    from tablerunner.simulation.camera.board import board_picture
    from tablerunner.simulation.camera.rays import Rays

    rays, random = Rays(board_camera), np.random.default_rng(0)
    pictures = []
    for x, y, about_x, about_y in PLACES:
        turn = (
            cv2.Rodrigues(np.array([about_x, 0.0, 0.0]))[0]
            @ cv2.Rodrigues(np.array([0.0, about_y, 0.0]))[0]
        )
        pictures.append(board_picture(rays, (8, 6), 0.08, (x, y, 1.7), turn, random))
    return pictures
