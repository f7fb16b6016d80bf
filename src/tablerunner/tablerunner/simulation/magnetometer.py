"""The simulated magnetometer: the field of the earth, bent by the iron in the room."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.types import MagneticSample

Array = NDArray[np.float64]

_MU0_OVER_4PI = 1e-7  # [T m/A]
_NEAREST_M = 0.3  # inside the iron the dipole formula means nothing


class Magnetometer:
    """Reads the field of the earth plus a dipole for every box of iron, in base_link axes.

    A dipole m at distance r (unit vector u) adds mu0 / (4 pi r^3) (3 (m . u) u - m).
    """

    def __init__(self, scenario: Scenario, random: np.random.Generator) -> None:
        self._errors = scenario.sensors.magnetic
        self._random = random
        self._mount = scenario.robot.imu_position
        iron = [box for box in scenario.boxes if any(box.magnetic_moment)]
        self._places = np.array([(box.x, box.y, box.height / 2) for box in iron]).reshape(-1, 3)
        self._moments = np.array([box.magnetic_moment for box in iron]).reshape(-1, 3)
        self._hard_iron = random.standard_normal(3) * self._errors.hard_iron_std

    def field(self, place: Array) -> Array:
        """Return the field at a place in map, shape (3,), in map axes [T]."""
        errors = self._errors
        earth = np.array(
            [
                errors.horizontal * math.cos(errors.north),
                errors.horizontal * math.sin(errors.north),
                errors.vertical,
            ]
        )
        if len(self._places) == 0:
            return earth
        offset = place - self._places
        distance = np.maximum(np.sqrt(np.sum(offset**2, axis=1)), _NEAREST_M)[:, None]
        unit = offset / distance
        along = np.sum(self._moments * unit, axis=1)[:, None]
        dipoles = _MU0_OVER_4PI / distance**3 * (3 * along * unit - self._moments)
        return np.asarray(earth + dipoles.sum(axis=0))

    def read(self, stamp: int, pose: Pose2) -> MagneticSample:
        """Return a reading with base_link at `pose` in map."""
        at = pose @ Pose2(self._mount[0], self._mount[1])
        x, y, z = self.field(np.array([at.x, at.y, self._mount[2]]))
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        errors = self._hard_iron + self._errors.std * self._random.standard_normal(3)
        return MagneticSample(
            stamp,
            float(cos * x + sin * y + errors[0]),
            float(-sin * x + cos * y + errors[1]),
            float(z + errors[2]),
        )
