"""Simulated ultrasonic sensors, fired one after another."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.geometry.circles import cast_rays_at_circles
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.simulation.truth import PersonState, RobotState
from tablerunner.types import UltrasonicSample

Array = NDArray[np.float64]

_RAYS = 13  # across the cone
_CORNER_M = 0.04  # so near to an edge a thing scatters to all sides


class Sonar:
    """Five cones against everything that is at least as high as the sensors sit.

    Each cone is a fan of rays. A ray echoes from a flat thing when it meets it steeply enough
    (beyond ``critical_incidence`` it is mirrored away), always near a corner, and from people and
    other robots. The nearest echo counts; nearer than ``min_range`` it reads ``min_range``; none
    reads inf.
    """

    def __init__(self, scenario: Scenario, random: np.random.Generator) -> None:
        self._errors = scenario.sensors.ultrasonic
        self._mounts = scenario.robot.ultrasonics
        self._random = random
        height = scenario.robot.ultrasonic_height
        parts = [o.segments for o in scenario.outlines if o.height_m >= height]
        segments = np.concatenate(parts) if parts else np.empty((0, 2, 2))
        self._start = segments[:, 0]
        self._along = segments[:, 1] - segments[:, 0]
        self._length = np.sqrt(np.sum(self._along**2, axis=1))
        half = self._errors.field_of_view / 2
        self._fan = np.linspace(-half, half, _RAYS)
        self._least_sine = math.cos(self._errors.critical_incidence)
        self._turn = 0

    def fire(
        self, stamp: int, pose: Pose2, people: Sequence[PersonState | RobotState]
    ) -> UltrasonicSample:
        """Return what the next sensor in turn hears, with base_link at `pose` in map."""
        mount = self._mounts[self._turn]
        self._turn = (self._turn + 1) % len(self._mounts)
        errors = self._errors
        at = pose @ mount.pose
        echo = self._echo(at, people)
        chance, other, where = self._random.random(3)
        noise = float(self._random.standard_normal()) * errors.std
        heard = echo + noise if echo <= errors.max_range else math.inf
        if chance < errors.missing_probability:
            heard = math.inf
        if other < errors.false_probability:
            span = errors.max_range - errors.min_range
            heard = min(heard, errors.min_range + float(where) * span)
        if math.isfinite(heard):
            heard = min(max(heard, errors.min_range), errors.max_range)
        return UltrasonicSample(
            stamp,
            mount.frame,
            heard,
            errors.min_range,
            errors.max_range,
            errors.field_of_view,
        )

    def _echo(self, at: Pose2, people: Sequence[PersonState | RobotState]) -> float:
        """Return the distance of the nearest echo before any error [m]; inf for none."""
        courses = at.heading + self._fan
        ray_x, ray_y = np.cos(courses)[:, None], np.sin(courses)[:, None]
        nearest = math.inf
        if len(self._start):
            off_x = (self._start[:, 0] - at.x)[None]
            off_y = (self._start[:, 1] - at.y)[None]
            along_x, along_y = self._along[None, :, 0], self._along[None, :, 1]
            determinant = ray_x * along_y - ray_y * along_x
            safe = np.where(np.abs(determinant) < 1e-12, 1e-12, determinant)
            distance = (off_x * along_y - off_y * along_x) / safe
            share = (off_x * ray_y - off_y * ray_x) / safe
            hit = (distance >= 0) & (share >= 0) & (share <= 1)
            distance = np.where(hit, distance, np.inf)
            first = np.argmin(distance, axis=1)  # what stands behind is not reached
            rays = np.arange(_RAYS)
            reached = distance[rays, first]
            length = self._length[first]
            to_corner = np.minimum(share[rays, first], 1 - share[rays, first]) * length
            steep = np.abs(determinant[rays, first]) >= self._least_sine * length
            echoes = np.where(steep | (to_corner < _CORNER_M), reached, np.inf)
            nearest = float(np.min(echoes))
        if people:
            directions = np.concatenate([ray_x, ray_y], axis=1)
            centres = np.array([(person.pose.x, person.pose.y) for person in people])
            radii = np.array([person.radius_m for person in people])
            origins = np.broadcast_to([at.x, at.y], directions.shape)
            bodies = cast_rays_at_circles(origins, directions, centres, radii)
            if len(self._start):
                bodies = np.where(bodies <= reached, bodies, np.inf)
            nearest = min(nearest, float(np.min(bodies)))
        return nearest
