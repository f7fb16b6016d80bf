"""NLOS from the signal: how much weaker the first path is than the whole."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tablerunner.uwb.nlos.verdict import NlosVerdict, logistic


def judge_signal(
    rx_power_dbm: ArrayLike,
    first_path_power_dbm: ArrayLike,
    centre_db: float = 8.0,
    width_db: float = 1.0,
    threshold: float = 0.5,
) -> NlosVerdict:
    """Return what receive minus first-path power says, for arrays of any one shape.

    The logistic curve of `ranging.nlos_probability`. The noise that Sun (37) compares with cancels
    in the difference.

    Parameters
    ----------
    rx_power_dbm, first_path_power_dbm : array_like
        [dBm]; NaN where not known.
    centre_db, width_db : float
        Gap at which both are as likely, and width of the change [dB].
    threshold : float
        Probability above which a range is called blocked.
    """
    gap = np.asarray(rx_power_dbm, dtype=float) - np.asarray(first_path_power_dbm, dtype=float)
    gap = np.where(np.isfinite(gap), gap, np.nan)
    return NlosVerdict.of(logistic((gap - centre_db) / width_db), threshold)
