"""Where the robot was held up again and again: what stands there is there to stay.

People move on within seconds; a trolley in a door does not. A robot that forgets every place that
it could not pass tries them in turn for ever. A door through which people keep coming holds it up
as often; but not one of them stands before it for long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from tablerunner.config import Config, parameter
from tablerunner.control.floor_map import Disc
from tablerunner.types import nanoseconds

_ONCE_NS = nanoseconds(8.0)


@dataclass(frozen=True, slots=True)
class _Met:
    """Once that something was in the way: when last, where, and how long the robot stood [s]."""

    stamp: int
    disc: Disc
    stood_s: float


@dataclass(frozen=True)
class BlockadeConfig(Config):
    """When a place counts as blocked for good."""

    times: int = parameter(
        5, description='How often the robot was held up at a place', low=1, dynamic=True
    )
    span: float = parameter(
        180.0,
        description='From the first time to the last',
        unit='s',
        low=0.0,
        dynamic=True,
    )
    stood: float = parameter(
        15.0,
        description='Once at least the robot stood before it for so long without getting on',
        unit='s',
        low=0.0,
        dynamic=True,
    )
    near: float = parameter(
        0.6,
        description='Places that are not farther apart are the same',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    memory: float = parameter(
        300.0,
        description='A place where nothing held the robot up for longer is tried again',
        unit='s',
        above=0.0,
        dynamic=True,
    )


class Blockades:
    """Counts where the robot was held up."""

    def __init__(self, config: BlockadeConfig | None = None) -> None:
        self.config = config or BlockadeConfig()
        self._met: list[_Met] = []

    def clear(self) -> None:
        """Forget all."""
        self._met = []

    def add(self, disc: Disc, stamp: int, stood_s: float) -> None:
        """Take note that something was in the way at `disc` at `stamp` [ns].

        The same place again within seconds is the same time still. `stood_s` is how long the robot
        has stood before it by now [s].
        """
        met = self._remembered(stamp)
        same = self._same(disc, met)
        if same and stamp - same[-1].stamp < _ONCE_NS:
            stood_s = max(stood_s, same[-1].stood_s)
            self._met = [replace(one, stood_s=stood_s) if one is same[-1] else one for one in met]
            return
        self._met = [*met, _Met(stamp, disc, stood_s)]

    def times(self, disc: Disc, stamp: int) -> int:
        """Return how often the robot was held up near a place, at `stamp` [ns]."""
        return len(self._same(disc, self._remembered(stamp)))

    def standing(self, stamp: int) -> tuple[Disc, ...]:
        """Return what is taken to stay, as met last, at `stamp` [ns]."""
        found = []
        left = self._remembered(stamp)
        while left:
            same = self._same(left[-1].disc, left)
            if self._stays(same):
                found.append(left[-1].disc)
            left = [met for met in left if met not in same]
        return tuple(found)

    def _stays(self, same: list[_Met]) -> bool:
        config = self.config
        return (
            len(same) >= config.times
            and same[-1].stamp - same[0].stamp >= nanoseconds(config.span)
            and max(met.stood_s for met in same) >= config.stood
        )

    def _remembered(self, stamp: int) -> list[_Met]:
        oldest = stamp - nanoseconds(self.config.memory)
        return [met for met in self._met if met.stamp > oldest]

    def _same(self, disc: Disc, among: list[_Met]) -> list[_Met]:
        near = self.config.near
        return [
            met for met in among if math.hypot(met.disc.x - disc.x, met.disc.y - disc.y) <= near
        ]
