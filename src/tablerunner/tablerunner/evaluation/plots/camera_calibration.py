"""The picture of a camera's calibration: what is left between seen and expected, enlarged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.evaluation.plots import style

Array = NDArray[np.float64]


def draw_camera_calibration(
    figure: Any,
    size: tuple[int, int],
    corners: tuple[Array, ...] = (),
    corner_residuals: tuple[Array, ...] = (),
    points: Array | None = None,
    point_residuals: Array | None = None,
) -> None:
    """Draw where corners and points were, each with an arrow to where it was expected less.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty.
    size : tuple of 2 ints
        Width and height of the pictures [pixel].
    corners, corner_residuals : tuple of ndarray, shape (n, 2)
        Of the board in each picture [pixel]; empty where the lens was known.
    points, point_residuals : ndarray, shape (n, 2), or None
        Of the marked points [pixel].
    """
    panels: list[tuple[str, Array, Array]] = []
    if corners:
        panels.append(
            ('corners of the boards', np.concatenate(corners), np.concatenate(corner_residuals))
        )
    if points is not None and point_residuals is not None:
        panels.append(('marked points', points, point_residuals))
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for axis, (title, places, residuals) in zip(axes, panels, strict=True):
        rms = float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))
        # As large as can be told apart: the usual arrow a fortieth of the width.
        factor = size[0] / 40.0 / max(rms, 1e-6)
        factor = float(f'{factor:.1g}')
        axis.quiver(
            *places.T,
            *(factor * residuals.T),
            angles='xy',
            scale_units='xy',
            scale=1.0,
            color=style.ESTIMATE,
            width=0.003,
        )
        axis.plot(*places.T, '.', color=style.FIX, markersize=2)
        axis.set_xlim(0, size[0])
        axis.set_ylim(size[1], 0)
        axis.set_aspect('equal')
        axis.set_xlabel('u [pixel]')
        axis.set_title(f'{title}: rms {rms:.2f} pixel, arrows x {factor:g}', loc='left')
    axes[0].set_ylabel('v [pixel]')
