"""Simulated ranging between tags that people wear and anchors on the robot."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.simulation.radio import Links, device_clock
from tablerunner.simulation.sight import Sight, person_blocks, wearer_blocks
from tablerunner.simulation.streams import stream
from tablerunner.simulation.truth import PersonState, RangeTruth
from tablerunner.types import ExchangeSample

Place = tuple[float, float, float]


class TagRadio:
    """Every tag with every anchor on the robot in turn; the same physics as `Radio`.

    Whoever stands between blocks the way, the wearer too where the body is in it.

    Attributes
    ----------
    anchors : tuple of AnchorMount
        Those on the robot.
    links : dict of str to Links
        Of each tag.
    count : int
        Pairs of tag and anchor; 0: there is nothing to range.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        errors = scenario.sensors.uwb
        self.anchors = scenario.robot.anchors
        self._people = scenario.people
        self._worn = [
            (index, person.tag)
            for index, person in enumerate(scenario.people)
            if person.tag is not None
        ]
        self._sight = Sight(scenario.outlines)
        ids = [anchor.id for anchor in self.anchors]
        clocks = {name: device_clock(errors, name, seed) for name in ids}
        self.links: dict[str, Links] = {}
        for _, tag in self._worn:
            self.links[tag.id] = Links(
                errors,
                tag.id,
                device_clock(errors, tag.id, seed),
                clocks,
                {name: stream(seed, f'uwb {tag.id} {name}') for name in ids},
            )
        self.count = len(self._worn) * len(self.anchors)
        self._turn = 0

    def exchange(
        self, stamp: int, pose: Pose2, people: Sequence[PersonState]
    ) -> tuple[ExchangeSample | None, RangeTruth]:
        """Return the next exchange, None when it was lost, and the truth about it.

        Parameters
        ----------
        stamp : int
        pose : Pose2
            base_link in map.
        people : sequence of PersonState
            Everybody, in the scenario's order.
        """
        turn, number = divmod(self._turn, len(self.anchors))
        self._turn = (self._turn + 1) % self.count
        (index, tag), anchor = self._worn[turn], self.anchors[number]
        worn = _at(people[index].pose, tag.position)
        antenna = _at(pose, anchor.position)
        blocked = self._blocked(index, worn, antenna, people)
        return self.links[tag.id].fly(stamp, anchor.id, math.dist(worn, antenna), blocked)

    def _blocked(
        self, wearer: int, worn: Place, antenna: Place, people: Sequence[PersonState]
    ) -> str:
        if self._sight.thing_blocks(worn, antenna):
            return 'thing'
        heights = [person.height for person in self._people]
        if wearer_blocks(worn, antenna, people[wearer], heights[wearer]):
            return 'person'
        others = [number for number in range(len(people)) if number != wearer]
        if person_blocks(worn, antenna, [people[i] for i in others], [heights[i] for i in others]):
            return 'person'
        return ''


def tag_place(person: PersonState, position: Place) -> Place:
    """Return where a worn tag is in map [m].

    Parameters
    ----------
    person : PersonState
    position : tuple
        As in `PersonTag`.
    """
    return _at(person.pose, position)


def _at(pose: Pose2, position: Place) -> Place:
    x, y = pose.transform(np.array(position[:2]))
    return float(x), float(y), position[2]
