"""The scenarios that ship, and what a scenario answers."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from tablerunner.config import Document, build, to_mapping
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.geometry.segments import distance_to_segments
from tablerunner.scenario import Box, Scenario, SensorErrors, load_scenario

SCENARIOS = Path(__file__).parents[3] / 'tablerunner_bringup' / 'scenarios'


@pytest.fixture(scope='module')
def restaurant() -> Scenario:
    return load_scenario(SCENARIOS / 'restaurant.yaml')


@pytest.mark.parametrize('path', sorted(SCENARIOS.glob('*.yaml')), ids=lambda path: path.stem)
def test_shipped_scenario_loads_and_bears_its_file_name(path: Path) -> None:
    """Each file under scenarios/ is a scenario that can be asked for by its file's name."""
    assert load_scenario(path).name == path.stem


def test_restaurant_holds_what_the_demo_needs(restaurant: Scenario) -> None:
    """15 m x 15 m, a kitchen, at least eight tables, people, four anchors at 2.25 m."""
    assert restaurant.bounds == (0.0, 0.0, 15.0, 15.0)
    assert len(restaurant.tables) >= 8
    assert [table.name for table in restaurant.tables[:8]] == [f'table_{i}' for i in range(1, 9)]
    assert 2 <= len(restaurant.people) <= 3
    assert len(restaurant.anchors) == 4
    assert {anchor.position[2] for anchor in restaurant.anchors} == {2.25}
    assert restaurant.start_pose == restaurant.stop_pose('kitchen')


def test_restaurant_aisles_are_wide_enough(restaurant: Scenario) -> None:
    """At least 1.4 m lie between any two tables, so that a person and the robot can pass."""
    gaps = [
        np.min(distance_to_segments(a.outline.corners, b.outline.segments))
        for a, b in itertools.permutations(restaurant.tables, 2)
    ]
    assert min(gaps) >= 1.4


def test_restaurant_stops_stand_beside_their_own_table(restaurant: Scenario) -> None:
    """From each stop its table is within arm's reach, and nearer than every other table."""
    for table in restaurant.tables:
        place = np.array([table.stop[:2]])
        reach = {
            other.name: np.min(distance_to_segments(place, other.outline.segments))
            for other in restaurant.tables
        }
        assert min(reach, key=reach.__getitem__) == table.name
        assert restaurant.robot.footprint_radius < reach[table.name] < 0.8


def test_sun2019_is_the_square_room_of_the_paper() -> None:
    """Path (3,3) (3,12) (12,12) (12,3) (3,3), heading +90 deg, wheels and track as printed."""
    scenario = load_scenario(SCENARIOS / 'sun2019.yaml')
    square = scenario.routes['square']
    assert square == ((3.0, 3.0), (3.0, 12.0), (12.0, 12.0), (12.0, 3.0), (3.0, 3.0))
    start = scenario.start_pose
    assert (start.x, start.y) == square[0]
    assert start.heading == pytest.approx(math.pi / 2, abs=1e-6)
    assert (scenario.robot.wheel_radius, scenario.robot.track) == (0.06, 0.34)
    assert scenario.sensors.wheels.rate == scenario.sensors.imu.rate == 10.0


def test_stop_pose_of_unknown_name_lists_the_known(restaurant: Scenario) -> None:
    """Who asks for a table that is not there is told which are."""
    with pytest.raises(ConfigError, match=r"restaurant.*'tabel_3'.*kitchen, table_1") as caught:
        restaurant.stop_pose('tabel_3')
    assert caught.value.value == 'tabel_3'


def test_stop_pose_of_table_is_its_stop(restaurant: Scenario) -> None:
    assert restaurant.stop_pose('table_1') == Pose2(*restaurant.tables[0].stop)


def test_scenario_survives_the_way_through_plain_data(restaurant: Scenario) -> None:
    """What `to_mapping` writes, `build` reads back to an equal scenario."""
    assert build(Scenario, Document(to_mapping(restaurant))) == restaurant


def test_obstacle_segments_hold_every_edge(restaurant: Scenario) -> None:
    """Four outer walls, four kitchen walls; four edges per rectangle, sixteen per circle."""
    round_tables = sum(table.shape == 'round' for table in restaurant.tables)
    square_tables = len(restaurant.tables) - round_tables
    expected = 4 + 4 + 16 * round_tables + 4 * (square_tables + len(restaurant.boxes))
    assert restaurant.obstacle_segments().shape == (expected, 2, 2)


def test_scenario_without_things_is_an_empty_room() -> None:
    """Nothing but a name is needed; the robot then starts at the origin."""
    scenario = Scenario(name='void')
    assert scenario.obstacle_segments().shape == (0, 2, 2)
    assert scenario.bounds == (0.0, 0.0, 0.0, 0.0)
    assert scenario.start_pose == Pose2()
    assert scenario.stops == {}


def test_robot_ultrasonics_by_default_are_the_five_of_the_contract() -> None:
    """Left to right at +90, +40, 0, -40, -90 degrees, on the rim of the footprint."""
    mounts = Scenario(name='void').robot.ultrasonics
    assert [mount.name for mount in mounts] == [
        'left',
        'left_front',
        'front',
        'right_front',
        'right',
    ]
    degrees = [math.degrees(mount.heading) for mount in mounts]
    assert degrees == pytest.approx([90, 40, 0, -40, -90], abs=1e-3)
    for mount in mounts:
        assert math.atan2(mount.y, mount.x) == pytest.approx(mount.heading, abs=1e-3)


def test_ideal_sensors_keep_rates_and_lose_errors() -> None:
    """Only what is an error becomes zero."""
    ideal = SensorErrors().ideal()
    assert ideal.uwb.rate == 10.0
    assert ideal.wheels.motor_lag == SensorErrors().wheels.motor_lag
    assert ideal.uwb.range_std == ideal.uwb.bias_std == ideal.imu.gyro_bias_std == 0.0
    assert ideal.ultrasonic.missing_probability == 0.0


def test_box_that_is_not_on_the_map_stands_in_the_room_only() -> None:
    """Sensors, people and the hull meet it; what the robot plans on is without it."""
    known, unknown = Box('pillar', 1.0, 1.0, 0.5, 0.5), Box('crate', 3.0, 1.0, 0.5, 0.5)
    scenario = Scenario(name='room', boxes=(known, unknown.replace(unmapped=True)))
    assert [outline.name for outline in scenario.outlines] == ['pillar', 'crate']
    assert [outline.name for outline in scenario.mapped.outlines] == ['pillar']
    assert len(scenario.mapped.obstacle_segments()) == 4
    mapped = Scenario(name='room', boxes=(known,))
    assert mapped.mapped is mapped
