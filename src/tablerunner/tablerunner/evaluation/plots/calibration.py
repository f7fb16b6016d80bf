"""The picture of a calibration: what each anchor reads too long, before and after."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablerunner.evaluation.plots import style
from tablerunner.uwb.clear_line import CUT
from tablerunner.uwb.range_calibration import RangeCalibration

Array = NDArray[np.float64]


def draw_calibration(
    figure: Any, fits: Mapping[str, RangeCalibration], pairs: Mapping[str, tuple[Array, Array]]
) -> None:
    """Draw errors of ranges over distance with the fitted lines, and what is left.

    Ranges that are too far off their line to count have a colour of their own.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty.
    fits : mapping of str to RangeCalibration
        By anchor.
    pairs : mapping of str to (true, raw), each of shape (k,)
        By anchor [m].
    """
    axes = figure.subplots(2, len(fits), sharex='col', sharey='row', squeeze=False)
    for column, (anchor_id, fit) in enumerate(fits.items()):
        true, raw = pairs[anchor_id]
        above, below = axes[0, column], axes[1, column]
        left = fit.apply(raw) - true
        far = np.abs(left) > CUT * fit.residual_std_m
        above.plot(true, raw - true, '.', color=style.FIX, markersize=2)
        above.plot(true[far], (raw - true)[far], '.', color=style.NLOS, markersize=2)
        ends = np.array([fit.shortest_m, fit.longest_m])
        above.plot(ends, fit.bias_m + fit.scale * ends, color=style.TRUTH, linewidth=1.2)
        below.plot(true[~far], left[~far], '.', color=style.ESTIMATE, markersize=2)
        below.plot(true[far], left[far], '.', color=style.NLOS, markersize=2)
        below.axhline(0.0, color=style.TRUTH, linewidth=0.8)
        above.set_title(anchor_id, loc='left')
        below.set_xlabel('true range [m]')
    axes[0, 0].set_ylabel('error as measured [m]')
    axes[1, 0].set_ylabel('calibrated [m]')
