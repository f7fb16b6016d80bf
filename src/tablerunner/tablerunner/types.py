"""Frozen records that pass between the parts: what was measured, what is believed.

Stamps are integer nanoseconds of measurement time. Units are SI, angles counter-clockwise, frames
as in REP-105. A value that is not known is NaN (or 0 for a variance, where a field says so).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.pose import Pose2

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_NO_VECTOR: Vector = np.empty(0)
_NO_MATRIX: Matrix = np.empty((0, 0))

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""


def seconds(duration_ns: int) -> float:
    """Return a duration in nanoseconds as seconds."""
    return duration_ns / NANOSECONDS


def nanoseconds(duration_s: float) -> int:
    """Return a duration in seconds as the nearest whole nanosecond."""
    return round(duration_s * NANOSECONDS)


class LosState(IntEnum):
    """Whether the straight line between tag and anchor was free (values as in UwbRange.msg)."""

    UNKNOWN = 0
    LOS = 1
    NLOS = 2


@dataclass(frozen=True, slots=True)
class ExchangeSample:
    """One double-sided two-way ranging exchange, as read from the radio.

    The six times are 40-bit counters of `uwb.ranging.TICK_S` seconds: ``poll_tx``, ``response_rx``
    and ``final_tx`` on the tag's clock, ``poll_rx``, ``response_tx`` and ``final_rx`` on the
    anchor's.
    """

    stamp: int
    anchor_id: str
    tag_id: str
    sequence: int
    poll_tx: int
    poll_rx: int
    response_tx: int
    response_rx: int
    final_tx: int
    final_rx: int
    rx_power_dbm: float = float('nan')
    first_path_power_dbm: float = float('nan')


@dataclass(frozen=True, slots=True)
class RangeSample:
    """A distance between tag antenna and anchor antenna [m]."""

    stamp: int
    anchor_id: str
    tag_id: str
    sequence: int
    range_m: float
    variance_m2: float = 0.0  # 0: unknown
    raw_range_m: float = float('nan')  # before calibration
    rx_power_dbm: float = float('nan')
    first_path_power_dbm: float = float('nan')
    los: LosState = LosState.UNKNOWN
    nlos_probability: float = float('nan')


@dataclass(frozen=True, slots=True)
class Anchor:
    """A UWB anchor at a known place in the map."""

    anchor_id: str
    position: tuple[float, float, float]  # [m] in map
    bias_m: float = 0.0  # what it still reads too long after calibration
    position_variance_m2: float = 0.0


@dataclass(frozen=True, slots=True)
class WheelSample:
    """Angles and speeds of both drive wheels, forward positive; NaN where not measured.

    `further` holds the same four numbers of each further pair, of a robot with several driven
    wheels on a side.
    """

    stamp: int
    left_angle_rad: float
    right_angle_rad: float
    left_speed_rad_s: float = float('nan')
    right_speed_rad_s: float = float('nan')
    further: tuple[tuple[float, float, float, float], ...] = ()

    @property
    def angles_rad(self) -> tuple[float, ...]:
        """Angles of left and right wheel, pair after pair."""
        more = [number for pair in self.further for number in pair[:2]]
        return (self.left_angle_rad, self.right_angle_rad, *more)

    @property
    def speeds_rad_s(self) -> tuple[float, ...]:
        """Speeds of left and right wheel, pair after pair."""
        more = [number for pair in self.further for number in pair[2:]]
        return (self.left_speed_rad_s, self.right_speed_rad_s, *more)


@dataclass(frozen=True, slots=True)
class ImuSample:
    """What of an IMU a robot on a flat floor can use, in base_link axes."""

    stamp: int
    yaw_rate_rad_s: float
    forward_acceleration_m_s2: float = float('nan')
    lateral_acceleration_m_s2: float = float('nan')
    yaw_rad: float = float('nan')  # NaN: the IMU gives no orientation
    yaw_rate_variance: float = 0.0  # [rad^2/s^2]; 0: unknown


@dataclass(frozen=True, slots=True)
class MagneticSample:
    """Magnetic field in base_link axes [T]."""

    stamp: int
    field_x_t: float
    field_y_t: float
    field_z_t: float


@dataclass(frozen=True, slots=True)
class HeadingSample:
    """A heading of base_link in map from one source, as from a compass."""

    stamp: int
    heading_rad: float
    variance: float  # [rad^2]
    source: str


@dataclass(frozen=True, slots=True)
class OdometrySample:
    """Pose and velocity in the odom frame, smooth and drifting."""

    stamp: int
    pose: Pose2  # base_link in odom
    linear_m_s: float
    angular_rad_s: float
    pose_covariance: Matrix = field(default_factory=lambda: np.zeros((3, 3)))
    twist_covariance: Matrix = field(default_factory=lambda: np.zeros((2, 2)))


@dataclass(frozen=True, slots=True)
class PoseSample:
    """A pose or position in the map from one source: a UWB fix, the camera, a user's click.

    A fix without heading has ``covariance[2, 2] = inf`` (messages: a variance of at least
    `UNKNOWN_YAW_VARIANCE`).
    """

    stamp: int
    pose: Pose2
    covariance: Matrix  # (3, 3): x, y, heading
    source: str = ''
    point: tuple[float, float] = (0.0, 0.0)  # [m] in base_link: what stands there, as a tag


UNKNOWN_YAW_VARIANCE = float(np.pi**2 / 3.0)
"""Variance of a heading of which nothing is known (uniform over a turn) [rad^2]."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageSample:
    """A colour picture; its stamp is the middle of the exposure."""

    stamp: int
    pixels: NDArray[np.uint8]  # (height, width, 3): blue, green, red


@dataclass(frozen=True, slots=True)
class Lens:
    """What a pinhole camera with the distortion 'plumb_bob' does to rays (sensor_msgs/CameraInfo).

    Pixel (0, 0) is the middle of the one in the upper left corner; x to the right, y down.
    """

    width: int  # [pixel]
    height: int  # [pixel]
    focal: tuple[float, float]  # fx, fy [pixel]
    centre: tuple[float, float]  # cx, cy [pixel]
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    # k1, k2, p1, p2, k3


@dataclass(frozen=True, slots=True)
class UltrasonicSample:
    """Distance from one ultrasonic sensor to the nearest echo [m]; inf where nothing echoed."""

    stamp: int
    sensor: str  # frame of the sensor, e.g. ultrasonic_left
    range_m: float
    min_range_m: float
    max_range_m: float
    field_of_view_rad: float


@dataclass(frozen=True, slots=True)
class PersonSample:
    """Where a person with a tag is and how the person walks, along the axes of base_link."""

    stamp: int
    tag_id: str
    position: tuple[float, float]  # of the tag [m]
    velocity: tuple[float, float]  # over the floor [m/s]
    covariance: Matrix  # (4, 4): position and velocity; inf: a velocity that is not known


@dataclass(frozen=True, slots=True)
class Velocity:
    """Velocity of a differential drive: forward [m/s] and turn rate [rad/s]."""

    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0


class Estimate(NamedTuple):
    """What an estimator believes at one stamp.

    The first three states are always x, y [m] and heading [rad] of base_link in map; what follows
    is the estimator's own (its ``state_names``).
    """

    stamp: int
    mean: Vector  # (n,)
    covariance: Matrix  # (n, n)
    twist: tuple[float, float] = (0.0, 0.0)  # forward [m/s] and turn rate [rad/s], last step
    memory: tuple[float, ...] = ()  # running statistics that the estimator keeps for itself
    carried: object = None  # what else it keeps: the particles of a particle filter

    @property
    def pose(self) -> Pose2:
        """Pose of base_link in map."""
        return Pose2(float(self.mean[0]), float(self.mean[1]), float(self.mean[2]))

    @property
    def pose_covariance(self) -> Matrix:
        """Covariance of x, y, heading, shape (3, 3)."""
        return self.covariance[:3, :3]


@dataclass(frozen=True, slots=True)
class Refusal:
    """A measurement that was not used, and why; counted and shown on /diagnostics."""

    stamp: int
    source: str  # topic-like name: uwb/ranges, joint_states ...
    key: str  # which of that source: an anchor id; may be empty
    reason: str  # a short phrase that stays the same for the same cause, so that it can be counted


class Innovation(NamedTuple):
    """What one measurement did to the estimate, or why it was refused."""

    stamp: int
    source: str  # topic-like name: uwb/ranges, odom, initialpose ...
    key: str  # which of that source: an anchor id; may be empty
    accepted: bool
    reason: str  # empty when accepted plainly
    innovation: Vector = _NO_VECTOR
    covariance: Matrix = _NO_MATRIX  # S
    nis: float = float('nan')
    gate: float = float('nan')
    considered: bool = True  # false: not compared with the estimate, so it says nothing about it
