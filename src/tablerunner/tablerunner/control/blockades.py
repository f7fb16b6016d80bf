"""Where the robot was held up again and again: what stands there is there to stay.

People move on within seconds; a trolley in a door does not. A robot that forgets every place that
it could not pass tries them in turn for ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.control.floor_map import Disc
from tablerunner.types import nanoseconds

_ONCE_NS = nanoseconds(8.0)


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
        self._met: list[tuple[int, Disc]] = []

    def clear(self) -> None:
        """Forget all."""
        self._met = []

    def add(self, disc: Disc, stamp: int) -> None:
        """Take note that something was in the way at `disc` at `stamp` [ns].

        The same place again within seconds is the same time still.
        """
        same = self._same(disc, self._met)
        if same and stamp - same[-1][0] < _ONCE_NS:
            return
        self._met = [*self._remembered(stamp), (stamp, disc)]

    def times(self, disc: Disc, stamp: int) -> int:
        """Return how often the robot was held up near a place, at `stamp` [ns]."""
        return len(self._same(disc, self._remembered(stamp)))

    def standing(self, stamp: int) -> tuple[Disc, ...]:
        """Return what is taken to stay, as met last, at `stamp` [ns]."""
        config, found = self.config, []
        left = self._remembered(stamp)
        while left:
            last, disc = left[-1]
            same = self._same(disc, left)
            if len(same) >= config.times and last - same[0][0] >= nanoseconds(config.span):
                found.append(disc)
            left = [met for met in left if met not in same]
        return tuple(found)

    def _remembered(self, stamp: int) -> list[tuple[int, Disc]]:
        oldest = stamp - nanoseconds(self.config.memory)
        return [met for met in self._met if met[0] > oldest]

    def _same(self, disc: Disc, among: list[tuple[int, Disc]]) -> list[tuple[int, Disc]]:
        near = self.config.near
        return [met for met in among if math.hypot(met[1].x - disc.x, met[1].y - disc.y) <= near]
