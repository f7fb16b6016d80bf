"""Contour following in trap rooms, with the simulator's echoes and wheels and their errors.

Gaps are true ones, between the hull and every wall; 0.02 m is left for what happens between two
control steps (0.06 s at 0.4 m/s).
"""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.control.contour import ContourConfig, Mode
from tablerunner.experiments.trap_drive import drive_to
from tablerunner.experiments.trap_room import CLOSED, TRAPS, make_trap_room

LEAST_GAP_M = 0.02


@pytest.mark.parametrize('seed', [400, 401, 402])
@pytest.mark.parametrize('kind', TRAPS)
def test_gets_out_of_every_trap_without_touching_it(kind: str, seed: int) -> None:
    room = make_trap_room(kind, seed)
    drive = drive_to(room.scenario, room.target, seed)
    assert drive.arrived, drive.reason
    assert drive.gap_m > LEAST_GAP_M
    assert drive.way_m >= 0.97 * room.shortest.length  # nobody is faster than the shortest way


@pytest.mark.parametrize('seed', [400, 401])
@pytest.mark.parametrize('kind', CLOSED)
@pytest.mark.parametrize('leave', ['free', 'nearer'])
def test_target_without_a_way_is_reported_after_a_round(kind: str, seed: int, leave: str) -> None:
    room = make_trap_room(kind, seed)
    drive = drive_to(room.scenario, room.target, seed, ContourConfig(leave=leave))
    assert drive.mode is Mode.UNREACHABLE
    assert drive.reason == 'went round without a way out'
    assert drive.gap_m > LEAST_GAP_M
    assert drive.way_m < 60.0  # twice round everything; `longest_way` did not end it


def test_older_method_goes_on_where_the_improved_leaves() -> None:
    """A partition that ends at the room's wall: the contour leads all round the room."""
    room = make_trap_room('L', 54)
    improved = drive_to(room.scenario, room.target, 54)
    older = drive_to(room.scenario, room.target, 54, ContourConfig(leave='nearer'))
    assert improved.arrived
    assert older.arrived
    assert improved.way_m < 0.95 * older.way_m


def test_same_seed_same_drive() -> None:
    room = make_trap_room('box', 5)
    first, again, other = (drive_to(room.scenario, room.target, seed) for seed in (5, 5, 6))
    assert np.array_equal(first.track, again.track)
    assert not np.array_equal(first.track[:50], other.track[:50])


def test_drive_that_does_not_end_says_so() -> None:
    room = make_trap_room('empty', 5)
    drive = drive_to(room.scenario, room.target, 5, longest_s=3.0)
    assert drive.mode is Mode.APPROACH
    assert drive.time_s == pytest.approx(3.0, abs=0.05)
