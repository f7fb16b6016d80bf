"""Round what stands between robot and person, along its contour (Lv 4.C)."""

from __future__ import annotations

import math

from tablerunner.control.contour import ContourConfig, ContourNavigator, Mode
from tablerunner.control.fuzzy.reactive import ReactiveConfig, ReactiveController
from tablerunner.control.fuzzy.readings import Readings
from tablerunner.control.limits import VelocityLimits
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

_BEGIN_S = 0.22  # in the way for so long: a false echo lasts until its sensor fires again, 0.15 s
_END_S = 0.5  # the way has been free for so long
_MOVED_M = 1.0  # a target that has moved so far is another one


class PersonDetour:
    """Takes over while something is in the way, and hands back once the way is free.

    Parameters
    ----------
    limits : VelocityLimits
    mounts : tuple of Pose2
        Of the five sensors, in base_link.
    """

    def __init__(self, limits: VelocityLimits, mounts: tuple[Pose2, ...]) -> None:
        reactive = ReactiveConfig()
        self._navigator = ContourNavigator(
            ContourConfig(),
            ReactiveController(
                reactive.replace(min_speed=min(reactive.min_speed, limits.max_speed)), limits
            ),
            mounts,
        )
        self.reset()

    def reset(self) -> None:
        """Go round nothing."""
        self._target: tuple[float, float] | None = None
        self._seen_s = 0.0
        self._free_s = 0.0

    def step(
        self,
        pose: Pose2,
        dt: float,
        target: tuple[float, float],
        others: Readings,
        in_the_way: bool,
    ) -> Velocity | None:
        """Return what to drive round it; None: nothing is gone round.

        Parameters
        ----------
        pose : Pose2
            base_link in odom.
        dt : float
            Since the last step [s].
        target : tuple of float
            Where to, in odom [m].
        others : Readings
            Without the person.
        in_the_way : bool
            Whether something is heard in the straight way to the target.
        """
        if self._target is None:
            self._seen_s = self._seen_s + dt if in_the_way else 0.0
            if self._seen_s < _BEGIN_S:
                return None
            self._begin(target)
        step = self._navigator.step(others, pose, dt)
        free = step.mode is Mode.APPROACH and not in_the_way
        self._free_s = self._free_s + dt if free else 0.0
        if self._free_s >= _END_S:
            self.reset()
            return None
        if step.mode is not Mode.CONTOUR and math.dist(self._target or target, target) > _MOVED_M:
            self._begin(target)
        return step.velocity

    def _begin(self, target: tuple[float, float]) -> None:
        self._target = target
        self._navigator.go(target)
