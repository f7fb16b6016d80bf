"""Everything that a replay needs to know of the robot: the nodes' own settings, in one record."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tablerunner.bags.streams import Names
from tablerunner.config import Config, parameter
from tablerunner.estimation import LocalizerConfig
from tablerunner.messages.wheels import LEFT_JOINT, RIGHT_JOINT
from tablerunner.odometry import OdometerConfig
from tablerunner.scenario.scenario import Scenario
from tablerunner.types import Anchor
from tablerunner.uwb import PositionerConfig, RangerConfig


@dataclass(frozen=True)
class ReplayConfig(Config):
    """Settings of odom_node, uwb_driver and fusion_node, as far as they change the estimate."""

    ranger: RangerConfig = parameter(factory=RangerConfig, description='As of uwb_driver')
    positioner: PositionerConfig = parameter(
        factory=PositionerConfig, description='As of uwb_driver'
    )
    odometer: OdometerConfig = parameter(factory=OdometerConfig, description='As of odom_node')
    localizer: LocalizerConfig = parameter(
        factory=LocalizerConfig, description='As of fusion_node'
    )
    left_joints: tuple[str, ...] = parameter(
        (LEFT_JOINT,), description='Joints of the left wheels, as of odom_node'
    )
    right_joints: tuple[str, ...] = parameter(
        (RIGHT_JOINT,), description='Joints of the right wheels, as of odom_node'
    )
    imu_heading: float = parameter(
        0.0, description="Heading of the IMU's frame in base_link", unit='rad'
    )
    imu_tilt: tuple[float, float] = parameter(
        (0.0, 0.0), description="Roll and pitch of the IMU's frame in base_link", unit='rad'
    )
    map_frame: str = parameter('map', description='Frame of anchors and poses; empty: any')
    odom_frame: str = parameter('odom', description='Frame of odom; empty: any')
    base_frame: str = parameter('base_link', description='Frame of the robot; empty: any')
    namespace: str = parameter('', description='Namespace of the robot in the bag; empty: none')
    stamp_tolerance: float = parameter(
        0.5,
        description='How far a stamp may be ahead of the time of reception',
        unit='s',
        low=0.0,
        high=60.0,
    )
    fixes: bool = parameter(False, description='Whether UWB-only fixes are computed too')
    keep: bool = parameter(
        False, description='Whether every step of the estimator is kept, as smoothing needs it'
    )

    @property
    def names(self) -> Names:
        """What the messages are expected to be named."""
        return Names(
            self.left_joints,
            self.right_joints,
            self.imu_heading,
            self.map_frame,
            self.odom_frame,
            self.base_frame,
            self.imu_tilt,
        )

    @classmethod
    def from_scenario(cls, scenario: Scenario) -> ReplayConfig:
        """Return the settings for the robot and the anchors of a scenario."""
        robot = scenario.robot
        config = cls()
        odometer = replace(
            config.odometer,
            wheels=replace(
                config.odometer.wheels, wheel_radius=robot.wheel_radius, track=robot.track
            ),
        )
        return replace(
            config,
            odometer=odometer,
            positioner=replace(config.positioner, tag_height=robot.tag_position[2]),
            localizer=replace(config.localizer, tag_position=robot.tag_position),
        ).with_anchors(tuple(place.anchor for place in scenario.anchors))

    def with_anchors(self, anchors: tuple[Anchor, ...]) -> ReplayConfig:
        """Return the same settings with these anchors (no calibration of their ranges)."""
        return replace(
            self,
            ranger=replace(
                self.ranger,
                anchor_ids=tuple(anchor.anchor_id for anchor in anchors),
                anchor_positions=tuple(
                    float(value) for anchor in anchors for value in anchor.position
                ),
                anchor_biases=(),
                anchor_scales=(),
            ),
        )
