"""From anywhere, on fewer seeds than the command runs."""

import math

import numpy as np
import pytest

from tablerunner.experiments.global_start import (
    FAR_M,
    NEAR_M,
    NEAR_RAD,
    Found,
    _judge,
    one_run,
    part_of,
    room_of,
)


@pytest.mark.parametrize(('seed', 'name'), [(200, 'pf'), (201, 'pf_uiekf'), (202, 'pf_ekf')])
def test_pose_is_found_within_five_metres(seed, name):
    found, again = one_run(seed, (name,), carried_off=seed == 201)[name]
    for item in (found, again):
        assert item.in_time
        assert item.place < NEAR_M
        assert item.heading < NEAR_RAD


def test_drives_are_long_enough_and_begin_anywhere():
    parts = [part_of(room_of(), seed, index) for seed in range(3) for index in range(2)]
    starts = np.array([part.poses[0] for part in parts])
    assert len(np.unique(starts[:, 0])) == 6
    assert np.all((starts[:, :2] > 0.9) & (starts[:, :2] < 14.1))
    for part in parts:
        steps = np.linalg.norm(np.diff(part.poses[:, :2], axis=0), axis=1)
        assert steps.sum() > FAR_M


def test_judge_asks_for_a_pose_that_stays_right():
    """Believed rightly at once, wrongly for a while, then rightly again: the last counts."""
    part = part_of(room_of(), 0, 0)
    stamps = part.stamps[:: len(part.stamps) // 60]
    beliefs = []
    for k, stamp in enumerate(stamps):
        row = int(np.searchsorted(part.stamps, stamp))
        pose = part.poses[row].copy()
        if 10 <= k < 20:
            pose[2] += math.pi
        beliefs.append((int(stamp), None if k < 3 else pose))
    found = _judge(part, beliefs, 0)
    steps = np.linalg.norm(np.diff(part.poses[:, :2], axis=0), axis=1)
    driven = np.concatenate([[0.0], np.cumsum(steps)])
    expected = driven[int(np.searchsorted(part.stamps, stamps[20]))]
    assert found.driven == pytest.approx(expected, abs=0.02)
    assert found.place < 0.01
    never = _judge(part, [(stamp, None) for stamp, _ in beliefs], 0)
    assert not never.in_time
    assert Found(5.1, 0.0, 0.0).in_time is False
