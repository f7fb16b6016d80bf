"""What the sensors find beside the map: where it is, and when it is forgotten."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control import Surroundings, SurroundingsConfig, make_planner, make_surroundings
from tablerunner.control.fuzzy import Readings, UltrasonicRing
from tablerunner.control.path import Path
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Box, Scenario, Wall
from tablerunner.simulation.sonar import Sonar
from tablerunner.types import NANOSECONDS, nanoseconds

CORNERS = ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0))
CHAIR = Box('chair', 3.0, 2.0, 0.45, 0.45)
PATH = Path(np.array([[1.0, 2.0], [5.0, 2.0]]))


def room(*boxes: Box) -> Scenario:
    outer = Wall(CORNERS, 'outer wall', closed=True)
    return Scenario('small', walls=(outer,), boxes=boxes, start=(1.0, 2.0, 0.0))


class Listener:
    """Hears a room with its sensors, knowing only the map of another."""

    def __init__(self, there: Scenario, known: Scenario, seed: int) -> None:
        found = make_surroundings(known, make_planner(known))
        assert found is not None
        self.found: Surroundings = found
        self.there = there
        self.sonar = Sonar(there, np.random.default_rng(seed))
        self.ring = UltrasonicRing()
        self.stamp = NANOSECONDS

    def turn_to(self, there: Scenario) -> None:
        """Let the room be another one from now on."""
        self.sonar = Sonar(there, np.random.default_rng(99))

    def stand(self, pose: Pose2, seconds: float, std_m: float = 0.0) -> None:
        """Hear for a while from one pose, firing every 30 ms as the simulator does."""
        for _ in range(round(seconds / 0.03)):
            self.stamp += nanoseconds(0.03)
            self.ring.add(self.sonar.fire(self.stamp, pose, ()), self.stamp)
            self.found.hear(self.ring.readings(self.stamp), pose, self.stamp, std_m)

    def places(self) -> np.ndarray:
        """Return where something was found, shape (n, 2)."""
        floor, cells = self.found._map, np.argwhere(self.found.found)
        return floor.origin + floor.resolution * cells[:, ::-1]


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('gap', [0.3, 0.6, 1.0])
def test_face_of_a_chair_is_found_where_it_is(gap: float, seed: int) -> None:
    listener = Listener(room(CHAIR), room(), seed)
    listener.stand(Pose2(3.0 - 0.225 - 0.22 - gap, 2.0, 0.0), 2.0)
    places = listener.places()
    assert len(places)
    assert abs(np.mean(places[:, 0]) - 2.775) < 0.08  # noise, cells, thickness of the arc
    assert abs(np.mean(places[:, 1]) - 2.0) < 0.08
    assert np.max(np.abs(places[:, 1] - 2.0)) < 0.05 + 0.24 * gap  # within the cone


@pytest.mark.parametrize('seed', range(5))
def test_what_is_on_the_map_is_not_found(seed: int) -> None:
    """Also with a pose that is 0.1 m and 3 degrees off."""
    listener = Listener(room(CHAIR), room(CHAIR), seed)
    for x, y, heading in ((2.0, 2.0, 0.0), (0.6, 0.6, 0.4), (3.0, 1.2, 1.5), (5.0, 3.2, 2.0)):
        listener.stand(Pose2(x, y, heading), 1.0)
    assert not len(listener.places())
    assert listener.found.floor is listener.found._map


def test_what_has_gone_is_forgotten_when_a_sensor_looks_there() -> None:
    listener = Listener(room(CHAIR), room(), 1)
    at = Pose2(2.0, 2.0, 0.0)
    listener.stand(at, 2.0)
    assert len(listener.places())
    listener.turn_to(room())
    listener.stand(at, 0.3)
    assert len(listener.places())  # one silence proves nothing
    listener.stand(at, 3.0)
    assert not len(listener.places())


def test_what_is_not_looked_at_fades() -> None:
    config = SurroundingsConfig()
    longest = config.fade_time * math.log(config.most / config.enough)  # at most: see `most`
    listener = Listener(room(CHAIR), room(), 1)
    listener.stand(Pose2(2.0, 2.0, 0.0), 2.0)
    listener.turn_to(room())
    away = Pose2(1.0, 2.0, math.pi)
    listener.stand(away, 3.0)
    assert len(listener.places())
    listener.stand(away, longest)
    assert not len(listener.places())


def test_furniture_is_forgotten_slowly_but_at_once_when_it_has_gone() -> None:
    config = SurroundingsConfig()
    at, away = Pose2(2.0, 2.0, 0.0), Pose2(1.0, 2.0, math.pi)
    longest = config.firm_fade_time * math.log(config.most / config.enough)
    listener = Listener(room(CHAIR), room(), 1)
    listener.stand(at, config.firm + 3.0)  # heard in every of these seconds
    listener.turn_to(room())
    listener.stand(away, 0.5 * longest)
    assert len(listener.places())
    listener.stand(at, 5.0)
    assert not len(listener.places())
    again = Listener(room(CHAIR), room(), 1)
    again.stand(at, config.firm + 3.0)
    again.turn_to(room())
    again.stand(away, 1.1 * longest)
    assert not len(again.places())


def test_floor_and_path_show_what_was_found() -> None:
    listener = Listener(room(CHAIR), room(), 1)
    assert listener.found.gap(PATH, 0.0, 4.0) == math.inf
    listener.stand(Pose2(2.0, 2.0, 0.0), 2.0)
    floor = listener.found.floor
    assert floor.distance_at(np.array([2.78, 2.0])) < 0.06
    assert floor.distance_at(np.array([2.28, 2.0])) == pytest.approx(0.5, abs=0.1)
    assert listener.found.gap(PATH, 0.0, 4.0) < 0.05
    assert listener.found.gap(PATH, 1.0, 1.0) < 0.05
    assert listener.found.gap(PATH, 0.0, 1.2) == pytest.approx(0.55, abs=0.05)  # ends before it
    assert listener.found.gap(PATH, 2.5, 1.5) > 0.5
    beside = Path(np.array([[1.0, 2.6], [5.0, 2.6]]))
    assert 0.4 < listener.found.gap(beside, 0.0, 4.0) <= 0.6
    far = Path(np.array([[1.0, 3.5], [5.0, 3.5]]))
    assert listener.found.gap(far, 0.0, 4.0) == math.inf
    listener.found.reset()
    assert not len(listener.places())


@pytest.mark.parametrize('seed', range(5))
def test_floor_behind_what_was_found_is_unseen_until_sound_has_passed(seed: int) -> None:
    listener = Listener(room(CHAIR), room(), seed)
    assert listener.found.floor.unseen is None
    listener.stand(Pose2(2.0, 2.0, 0.0), 1.5)  # before its face at x = 2.775
    assert len(listener.places())
    assert listener.found.floor.unseen is None  # somebody who walks has no such depth
    listener.stand(Pose2(2.0, 2.0, 0.0), 2.5)
    unseen = listener.found.floor.unseen
    assert unseen is not None
    cell = listener.found.floor.cell
    for x, y in ((3.0, 2.0), (3.0, 2.1), (3.0, 1.9)):  # inside the chair
        assert unseen[cell(x, y)] == 0.0
    assert unseen[cell(2.45, 2.0)] > 0.05  # between robot and chair
    assert unseen[cell(3.4, 2.0)] > 0.1  # deeper than anything is taken to be
    assert unseen[cell(2.45, 2.9)] > 0.3  # nothing was heard anywhere near
    listener.stand(Pose2(3.0, 1.2, math.pi / 2), 3.0)  # hears another face of it
    listener.turn_to(room())  # the chair is taken away
    listener.stand(Pose2(2.0, 2.05, 0.0), 3.0)  # sound passes there, but not at that face
    assert np.hypot(*(listener.places() - [3.0, 2.0]).T).min() < 0.3
    unseen = listener.found.floor.unseen
    assert unseen is not None
    assert unseen[cell(3.0, 2.0)] > 0.0


def test_sound_that_passes_says_less_where_nothing_echoes_and_nothing_beyond_an_echo() -> None:
    def seen_after(seconds: float, distance: float) -> float:
        listener = Listener(room(), room(), 1)
        floor, found, stamp = listener.found._map, listener.found, NANOSECONDS
        for _ in range(round(seconds / 0.15)):
            stamp += nanoseconds(0.15)
            readings = Readings(distances_m=(math.nan,) * 2 + (distance,) + (math.nan,) * 2)
            found.hear(readings, Pose2(1.0, 2.0, 0.0), stamp)
        return float(found._passed[floor.cell(2.0, 2.0)])

    echoes, silence = seen_after(0.45, 1.4), seen_after(0.45, math.inf)
    assert echoes == pytest.approx(3.0, rel=0.02)
    assert silence == pytest.approx(0.2 * echoes)
    assert seen_after(3.0, 0.7) == 0.0


def test_floor_that_sound_passed_long_ago_is_unseen_again() -> None:
    """Something may have been put there since."""
    inside = []
    for away_s in (1.0, 40.0):
        listener = Listener(room(), room(), 1)
        listener.stand(Pose2(2.0, 2.0, 0.0), 4.0)
        listener.stand(Pose2(1.0, 2.0, math.pi), away_s)
        listener.turn_to(room(CHAIR))
        listener.stand(Pose2(2.0, 2.0, 0.0), 4.0)
        unseen = listener.found.floor.unseen
        assert unseen is not None
        inside.append(unseen[listener.found.floor.cell(3.0, 2.0)])
    assert inside[0] > 0.0
    assert inside[1] == 0.0


def test_thing_that_stands_later_than_furniture_is_refused() -> None:
    with pytest.raises(ConfigError, match='stands'):
        SurroundingsConfig(stands=6.0, firm=5.0)


def test_single_false_echo_is_not_believed() -> None:
    listener = Listener(room(), room(), 1)
    at = Pose2(2.0, 2.0, 0.0)
    listener.stand(at, 1.0)
    sample = Sonar(room(CHAIR), np.random.default_rng(3))
    for _ in range(3):  # the third sensor looks ahead
        heard = sample.fire(listener.stamp, at, ())
    listener.stamp += nanoseconds(0.03)
    listener.ring.add(heard.__class__(listener.stamp, heard.sensor, 0.55, 0.03, 3.0, 0.48), 10**12)
    listener.found.hear(listener.ring.readings(listener.stamp), at, listener.stamp)
    assert listener.found._evidence.max() > 0.5
    assert not len(listener.places())


def moving(listener: Listener, pose_speed: float, thing_speed: float, seconds: float) -> bool:
    """Drive at a chair that comes nearer itself; return whether that was ever noticed."""
    noticed = False
    pose, x = Pose2(1.0, 2.0, 0.0), 2.6
    for _ in range(round(seconds / 0.03)):
        pose = Pose2(pose.x + 0.03 * pose_speed, pose.y, pose.heading)
        x -= 0.03 * thing_speed
        listener.turn_to(room(Box('chair', x, 2.0, 0.45, 0.45)))
        listener.sonar._turn = round(listener.stamp / nanoseconds(0.03)) % 5
        listener.stand(pose, 0.03)
        noticed = noticed or listener.found.is_approached(listener.stamp)
    return noticed


def test_who_comes_nearer_is_noticed_and_what_is_driven_at_is_not() -> None:
    for seed in range(3):
        assert moving(Listener(room(CHAIR), room(), seed), 0.0, 0.7, 1.0)
        assert moving(Listener(room(CHAIR), room(), seed), 0.3, 0.7, 0.8)
        assert not moving(Listener(room(CHAIR), room(), seed), 0.5, 0.0, 1.2)
        assert not moving(Listener(room(CHAIR), room(), seed), 0.0, 0.0, 2.0)


def test_who_has_come_nearer_is_waited_for_only_for_a_while() -> None:
    listener = Listener(room(CHAIR), room(), 1)
    assert moving(listener, 0.0, 0.7, 1.0)
    listener.turn_to(room())
    listener.stand(Pose2(1.0, 2.0, 0.0), SurroundingsConfig().yield_time + 0.1)
    assert not listener.found.is_approached(listener.stamp)


@pytest.mark.parametrize(
    ('std_m', 'is_found'), [(0.0, True), (0.03, True), (0.1, False), (math.inf, False)]
)
def test_echo_beside_the_map_is_explained_by_it_when_the_pose_may_be_off(
    std_m: float, is_found: bool
) -> None:
    """Something stands 0.12 m before a shelf that is on the map."""
    shelf = Box('shelf', 3.2, 2.0, 0.4, 3.0)
    ahead = Box('crates', 2.85, 2.0, 0.26, 3.0)
    listener = Listener(room(shelf, ahead), room(shelf), 1)
    listener.stand(Pose2(2.1, 2.0, 0.0), 2.0, std_m)
    assert bool(len(listener.places())) is is_found


def test_uncertain_pose_does_not_explain_what_is_far_from_the_map() -> None:
    listener = Listener(room(CHAIR), room(), 1)
    listener.stand(Pose2(2.0, 2.0, 0.0), 2.0, math.inf)
    assert len(listener.places())


def test_edge_of_a_cone_hardly_speaks_against_a_place() -> None:
    """Silence along a wall is what slanting sound is, not a wall that has gone."""
    listener = Listener(room(), room(), 1)
    found, at = listener.found, Pose2(2.0, 2.0, 0.0)
    middle, edge = found._map.cell(3.0, 2.0), found._map.cell(3.0, 2.15)
    found._evidence[middle] = found._evidence[edge] = 4.0
    listener.stand(at, 0.8)
    lost = 4.0 - found._evidence[middle], 4.0 - found._evidence[edge]
    assert lost[0] > 0.3
    assert 0.0 < lost[1] < 0.6 * lost[0]


def test_silence_speaks_less_against_furniture() -> None:
    """Sound is mirrored away from a flat thing at a slant."""
    listener = Listener(room(), room(), 1)
    found, at = listener.found, Pose2(2.0, 2.0, 0.0)
    firm, new = found._map.cell(3.0, 2.05), found._map.cell(3.0, 1.95)
    found._evidence[firm] = found._evidence[new] = 4.0
    found._firm_s[firm] = found.config.firm + 1.0
    listener.stand(at, 0.8)
    lost_firm, lost_new = 4.0 - found._evidence[firm], 4.0 - found._evidence[new]
    assert lost_new > 0.3
    assert lost_firm == pytest.approx(found.config.silent_firm * lost_new, rel=0.2)


def test_one_who_has_just_come_into_a_side_cone_counts_as_near() -> None:
    """0.6 of the distance at first, 1.5 times that once he stays; ahead it is the distance."""
    gaps = {}
    for name, heading in (('beside', 0.0), ('ahead', math.pi / 2.0)):
        listener = Listener(room(), room(), 1)
        pose = Pose2(2.0, 2.0, heading)
        listener.stand(pose, 0.5)
        listener.turn_to(room(Box('chair', 2.0, 3.0, 0.45, 0.45)))
        heard: list[float] = []
        for _ in range(40):
            listener.stamp += nanoseconds(0.03)
            listener.ring.add(listener.sonar.fire(listener.stamp, pose, ()), listener.stamp)
            readings = listener.ring.readings(listener.stamp)
            heard += listener.found.hear(readings, pose, listener.stamp)
        gaps[name] = heard
    distance = np.median(gaps['ahead'])
    assert 0.4 < distance < 0.8
    assert gaps['beside'][0] == pytest.approx(0.6 * distance, abs=0.06)
    assert gaps['beside'][-1] == pytest.approx(1.5 * distance, abs=0.12)
    assert max(gaps['ahead']) - min(gaps['ahead']) < 0.1


def test_least_margin_above_the_most_is_named() -> None:
    with pytest.raises(ConfigError, match=r'explained.*0\.3.*at most explained_most'):
        SurroundingsConfig(explained=0.3)
