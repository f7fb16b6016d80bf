"""Who touched whom."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tablerunner.scenario import Outline
from tablerunner.simulation.drive import Drive
from tablerunner.simulation.truth import Contact, PersonState, RobotState

Array = NDArray[np.float64]

_FAULT_M_S = 0.05  # a robot that moves at somebody faster than this has hit them
_APART_M = 0.02  # a touch has ended when the gap is this wide


class Bumper:
    """Compares the round footprint with everything in the room after each step."""

    def __init__(self, outlines: Sequence[Outline], radius_m: float) -> None:
        self._radius_m = radius_m
        self._owners = [outline for outline in outlines for _ in outline.segments]
        parts = [outline.segments for outline in outlines]
        segments = np.concatenate(parts) if parts else np.empty((0, 2, 2))
        self._start = segments[:, 0]
        self._along = segments[:, 1] - segments[:, 0]
        self._length2 = np.maximum(np.sum(self._along**2, axis=1), 1e-18)
        self._touching: set[tuple[str, str]] = set()
        # Nothing that stands still can be touched before the robot has driven this far.
        self._free_m = 0.0

    def step(
        self,
        stamp: int,
        drive: Drive,
        dt_s: float,
        movers: Sequence[PersonState | RobotState],
    ) -> tuple[Contact, ...]:
        """Return the touches that began in this step; holds the robot before what it touches."""
        speed = drive.linear_m_s
        contacts = self._things(stamp, drive, dt_s)
        contacts += self._movers(stamp, drive, speed, movers)
        return tuple(contacts)

    def _things(self, stamp: int, drive: Drive, dt_s: float) -> list[Contact]:
        self._free_m -= abs(drive.linear_m_s) * dt_s
        if self._free_m > 0.0 or len(self._start) == 0:
            return []
        offset = np.array([drive.pose.x, drive.pose.y]) - self._start
        share = np.clip(np.sum(offset * self._along, axis=1) / self._length2, 0.0, 1.0)
        away = offset - share[:, None] * self._along
        distances = np.sqrt(np.sum(away**2, axis=1))
        nearest = int(np.argmin(distances))
        gap = float(distances[nearest]) - self._radius_m
        self._free_m = gap - _APART_M
        owner = self._owners[nearest]
        key = (owner.kind, owner.name)
        if gap > 0.0:
            if gap > _APART_M:
                self._touching = {
                    pair for pair in self._touching if pair[0] in {'person', 'robot'}
                }
            return []
        course = drive.pose.heading
        towards = -(away[nearest] @ [math.cos(course), math.sin(course)])
        closing = drive.linear_m_s * float(towards) / max(float(distances[nearest]), 1e-9)
        if closing > 0.0:
            drive.block()
        if key in self._touching:
            return []
        self._touching.add(key)
        return [Contact(stamp, owner.kind, owner.name, True, max(closing, 0.0), drive.pose)]

    def _movers(
        self,
        stamp: int,
        drive: Drive,
        speed: float,
        movers: Sequence[PersonState | RobotState],
    ) -> list[Contact]:
        contacts = []
        for other in movers:
            dx, dy = other.pose.x - drive.pose.x, other.pose.y - drive.pose.y
            distance = math.hypot(dx, dy)
            gap = distance - self._radius_m - other.radius_m
            kind = 'robot' if isinstance(other, RobotState) else 'person'
            key = (kind, other.name)
            if gap > 0.0:
                if gap > _APART_M:
                    self._touching.discard(key)
                continue
            course = math.atan2(dy, dx) - drive.pose.heading
            closing = speed * math.cos(course)
            if closing > 0.0:
                drive.block()
            if key not in self._touching:
                self._touching.add(key)
                at_fault = closing > _FAULT_M_S
                contacts.append(
                    Contact(stamp, kind, other.name, at_fault, max(closing, 0.0), drive.pose)
                )
        return contacts
