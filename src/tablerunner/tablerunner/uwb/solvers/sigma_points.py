"""Covariance of a solver without derivatives: move each range by its standard deviation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array


def propagate(
    place: Callable[[Array], Array], ranges: Array, std: Array, used: NDArray[np.bool_]
) -> Array:
    """Return the covariance that independent errors of the ranges give the position.

    A range one standard deviation longer and shorter moves the position by f+ and f-. With the odd
    part D = (f+ - f-) / 2 and the even part E = (f+ + f-) / 2, a standard normal error z moves it
    by about D z + E z^2, whose mean square is D D' + 3 E E'. That is the linear propagation of
    errors with differences as wide as the noise, and holds where a solver chooses or votes.

    Parameters
    ----------
    place : callable
        From ranges, shape (m, n), to positions, shape (m, 2); NaN where there is none.
    ranges, std : ndarray, shape (m, n)
    used : ndarray of bool, shape (m, n)
        Ranges to move.

    Returns
    -------
    ndarray, shape (m, 2, 2)
        NaN where neither the longer nor the shorter range gives a position.
    """
    covariance = np.zeros((len(ranges), 2, 2))
    here = place(ranges)
    for j in range(ranges.shape[1]):
        if not used[:, j].any():
            continue
        longer, shorter = ranges.copy(), ranges.copy()
        longer[:, j] += std[:, j]
        shorter[:, j] -= std[:, j]
        ahead, back = place(longer) - here, place(shorter) - here
        # No position on one side: what the other side says.
        ahead, back = (
            np.where(np.isfinite(ahead), ahead, -back),
            np.where(np.isfinite(back), back, -ahead),
        )
        for part, share in ((0.5 * (ahead - back), 1.0), (0.5 * (ahead + back), 3.0)):
            part = np.where(used[:, j, None], part, 0.0)
            covariance += share * part[:, :, None] * part[:, None, :]
    return covariance
