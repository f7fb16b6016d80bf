"""A short service of three robots through pictures, air and filters."""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.experiments import crossings, shared_room
from tablerunner.experiments.shared_room import COLOURS, Service, Serving, run_service
from tablerunner.scenario import Scenario


@pytest.fixture(scope='module')
def service() -> Service:
    """Eight seconds, with a picture every half second."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shared_room, 'CAMERA', shared_room.CAMERA.replace(rate=2.0))
        return run_service(2, 8.0)


def test_no_pose_is_given_to_another_robot(service: Service) -> None:
    """16 pictures of three robots, of which the last is still on its way; all are found."""
    tally = service.tally
    assert tally.pictures == 3 * 15
    assert tally.found == tally.pictures
    assert tally.mistaken == 0
    assert max(tally.place_errors) < 0.02
    assert tally.contacts == 0


def test_filters_of_all_robots_stay_on_theirs(service: Service) -> None:
    """Estimates of three robots 50 times a second, right to centimetres."""
    for errors in service.errors.values():
        assert len(errors) == pytest.approx(3 * 8 * 50, abs=10)
        assert np.mean(errors) < 0.03
    assert np.max(service.errors['camera']) < 0.1


def test_robots_drive(service: Service) -> None:
    assert service.legs >= 3
    assert all(np.ptp(path, axis=0).max() > 1.0 for path in service.paths.values())


def test_mistaken_poses_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Had two robots each other's plate, every pose of theirs would be wrong, and is told."""
    monkeypatch.setattr(shared_room, 'CAMERA', shared_room.CAMERA.replace(rate=5.0))
    serving = Serving(0)
    monkeypatch.setattr(shared_room, 'COLOURS', (COLOURS[1], COLOURS[0], COLOURS[2]))
    serving.locator = shared_room.locator_of(serving.scenario)
    while serving.elapsed_s < 0.7:
        serving.step()
    assert serving.tally.found == 3 * 3
    assert serving.tally.mistaken == 2 * 3


def test_half_hidden_robots_are_not_given_a_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind the tall guest, seen from the camera; another 3 m off is found."""
    monkeypatch.setattr(shared_room, 'CAMERA', shared_room.CAMERA.replace(rate=10.0))
    plain = shared_room.room

    def room() -> Scenario:
        scenario = plain()
        first, *others = scenario.robots
        return scenario.replace(
            robots=(type(first)('robot_1', (7.4, 3.3, 1.57), COLOURS[0]), *others)
        )

    monkeypatch.setattr(shared_room, 'room', room)
    serving = Serving(0)
    while serving.elapsed_s < 0.4:
        serving.step()
    assert serving.tally.refused == {'no marker seen': 3}
    assert serving.tally.found == 2 * 3


def test_outcome_holds_only_without_mistakes(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bound of the wrong poses is zero, in every seed."""
    monkeypatch.setattr(crossings, 'run_seeds', lambda *_: [service, service])
    outcome = crossings.run_crossings((1, 2), lambda *_: None)
    assert outcome.row('poses given to the wrong robot').holds
    monkeypatch.setattr(service.tally, 'mistaken', 1)
    outcome = crossings.run_crossings((1, 2), lambda *_: None)
    assert not outcome.row('poses given to the wrong robot').holds
