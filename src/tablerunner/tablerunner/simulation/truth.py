"""What really happened, which no sensor says: records that only a simulation can fill."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.geometry.pose import Pose2


@dataclass(frozen=True, slots=True)
class Truth:
    """Where the robot is and how it moves."""

    stamp: int
    pose: Pose2  # base_link in map
    linear_m_s: float
    angular_rad_s: float


@dataclass(frozen=True, slots=True)
class RangeTruth:
    """What lay between tag and anchor during an exchange, lost ones included."""

    stamp: int
    anchor_id: str
    sequence: int
    distance_m: float  # between the antennas
    blocked_by: str  # '', 'thing' (wall, table, box) or 'person'
    excess_m: float  # detour of the signal behind what blocks it
    lost: bool
    tag_id: str = ''


@dataclass(frozen=True, slots=True)
class PersonState:
    """Where a person is."""

    name: str
    pose: Pose2  # in map; heading: where the person looks
    speed_m_s: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class RobotState:
    """Where a robot is, as an obstacle for others."""

    name: str
    pose: Pose2  # base_link in map
    speed_m_s: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class Contact:
    """The robot touched something, or was touched; one record per touch, when it begins."""

    stamp: int
    kind: str  # 'wall', 'table', 'box', 'person' or 'robot'
    name: str
    robot_at_fault: bool
    closing_m_s: float  # speed of the robot towards it
    pose: Pose2  # of base_link in map
