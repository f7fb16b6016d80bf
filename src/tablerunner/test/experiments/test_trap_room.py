"""Trap rooms are what they say: the same for a seed, closed or open, wide enough, in the way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.experiments.trap_room import CLOSED, KINDS, TRAPS, make_trap_room, shortest_way
from tablerunner.geometry.segments import crosses, distance_to_segments

SEEDS = range(300, 304)


@pytest.mark.parametrize('kind', KINDS)
def test_room_of_a_seed_is_always_the_same(kind: str) -> None:
    first, again, other = (make_trap_room(kind, seed) for seed in (300, 300, 301))
    assert first.scenario == again.scenario
    assert first.scenario.start != other.scenario.start


@pytest.mark.parametrize('kind', TRAPS)
def test_trap_is_in_the_way_and_every_passage_wide(kind: str) -> None:
    for seed in SEEDS:
        room = make_trap_room(kind, seed)
        walls = room.scenario.obstacle_segments()
        start = np.array(room.scenario.start[:2])
        ends = np.array([start, room.target])
        assert distance_to_segments(ends, walls).min() >= 0.9
        assert crosses(ends[:1], ends[1:], walls).any()
        assert room.shortest.length > math.dist(*ends)
        assert shortest_way(room.scenario, room.target, 0.75 - 0.25) is not None
        near = distance_to_segments(room.shortest.resampled(0.05), walls).min()
        assert near > 0.25  # the hull fits


@pytest.mark.parametrize('kind', CLOSED)
def test_closed_room_has_no_way(kind: str) -> None:
    for seed in SEEDS:
        room = make_trap_room(kind, seed)
        assert room.shortest is None
        assert shortest_way(room.scenario, room.target, 0.0) is None


def test_unknown_kind_is_refused() -> None:
    with pytest.raises(ConfigError, match="kind: got 'V', expected one of empty, box, U"):
        make_trap_room('V', 0)
