"""What a scenario says of several robots."""

from __future__ import annotations

import pytest

from tablerunner.errors import ConfigError
from tablerunner.scenario import Kitchen, Marker, Member, RobotGeometry, Scenario, hue_of

ROBOTS = (
    Member('robot_1', (1.0, 1.0, 0.0)),
    Member('robot_2', (3.0, 1.0, 0.5), (30, 190, 60), 'T2'),
)
ROOM = Scenario(
    'x', kitchen=Kitchen((1.0, 1.0, 0.0)), robot=RobotGeometry(marker=Marker()), robots=ROBOTS
)


def test_team_is_the_first_few() -> None:
    assert ROOM.team(0) == ()
    assert ROOM.team(1) == ROBOTS[:1]
    for count in (3, -1):
        with pytest.raises(ConfigError, match=rf'robots: got {count}, expected at most 2'):
            ROOM.team(count)


def test_member_is_found_by_its_name() -> None:
    assert ROOM.member('robot_2') is ROBOTS[1]
    with pytest.raises(ConfigError, match=r"robot: got 'robot_3', expected one of robot_1, rob"):
        ROOM.member('robot_3')
    with pytest.raises(ConfigError, match='a scenario with robots'):
        ROOM.replace(robots=()).member('robot_1')


def test_scenario_of_one_robot_has_its_own_start_colour_and_tag() -> None:
    """And a place of its own to be loaded, where it starts."""
    own = ROOM.seen_by(ROBOTS[1])
    assert own.start_pose == ROBOTS[1].start_pose
    assert own.stops['kitchen'] == ROBOTS[1].start_pose
    assert (own.tag_id, own.robots) == ('T2', ())
    assert own.robot.marker == Marker((30, 190, 60))
    first = ROOM.seen_by(ROBOTS[0])
    assert (first.tag_id, first.robot.marker) == ('robot_1', Marker())


def test_hues_are_those_of_the_camera() -> None:
    """0 red, 120 green, 240 blue: as marker.hues has them."""
    hues = [hue_of(colour) for colour in ((255, 0, 0), (0, 90, 0), (10, 10, 200), (255, 0, 255))]
    assert hues == pytest.approx([0.0, 120.0, 240.0, 300.0])
