"""Parameters of sim_bridge."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2


@dataclass(frozen=True)
class BridgeConfig(Config):
    """What to simulate, how fast, and how frames and joints are called."""

    scenario: str = parameter(description='path of the scenario file')
    seed: int = parameter(0, description='seed of every random choice', low=0)
    real_time_factor: float = parameter(
        1.0,
        description='simulated seconds per second, at most: a slow machine falls behind',
        above=0.0,
        high=20.0,
    )
    start: tuple[float, ...] = parameter(
        (),
        description='x, y, heading of the robot in map at the start; the scenario says when empty',
        unit='m, m, rad',
    )
    robots: int = parameter(
        0,
        description=(
            "how many of the scenario's robots take part, each in its namespace; "
            '0: the one at the start, without one'
        ),
        low=0,
        high=10,
    )
    map_frame: str = parameter('map', description='frame of ground truth and people')
    base_frame: str = parameter('base_link', description='frame of the robot')
    imu_frame: str = parameter('imu_link', description='frame of IMU and magnetometer')
    tag_frame: str = parameter('uwb_tag', description='frame of the UWB tag antenna')
    camera_frame: str = parameter(
        'ceiling_camera', description='frame of the camera under the ceiling'
    )
    left_joint: str = parameter('left_wheel_joint', description='name of the left wheel joint')
    right_joint: str = parameter('right_wheel_joint', description='name of the right wheel joint')
    cmd_vel_type: str = parameter(
        'twist', description='type of cmd_vel', choices=('twist', 'twist_stamped')
    )

    def check(self) -> None:
        """Refuse a start that is no pose, and one for several robots."""
        if len(self.start) not in (0, 3):
            raise ConfigError('start', list(self.start), 'no value, or x, y and heading')
        if self.start and self.robots:
            raise ConfigError(
                'start', list(self.start), "no value: each of robots has the scenario's"
            )

    @property
    def start_pose(self) -> Pose2 | None:
        """Where base_link stands at the start; None where the scenario says."""
        return Pose2(*self.start) if self.start else None
