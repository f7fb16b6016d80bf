"""The lens from pictures of a chequerboard (Zhang 2000, by OpenCV)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import GeometryError
from tablerunner.types import Lens

Array = NDArray[np.float64]

LEAST_PICTURES = 5
"""Fewer leave focal length and distortion open."""

WORST_RMS_PX = 1.5
"""Corners are found to a tenth of a pixel; what misses by more does not belong together."""

WORST_FOCAL_STD = 0.01
"""Deviation of the focal length, as a share, above which the board was not held at a slant."""


_SETTLED = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)


@dataclass(frozen=True)
class Board:
    """A chequerboard: inner corners along and across, and the side of a square [m]."""

    columns: int
    rows: int
    square_m: float

    @property
    def points(self) -> NDArray[np.float32]:
        """Its inner corners on its own plane, row by row, shape (n, 3) [m]."""
        columns, rows = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        flat = np.stack([columns, rows, np.zeros_like(rows)], axis=-1).reshape(-1, 3)
        return np.asarray(flat * self.square_m, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class LensFit:
    """A calibrated lens.

    Attributes
    ----------
    lens : Lens
    rms_px : float
        Of all residuals [pixel].
    corners, residuals : tuple of ndarray, shape (n, 2)
        Of each picture: where corners were found, and how far from where the fit has them
        [pixel].
    focal_std, centre_std : tuple of 2 floats
        Standard errors [pixel].
    covered : float
        Share of a grid of 8 x 6 cells of the picture in which a corner was.
    """

    lens: Lens
    rms_px: float
    corners: tuple[Array, ...]
    residuals: tuple[Array, ...]
    focal_std: tuple[float, float]
    centre_std: tuple[float, float]
    covered: float


def find_board(picture: NDArray[np.uint8], board: Board) -> Array | None:
    """Return the inner corners of a board in a picture, shape (n, 2) [pixel]; None without it."""
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE
    found, corners = cv2.findChessboardCornersSB(grey, (board.columns, board.rows), flags=flags)
    if not found:
        return None
    grid = np.asarray(corners, dtype=np.float32).reshape(board.rows, board.columns, 2)
    spacing = min(
        float(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min()) for axis in (0, 1)
    )
    # Once more, from the edges around each corner: as far as its own squares go.
    reach = max(int(0.3 * spacing), 2)
    fine = cv2.cornerSubPix(grey, grid.reshape(-1, 1, 2), (reach, reach), (-1, -1), _SETTLED)
    return np.asarray(fine, dtype=float).reshape(-1, 2)


def fit_lens(corners: Sequence[Array], board: Board, size: tuple[int, int]) -> LensFit:
    """Return the lens that explains all pictures of a board best.

    Parameters
    ----------
    corners : sequence of ndarray, shape (n, 2)
        Of each picture (`find_board`).
    board : Board
    size : tuple of 2 ints
        Width and height of the pictures [pixel].

    Raises
    ------
    GeometryError
        Too few pictures, corners that do not fit together, or boards all held flat.
    """
    if len(corners) < LEAST_PICTURES:
        raise GeometryError(
            f'{len(corners)} pictures with a board in them; {LEAST_PICTURES} or more are needed'
        )
    points = [board.points] * len(corners)
    seen = [np.asarray(item, dtype=np.float32).reshape(-1, 1, 2) for item in corners]
    guess = np.array([[size[0], 0, size[0] / 2], [0, size[0], size[1] / 2], [0, 0, 1.0]])
    rms, matrix, distortion, turns, shifts, errors, *_ = cv2.calibrateCameraExtended(
        points, seen, size, guess, np.zeros(5)
    )
    deviations = np.asarray(errors, dtype=float).ravel()
    k = np.asarray(matrix, dtype=float)
    if not np.isfinite(rms) or rms > WORST_RMS_PX:
        raise GeometryError(
            f'corners miss the best fit by {rms:.1f} pixels (rms): not one board, or not one lens'
        )
    focal_std = float(deviations[0]), float(deviations[1])
    if max(focal_std[0] / k[0, 0], focal_std[1] / k[1, 1]) > WORST_FOCAL_STD:
        raise GeometryError(
            'the focal length stays open: hold the board at a slant, in several directions'
        )
    residuals = []
    for turn, shift, item in zip(turns, shifts, seen, strict=True):
        expected, _ = cv2.projectPoints(board.points, turn, shift, matrix, distortion)
        residuals.append((item - expected).reshape(-1, 2).astype(float))
    everywhere = np.concatenate([np.asarray(item) for item in corners])
    cells = np.unique((everywhere / size * (8, 6)).astype(int), axis=0)
    d = np.asarray(distortion, dtype=float).ravel()
    lens = Lens(
        size[0],
        size[1],
        (float(k[0, 0]), float(k[1, 1])),
        (float(k[0, 2]), float(k[1, 2])),
        (float(d[0]), float(d[1]), float(d[2]), float(d[3]), float(d[4])),
    )
    return LensFit(
        lens,
        float(rms),
        tuple(np.asarray(item, dtype=float) for item in corners),
        tuple(residuals),
        focal_std,
        (float(deviations[2]), float(deviations[3])),
        len(cells) / 48.0,
    )
