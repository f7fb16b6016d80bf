"""Following in closed loop, short: the figures, their parts, and what the drive does."""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.control.person_follower import FollowState
from tablerunner.errors import ConfigError
from tablerunner.experiments.follow_drive import FollowDrive, calibrate, follow, wearer
from tablerunner.experiments.follow_person import kept, lost_and_found
from tablerunner.experiments.follow_rooms import ROOMS, open_hall
from tablerunner.simulation.tag_radio import TagRadio


def drive_of(states, tag=None, robot=None, located=None):
    """Return a drive of given states, one each 50 ms."""
    count = len(states)
    tag = np.zeros((count, 2)) if tag is None else tag
    return FollowDrive(
        5.0 + 0.05 * np.arange(1, count + 1),
        np.zeros((count, 3)) if robot is None else robot,
        tag,
        tag if located is None else located,
        np.zeros(count),
        tuple(states),
        np.zeros(count, dtype=bool),
        (),
        '',
    )


@pytest.mark.parametrize('seed', [0, 1])
def test_follow_open_floor_keeps_the_distance(seed):
    """15 s on the open floor: within 0.3 m of the set distance while the person walks."""
    drive = follow(open_hall(seed), seed, 15.0)
    figures = kept('open', drive)
    assert figures['open, distance RMS'] < 0.3
    assert figures['open, place of the tag'] < 250.0
    assert figures['open, in sight'] == 100.0
    assert drive.hits == 0
    assert np.ptp(drive.robot[:, 0]) + np.ptp(drive.robot[:, 1]) > 1.5


def test_follow_silent_tag_is_given_up_after_the_limit():
    drive = follow(open_hall(0), 0, 60.0, silent_from_s=2.0)
    assert drive.states[-1] is FollowState.GIVEN_UP
    assert drive.times_s[-1] == pytest.approx(2.0 + 0.6 + 30.0, abs=0.3)
    assert drive.reason == 'no range of the tag for 30 s'
    assert drive.speeds[-1] == pytest.approx(0.0, abs=0.05)


def test_follow_is_reproducible():
    first, again = (follow(open_hall(5), 5, 3.0) for _ in range(2))
    assert np.array_equal(first.robot, again.robot)
    assert not np.array_equal(first.robot, follow(open_hall(5), 6, 3.0).robot)


def test_calibration_finds_the_errors_of_the_links():
    """240 ranges of each link with 0.08 m of noise: the bias to 5 mm, four deviations of that."""
    for seed in range(8):
        scenario = open_hall(seed)
        radio = TagRadio(scenario, seed)
        person, tag = wearer(scenario)
        found = calibrate(radio, scenario.start_pose, scenario.people, person, tag)
        links = radio.links[tag.id]
        expected = [links.bias_m[name] + links.scale[name] for name in links.bias_m]
        assert found.biases == pytest.approx(expected, abs=0.021)


def test_wearer_nobody_with_a_tag_is_refused():
    scenario = open_hall(0)
    bare = tuple(person.replace(tag=None) for person in scenario.people)
    with pytest.raises(ConfigError, match='somebody with a tag'):
        wearer(scenario.replace(people=bare))


def test_rooms_are_sound_for_many_seeds():
    """Each is checked as any scenario is when it is made: no walk through a thing."""
    for make in ROOMS.values():
        assert len({make(seed).people[0].speed for seed in range(40)}) == 40


def test_kept_judges_only_the_walk_and_after_settling():
    """A tag that walks at 1 m/s, always 0.5 m farther than set: RMS 0.5; 0.1 m seen aside."""
    tag = np.column_stack([0.05 * np.arange(100.0), np.zeros(100)])
    robot = np.column_stack([tag[:, 0] - 1.7, np.zeros(100), np.zeros(100)])
    drive = drive_of([FollowState.FOLLOWING] * 100, tag, robot, tag + np.array([0.0, 0.1]))
    figures = kept('x', drive)
    assert figures['x, distance RMS'] == pytest.approx(0.5)
    assert figures['x, place of the tag'] == pytest.approx(100.0)
    assert figures['x, with the person'] == 100.0


def test_lost_and_found_counts_losses_that_last():
    follows, lost = FollowState.FOLLOWING, FollowState.LOST
    states = [follows] * 20 + [lost] * 10 + [follows] * 20 + [lost] * 30 + [follows] * 20
    figures = lost_and_found('x', drive_of(states))
    assert figures['x, times lost'] == 1.0
    assert figures['x, found again'] == 100.0
    ended = [follows] * 20 + [lost] * 30 + [FollowState.GIVEN_UP]
    assert lost_and_found('x', drive_of(ended))['x, found again'] == 0.0
    assert lost_and_found('x', drive_of(ended))['x, given up'] == 100.0
