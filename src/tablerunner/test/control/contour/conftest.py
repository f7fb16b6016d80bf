"""A robot with five sensors among straight walls, without any error."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control import sensor_mounts
from tablerunner.control.fuzzy import SENSORS, Readings
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import cast_rays
from tablerunner.scenario import RobotGeometry
from tablerunner.types import Velocity

_MOUNTS = sensor_mounts(RobotGeometry())
_FAN = np.linspace(-0.24, 0.24, 9)


class World:
    """Walls, shape (n, 2, 2); what is heard of them, and how a robot moves."""

    mounts = tuple(_MOUNTS[f'ultrasonic_{name}'] for name in SENSORS)

    @staticmethod
    def heard(pose: Pose2, walls: np.ndarray) -> Readings:
        """Return fresh readings: the nearest of nine rays of each cone, inf from 3 m on."""
        distances = []
        for mount in World.mounts:
            at = pose @ mount
            rays = at.heading + _FAN
            origins = np.tile([at.x, at.y], (len(rays), 1))
            directions = np.column_stack([np.cos(rays), np.sin(rays)])
            nearest = float(cast_rays(origins, directions, walls).min())
            distances.append(nearest if nearest < 3.0 else math.inf)
        return Readings(tuple(distances))

    @staticmethod
    def moved(pose: Pose2, velocity: Velocity, dt: float) -> Pose2:
        """Return where the robot is after `dt` seconds."""
        turn, way = velocity.angular_rad_s * dt, velocity.linear_m_s * dt
        return pose @ Pose2(way * math.cos(turn / 2), way * math.sin(turn / 2), turn)


@pytest.fixture
def world() -> World:
    return World()
