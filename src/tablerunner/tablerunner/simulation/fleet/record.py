"""What many robots measured, and the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]


@dataclass(frozen=True)
class FleetRecord:
    """Samples of all runs as arrays with time first; all runs share their stamps.

    Attributes
    ----------
    stamps : ndarray of int64, shape (k,)
        Of wheels and truth [ns].
    truth : ndarray, shape (k, 3, runs)
        x, y [m], heading [rad] (not wrapped) of base_link in map.
    wheels : ndarray, shape (k, 2, runs)
        Encoder angles, left and right [rad].
    imu_stamps : ndarray of int64, shape (i,)
    yaw_rate : ndarray, shape (i, runs)
        [rad/s].
    uwb_stamps : ndarray of int64, shape (e,)
        Of the exchanges.
    anchor : ndarray of int64, shape (e,)
        With which anchor, by its index in the scenario.
    flight_s : ndarray, shape (e, runs)
        Time of flight as the timestamps of the exchange give it; NaN where it was lost.
    gap_db : ndarray, shape (e, runs)
        Receive power minus first-path power.
    blocked : ndarray of bool, shape (e, runs)
        Whether something really stood in the way.
    end : ndarray of int64, shape (runs,)
        When each run ended; what lies behind belongs to none.
    closest_m : ndarray, shape (runs,)
        Least free space between robot and people until then; inf where there are none.
    """

    stamps: Stamps
    truth: Array
    wheels: Array
    imu_stamps: Stamps
    yaw_rate: Array
    uwb_stamps: Stamps
    anchor: Stamps
    flight_s: Array
    gap_db: Array
    blocked: NDArray[np.bool_]
    end: Stamps
    closest_m: Array

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return len(self.end)

    @property
    def counts(self) -> NDArray[np.bool_]:
        """Which of `stamps` belong to each run, shape (k, runs)."""
        return np.asarray(self.stamps[:, None] <= self.end)

    def truth_at(self, stamps: Stamps) -> Array:
        """Return the true positions at times of one's own for each run.

        Parameters
        ----------
        stamps : ndarray of int64, shape (m, runs)

        Returns
        -------
        ndarray, shape (m, 2, runs)
            [m], linear between the stamps and held beyond them.
        """
        after = np.clip(np.searchsorted(self.stamps, stamps), 1, len(self.stamps) - 1)
        begin, end = self.stamps[after - 1], self.stamps[after]
        share = np.clip((stamps - begin) / (end - begin), 0.0, 1.0)[:, None]
        runs = np.arange(self.runs)
        before = self.truth[after - 1, :2, runs].transpose(0, 2, 1)
        behind = self.truth[after, :2, runs].transpose(0, 2, 1)
        return np.asarray(before + share * (behind - before))
