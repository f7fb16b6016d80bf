"""Parameters of sensor_frames."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.geometry.frame_tree import Link
from tablerunner.geometry.rotation import rotation_of_rpy

_NUMBERS = 6


@dataclass(frozen=True)
class SensorFramesConfig(Config):
    """Where the sensors sit on the robot."""

    base_frame: str = parameter('base_link', description='Frame of the robot')
    frames: tuple[str, ...] = parameter(
        (), description='Frames of the sensors: imu_link, uwb_tag, ultrasonic_front ...'
    )
    poses: tuple[float, ...] = parameter(
        (),
        unit='m, rad',
        description='x, y, z, roll, pitch, yaw of each frame in its parent, one after the other',
    )
    parents: tuple[str, ...] = parameter(
        (), description='Parent of each frame; empty: base_frame for all'
    )

    def check(self) -> None:
        """Want six numbers for each frame, each frame once, and no frame in itself."""
        if len(self.poses) != _NUMBERS * len(self.frames):
            wanted = _NUMBERS * len(self.frames)
            expected = f'{wanted} numbers: x, y, z, roll, pitch, yaw for each of frames'
            raise ConfigError('poses', list(self.poses), expected)
        if len(set(self.frames)) != len(self.frames) or not all(self.frames):
            raise ConfigError('frames', list(self.frames), 'each frame once, and named')
        if self.base_frame in self.frames:
            raise ConfigError('frames', list(self.frames), f'no {self.base_frame} among them')
        if self.parents and len(self.parents) != len(self.frames):
            expected = f'none, or one for each of frames: {len(self.frames)}'
            raise ConfigError('parents', list(self.parents), expected)
        if any(child == parent for child, parent in zip(self.frames, self.parents, strict=False)):
            raise ConfigError('parents', list(self.parents), 'no frame as its own parent')

    @property
    def links(self) -> tuple[Link, ...]:
        """Each frame in its parent."""
        parents = self.parents or (self.base_frame,) * len(self.frames)
        links = []
        for k, (parent, child) in enumerate(zip(parents, self.frames, strict=True)):
            x, y, z, roll, pitch, yaw = self.poses[_NUMBERS * k : _NUMBERS * (k + 1)]
            links.append(Link(parent, child, rotation_of_rpy(roll, pitch, yaw), (x, y, z)))
        return tuple(links)
