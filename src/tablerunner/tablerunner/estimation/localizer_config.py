"""Settings of the localiser."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.estimation.alignment import AlignmentConfig
from tablerunner.estimation.compass import CompassConfig
from tablerunner.estimation.estimator import EstimatorConfig
from tablerunner.estimation.registry import ESTIMATORS
from tablerunner.estimation.uwb_health import UwbHealthConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.types import PoseSample
from tablerunner.uwb import PositionerConfig

INITIAL_POSE_SOURCE = 'initialpose'


def _patient_positioner() -> PositionerConfig:
    # Slow modules take half a second for a round of four anchors; a fast round ends by itself.
    return PositionerConfig(epoch=0.6)


@dataclass(frozen=True)
class LocalizerConfig(Config):
    """Everything that fusion_node and replay let a user set about estimation."""

    estimator: str = parameter(
        'ekf', description='Which estimator runs', choices=tuple(ESTIMATORS), dynamic=True
    )
    tag_position: tuple[float, ...] = parameter(
        (0.0, 0.0, 1.1),
        unit='m',
        description='Tag antenna in base_link: x, y, z',
        low=-5.0,
        high=5.0,
    )
    initial_pose: tuple[float, ...] = parameter(
        (), description='x [m], y [m], heading [rad] at the start; empty: found by driving'
    )
    initial_pose_std: tuple[float, ...] = parameter(
        (0.1, 0.1, 0.1), description='Standard deviations of initial_pose', above=0.0, high=10.0
    )
    history: float = parameter(
        1.0, unit='s', description='How late a measurement may come', low=0.1, high=10.0
    )
    max_ahead: float = parameter(
        0.2,
        unit='s',
        description='How far a measurement may be ahead of odometry',
        low=0.0,
        high=2.0,
    )
    max_speed: float = parameter(
        3.0,
        unit='m/s',
        description='Odometry faster than this counts as a jump',
        above=0.0,
        high=50.0,
    )
    max_turn_rate: float = parameter(
        10.0,
        unit='rad/s',
        description='Odometry turning faster counts as a jump',
        above=0.0,
        high=100.0,
    )
    lost_window: float = parameter(
        2.0,
        unit='s',
        description='Time over which measurements that contradict the pose are counted',
        above=0.0,
        high=60.0,
        dynamic=True,
    )
    lost_nis: float = parameter(
        4.0,
        description=(
            'Mean normalised innovation squared over that time from which the robot counts as '
            'lost; a range that is too long counts for little, since something may be in the way'
        ),
        above=1.0,
        high=1000.0,
        dynamic=True,
    )
    lost_silence: float = parameter(
        20.0,
        unit='s',
        description='Time without any accepted measurement after which the robot counts as lost',
        above=0.0,
        high=3600.0,
        dynamic=True,
    )
    lost_doubt: float = parameter(
        8.0,
        unit='s',
        description='Time over which ranges are short again and again until it counts as lost',
        above=0.0,
        high=3600.0,
        dynamic=True,
    )
    health: UwbHealthConfig = parameter(
        factory=UwbHealthConfig, description='When odometry alone carries the pose'
    )
    filter: EstimatorConfig = parameter(factory=EstimatorConfig, description='Noise and gates')
    positioner: PositionerConfig = parameter(
        factory=_patient_positioner,
        description='How ranges become positions, for kf and ddf; tag_position gives the height',
    )
    compass: CompassConfig = parameter(
        factory=CompassConfig, description='The magnetic field as a source of heading'
    )
    alignment: AlignmentConfig = parameter(
        factory=AlignmentConfig, description='How the start is found'
    )

    @property
    def given_pose(self) -> PoseSample | None:
        """The pose of `initial_pose`, without a stamp; None where it is to be found."""
        if not self.initial_pose:
            return None
        x, y, heading = self.initial_pose
        covariance = np.diag(np.square(self.initial_pose_std))
        return PoseSample(0, Pose2(x, y, heading), covariance, INITIAL_POSE_SOURCE)

    def check(self) -> None:
        """Check the lengths of the lists."""
        if len(self.tag_position) != 3:
            raise ConfigError('tag_position', self.tag_position, '3 numbers: x, y, z [m]')
        if len(self.initial_pose) not in (0, 3):
            raise ConfigError(
                'initial_pose', self.initial_pose, 'nothing, or 3 numbers: x [m], y [m], yaw [rad]'
            )
        if len(self.initial_pose_std) != 3:
            raise ConfigError('initial_pose_std', self.initial_pose_std, '3 numbers')
