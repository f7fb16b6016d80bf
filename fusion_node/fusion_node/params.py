"""Parameters of fusion_node beside those of the core and of tablerunner_ros."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter


@dataclass(frozen=True)
class FusionNodeConfig(Config):
    """Frames, which poses are used, and how soon silence is an error."""

    map_frame: str = parameter('map', description='Frame of anchors and of the estimate')
    odom_frame: str = parameter('odom', description='Frame of the odometry')
    base_frame: str = parameter('base_link', description='Frame of the robot')
    publish_tf: bool = parameter(
        True, description='Whether the transform map to odom is published'
    )
    pose_sources: tuple[str, ...] = parameter(
        ('camera/pose',),
        description=(
            'Topics of poses that are fused: camera/pose, uwb/pose. The fix of uwb/pose holds '
            'nothing that uwb/ranges does not hold: use one of the two'
        ),
        choices=('camera/pose', 'uwb/pose'),
    )
    use_ranges: bool = parameter(True, description='Whether uwb/ranges is fused')
    imu_heading: float = parameter(
        0.0,
        unit='rad',
        description="Heading of the magnetometer's frame in base_link",
        low=-3.15,
        high=3.15,
    )
    silence: float = parameter(
        1.0,
        unit='s',
        description='Silence of odometry or ranges after which diagnostics report it',
        above=0.0,
        high=60.0,
    )
