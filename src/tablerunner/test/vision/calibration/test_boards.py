from __future__ import annotations

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.scenario import Camera
from tablerunner.types import Lens
from tablerunner.vision import distort
from tablerunner.vision.calibration import Board, LensFit, find_board, fit_lens

BOARD = Board(7, 5, 0.08)


@pytest.fixture(scope='module')
def fit(boards: list[np.ndarray]) -> LensFit:
    corners = [find_board(picture, BOARD) for picture in boards]
    return fit_lens([item for item in corners if item is not None], BOARD, (400, 300))


def test_lens_is_found_from_pictures(fit: LensFit, board_camera: Camera) -> None:
    """Within four standard errors, and bent as the true one to 0.3 pixel."""
    assert len(fit.corners) == 7
    assert fit.rms_px < 0.15
    for found, true, std in zip(
        (*fit.lens.focal, *fit.lens.centre),
        (*board_camera.focal, *board_camera.middle),
        (*fit.focal_std, *fit.centre_std),
        strict=True,
    ):
        assert abs(found - true) < 4.0 * std
    true = Lens(400, 300, board_camera.focal, board_camera.middle, board_camera.distortion)
    rays = np.random.default_rng(1).uniform(-0.45, 0.45, (200, 2))
    # Shift, turn and scale go into where the camera hangs; what is left would bend the room.
    found, wanted = distort(fit.lens, rays), distort(true, rays)
    flat = np.column_stack([found, np.ones(len(found))])
    left = wanted - flat @ np.linalg.lstsq(flat, wanted, rcond=None)[0]
    assert np.abs(left).max() < 0.3


def test_no_board_is_found_where_there_is_none(boards: list[np.ndarray]) -> None:
    assert find_board(boards[0], Board(9, 6, 0.08)) is None
    assert find_board(np.full((300, 400, 3), 120, np.uint8), BOARD) is None


def test_four_pictures_are_refused(fit: LensFit) -> None:
    with pytest.raises(GeometryError, match='4 pictures'):
        fit_lens(fit.corners[:4], BOARD, (400, 300))


def test_corners_of_another_picture_are_refused(fit: LensFit) -> None:
    """A board whose corners were mixed up misses by pixels."""
    mixed = np.random.default_rng(0).permutation(fit.corners[0])
    with pytest.raises(GeometryError, match='miss the best fit'):
        fit_lens([*fit.corners[1:], mixed], BOARD, (400, 300))


def test_boards_all_held_flat_are_refused() -> None:
    """From straight above, a longer lens and a board farther off look the same."""
    rng, lens = np.random.default_rng(2), Lens(400, 300, (260.0, 260.0), (200.0, 150.0))
    corners = []
    for _ in range(7):
        shift = np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(1.2, 1.4)])
        points = BOARD.points + shift - [0.24, 0.16, 0.0]
        seen = distort(lens, points[:, :2] / points[:, 2:])
        corners.append(seen + rng.normal(0.0, 0.1, seen.shape))
    with pytest.raises(GeometryError, match='at a slant'):
        fit_lens(corners, BOARD, (400, 300))
