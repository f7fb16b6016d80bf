"""What an estimator believed along a drive, and what it made of each measurement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation import Localizer, LocalizerConfig
from tablerunner.experiments.drive import Drive
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.types import (
    Anchor,
    ExchangeSample,
    ImuSample,
    Innovation,
    Matrix,
    OdometrySample,
    RangeSample,
    WheelSample,
)
from tablerunner.uwb import Ranger, RangerConfig

Sensed = OdometrySample | RangeSample
"""What the localiser is given."""


@dataclass(frozen=True)
class Belief:
    """Poses that an estimator believed at each odometry, and its innovations.

    Attributes
    ----------
    stamps : ndarray of int64, shape (k,)
        Of the estimates [ns].
    poses : ndarray, shape (k, 3)
        x, y [m], heading [rad] of base_link.
    covariances : ndarray, shape (k, 3, 3)
        Of the poses.
    innovations : tuple of Innovation
        In order.
    """

    stamps: NDArray[np.int64]
    poses: Matrix
    covariances: Matrix
    innovations: tuple[Innovation, ...] = ()


def sense(drive: Drive, ranger: RangerConfig, odometer: OdometerConfig) -> tuple[Sensed, ...]:
    """Return what uwb_driver and odom_node make of a drive, in the order of the drive.

    It is the same for every estimator, and so done once.
    """
    ranging, odometry = Ranger(ranger), Odometer(odometer)
    sensed: list[Sensed] = []
    for sample in drive.samples:
        if isinstance(sample, ImuSample):
            odometry.add_imu(sample)
        elif isinstance(sample, ExchangeSample):
            ranged = ranging.add(sample)
            if isinstance(ranged, RangeSample):
                sensed.append(ranged)
        elif isinstance(sample, WheelSample):
            moved = odometry.add_wheels(sample)
            if isinstance(moved, OdometrySample):
                sensed.append(moved)
    return tuple(sensed)


def believe(
    sensed: tuple[Sensed, ...], config: LocalizerConfig, anchors: tuple[Anchor, ...]
) -> Belief:
    """Run the localiser of fusion_node, and note its belief whenever odometry has come."""
    fusing = Localizer(config, anchors)
    stamps, poses, covariances = [], [], []
    innovations: list[Innovation] = []
    for sample in sensed:
        if isinstance(sample, RangeSample):
            innovations += fusing.add_range(sample).innovations
            continue
        innovations += fusing.add_odometry(sample).innovations
        estimate = fusing.estimate
        if estimate is not None:
            stamps.append(estimate.stamp)
            poses.append(estimate.mean[:3])
            covariances.append(estimate.pose_covariance)
    return Belief(
        np.array(stamps, dtype=np.int64),
        np.array(poses).reshape(-1, 3),
        np.array(covariances).reshape(-1, 3, 3),
        tuple(innovations),
    )


def estimated(
    drive: Drive,
    ranger: RangerConfig,
    odometer: OdometerConfig,
    localizer: LocalizerConfig,
) -> tuple[NDArray[np.int64], Matrix]:
    """Return stamps, (m,), and places, (m, 2), of what an estimator believed at each odometry.

    Everything goes through the code that the nodes run, in the order in which it was measured.
    """
    belief = believe(sense(drive, ranger, odometer), localizer, ranger.anchors)
    return belief.stamps, belief.poses[:, :2]
