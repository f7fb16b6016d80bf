"""Whose tag is looked for, from which anchors on the robot, and how its ranges are believed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.estimation.target_tracker import TargetTrackerConfig
from tablerunner.types import Matrix

PERSON_METHODS = ('tracker', 'component_wise')
LEAST_ANCHORS = 3

_LEAST_SPREAD_M = 0.05  # anchors nearer to one line than this do not tell left from right


@dataclass(frozen=True)
class PersonLocatorConfig(Config):
    """Where the anchors sit on the robot, and what is known of the tag."""

    tag_id: str = parameter('person', description='Tag of the person')
    tag_height: float = parameter(
        1.0, unit='m', description='Height of that tag over the floor', low=0.0, high=3.0
    )
    anchor_ids: tuple[str, ...] = parameter((), description='Names of the anchors on the robot')
    anchor_positions: tuple[float, ...] = parameter(
        (), unit='m', description='x, y, z of each in base_link, one after the other'
    )
    method: str = parameter(
        'tracker',
        description='tracker: a filter on the ranges; component_wise: Bae 9-15',
        choices=PERSON_METHODS,
    )
    direction_bias: tuple[float, ...] = parameter(
        (),
        description='Bias of the direction for component_wise (Bae 10), two numbers; empty: none',
        low=-2.0,
        high=2.0,
    )
    epoch: float = parameter(
        0.3,
        unit='s',
        description='Longest time that ranges are gathered for a first position',
        above=0.0,
        high=2.0,
        dynamic=True,
    )
    silence: float = parameter(
        0.6,
        unit='s',
        description='The tag is out of sight when no range was used for longer',
        above=0.0,
        high=5.0,
        dynamic=True,
    )
    forget: float = parameter(
        2.0,
        unit='s',
        description='After so long without a range a new first position is looked for',
        above=0.0,
        high=30.0,
        dynamic=True,
    )
    nlos_std: float = parameter(
        0.8,
        unit='m',
        description='Added deviation of a range that is surely NLOS: its excess lasts a while',
        low=0.0,
        high=10.0,
        dynamic=True,
    )
    tracker: TargetTrackerConfig = parameter(
        factory=TargetTrackerConfig, description='The filter on the ranges'
    )

    def check(self) -> None:
        """Check that anchors and positions belong together and tell a place."""
        count = len(self.anchor_ids)
        if not self.tag_id:
            raise ConfigError('tag_id', self.tag_id, 'a name')
        if len(self.anchor_positions) != 3 * count:
            raise ConfigError(
                'anchor_positions',
                self.anchor_positions,
                f'{3 * count} numbers, x, y, z for each of {count} anchor_ids',
            )
        for index, anchor_id in enumerate(self.anchor_ids):
            if not anchor_id or anchor_id in self.anchor_ids[:index]:
                raise ConfigError(f'anchor_ids[{index}]', anchor_id, 'a name, each anchor once')
        if len(self.direction_bias) not in (0, 2):
            raise ConfigError('direction_bias', self.direction_bias, 'no number, or two')
        if count and not spans_plane(self.anchors):
            raise ConfigError(
                'anchor_positions', self.anchor_positions, 'three anchors that are not in one line'
            )

    @property
    def anchors(self) -> Matrix:
        """The anchors in base_link, shape (n, 3) [m]."""
        return np.array(self.anchor_positions, dtype=float).reshape(-1, 3)


def spans_plane(anchors: Matrix) -> bool:
    """Return whether anchors, shape (n, 3) [m], tell a place to both sides of them."""
    if len(anchors) < LEAST_ANCHORS:
        return False
    spread = np.linalg.svd(anchors[:, :2] - anchors[:, :2].mean(axis=0), compute_uv=False)
    return float(spread[-1]) / math.sqrt(len(anchors)) >= _LEAST_SPREAD_M
