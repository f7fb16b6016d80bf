"""Parameters of ceiling_camera beside those of the core and of tablerunner_ros."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter


@dataclass(frozen=True)
class CeilingCameraConfig(Config):
    """Frames and topics of the node, and how soon silence is an error."""

    map_frame: str = parameter('map', description='Frame of the poses')
    pose_topics: tuple[str, ...] = parameter(
        (),
        description=(
            "Where each robot's pose goes, in the order of marker.robots; empty: camera/pose for "
            'one robot, ROBOT/camera/pose for several'
        ),
    )
    silence: float = parameter(
        1.0,
        unit='s',
        description='Silence of the camera after which diagnostics report it',
        above=0.0,
        high=60.0,
    )
