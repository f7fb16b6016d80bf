"""Parameters of odom_node beside those of the core and of tablerunner_ros."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter


@dataclass(frozen=True)
class OdomNodeConfig(Config):
    """Names of joints and frames, and how soon silence is an error."""

    left_joint: str = parameter(
        'left_wheel_joint', description='Name of the left drive wheel in joint_states'
    )
    right_joint: str = parameter(
        'right_wheel_joint', description='Name of the right drive wheel in joint_states'
    )
    odom_frame: str = parameter('odom', description='Frame in which the odometry is given')
    base_frame: str = parameter('base_link', description='Frame of the robot')
    publish_tf: bool = parameter(
        True, description='Whether the transform odom to base_link is published'
    )
    imu_heading: float = parameter(
        0.0,
        unit='rad',
        description="Heading of the IMU's frame in base_link",
        low=-3.15,
        high=3.15,
    )
    silence: float = parameter(
        0.5,
        unit='s',
        description='Silence of wheels or IMU after which diagnostics report it',
        above=0.0,
        high=60.0,
    )
