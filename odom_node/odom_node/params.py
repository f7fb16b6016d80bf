"""Parameters of odom_node beside those of the core and of tablerunner_ros."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.messages.wheels import LEFT_JOINT, RIGHT_JOINT


@dataclass(frozen=True)
class OdomNodeConfig(Config):
    """Names of joints and frames, how the IMU is mounted, and how soon silence is an error."""

    left_joints: tuple[str, ...] = parameter(
        (LEFT_JOINT,),
        description='Names in joint_states of the drive wheels on the left, one or more',
    )
    right_joints: tuple[str, ...] = parameter(
        (RIGHT_JOINT,), description='The same on the right, as many'
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
    imu_tilt: tuple[float, ...] = parameter(
        (0.0, 0.0),
        unit='rad',
        description="Roll and pitch of the IMU's frame in base_link: upside down is [3.14159, 0]",
        low=-3.15,
        high=3.15,
    )
    imu_from_tf: bool = parameter(
        False,
        description=(
            'Whether tf_static says how the IMU is mounted, by the frame of its messages, instead '
            'of imu_heading and imu_tilt'
        ),
    )
    silence: float = parameter(
        0.5,
        unit='s',
        description='Silence of wheels or IMU after which diagnostics report it',
        above=0.0,
        high=60.0,
    )

    def check(self) -> None:
        """Want as many wheels left as right, each once, and two angles."""
        joints = [*self.left_joints, *self.right_joints]
        if not self.left_joints or not all(joints):
            raise ConfigError('left_joints', list(self.left_joints), 'one name or more')
        if len(self.right_joints) != len(self.left_joints):
            expected = f'as many names as left_joints, {len(self.left_joints)}'
            raise ConfigError('right_joints', list(self.right_joints), expected)
        if len(set(joints)) != len(joints):
            raise ConfigError('right_joints', list(self.right_joints), 'each joint named once')
        if len(self.imu_tilt) != 2:
            raise ConfigError('imu_tilt', list(self.imu_tilt), 'roll and pitch, two numbers')
