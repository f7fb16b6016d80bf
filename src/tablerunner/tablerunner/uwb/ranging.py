"""Two-way ranging: from six device timestamps to a time of flight.

A tag polls, the anchor responds, the tag closes with a final frame. Every interval is the
difference of two stamps of *one* device, so that the offset between the clocks drops out; what
remains is their drift. With e the drift of the tag against the anchor, the error of the time of
flight is about e/2 * reply for the single-sided form (0.3 m at 1 ppm and 2 ms), e/4 *
(reply_anchor - reply_tag) for the symmetric double-sided form, and e * tof/2 for the asymmetric
form (below a millimetre): the last is the default everywhere.

All functions take integers or integer arrays of any one shape and return floats of that shape.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

SPEED_OF_LIGHT_M_S = 299_702_547.0
"""Propagation speed in air [m/s]."""

TICK_S = 1.0 / (128 * 499.2e6)
"""One tick of a DW1000-class timestamp counter [s]."""

COUNTER_BITS = 40
"""Width of the timestamp counters: they wrap every 17.2 s."""

_WRAP = (1 << COUNTER_BITS) - 1

Ticks = Any  # int or NDArray[np.int64]


def interval(start: Ticks, end: Ticks) -> Ticks:
    """Return the ticks from `start` to `end` on one device's wrapping counter."""
    return (end - start) & _WRAP


def intervals(
    poll_tx: Ticks,
    poll_rx: Ticks,
    response_tx: Ticks,
    response_rx: Ticks,
    final_tx: Ticks,
    final_rx: Ticks,
) -> tuple[Ticks, Ticks, Ticks, Ticks]:
    """Return the four intervals of an exchange [ticks].

    Returns
    -------
    round_tag, reply_anchor, round_anchor, reply_tag
        Tag: poll sent to response received; anchor: poll received to response sent; anchor:
        response sent to final received; tag: response received to final sent.
    """
    return (
        interval(poll_tx, response_rx),
        interval(poll_rx, response_tx),
        interval(response_tx, final_rx),
        interval(response_rx, final_tx),
    )


def single_sided(round_tag: Ticks, reply_anchor: Ticks) -> Any:
    """Return the time of flight [s] from poll and response only (Sun 33).

    Feels the full drift between both clocks over the reply time.
    """
    return (round_tag - reply_anchor) * (TICK_S / 2.0)


def symmetric_double_sided(
    round_tag: Ticks, reply_anchor: Ticks, round_anchor: Ticks, reply_tag: Ticks
) -> Any:
    """Return the time of flight [s] as the mean of both single-sided results (Lv 1).

    Free of drift only where both devices take equally long to reply.
    """
    return (round_tag - reply_anchor + round_anchor - reply_tag) * (TICK_S / 4.0)


def double_sided(
    round_tag: Ticks, reply_anchor: Ticks, round_anchor: Ticks, reply_tag: Ticks
) -> Any:
    """Return the time of flight [s], free of first-order drift for any reply times.

    With round = 2 tof + reply on each side, the product round_tag * round_anchor - reply_anchor *
    reply_tag is tof times the sum of all four; each device's drift scales one factor of each
    product and nearly cancels in the quotient.
    """
    # The products reach 2^78: they need Python integers or floating point of differences. Written
    # with the small differences d = round - reply = 2 tof, nothing large is ever subtracted.
    if isinstance(round_tag, np.ndarray):
        round_tag, reply_anchor, round_anchor, reply_tag = (
            np.asarray(value, dtype=np.float64)
            for value in (round_tag, reply_anchor, round_anchor, reply_tag)
        )
    total = round_tag + reply_anchor + round_anchor + reply_tag
    # round_tag round_anchor - reply_anchor reply_tag
    #   = round_anchor (round_tag - reply_anchor) + reply_anchor (round_anchor - reply_tag)
    product = round_anchor * (round_tag - reply_anchor) + reply_anchor * (round_anchor - reply_tag)
    return product / total * TICK_S


def distance(time_of_flight_s: Any) -> Any:
    """Return the distance [m] that light covers in air in the given time (Lv 2)."""
    return time_of_flight_s * SPEED_OF_LIGHT_M_S


def calibrated(range_m: Any, bias_m: Any, scale: Any) -> Any:
    """Return the range after linear calibration (Sun 36).

    The raw range is ``(1 + scale) * true + bias`` (Sun 34-35).
    """
    return (range_m - bias_m) / (1.0 + scale)


def nlos_corrected(range_m: Any, blocked: Any, offset_m: float) -> Any:
    """Return the range less a constant where it is blocked (Sun 37).

    Sun switches the constant on where the signal-to-noise ratio is below a threshold; here
    `blocked` is the decision of any NLOS test.

    Parameters
    ----------
    range_m : float or ndarray
        Calibrated range [m].
    blocked : bool or ndarray of bool
    offset_m : float
        How much too long a blocked range is in this building [m].
    """
    return range_m - offset_m * np.asarray(blocked, dtype=float)


def nlos_probability(
    rx_power_dbm: float, first_path_power_dbm: float, centre_db: float, width_db: float
) -> float:
    """Return the probability that the direct path was blocked, from the signal's quality.

    A first path much weaker than the whole signal means that most energy came by detours. The
    makers of such radios call a gap under about 6 dB likely clear and over about 10 dB likely
    blocked; a logistic curve of `centre_db` and `width_db` runs between them.

    Returns
    -------
    float
        In [0, 1]; NaN where a power is unknown.
    """
    gap = rx_power_dbm - first_path_power_dbm
    if not math.isfinite(gap):
        return math.nan
    steps = min(max((gap - centre_db) / width_db, -50.0), 50.0)  # beyond, exp would overflow
    return 1.0 / (1.0 + math.exp(-steps))
