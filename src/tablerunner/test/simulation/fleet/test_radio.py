"""Ranging of a fleet against that of one robot: what blocks exactly, errors by their moments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Box, Wall
from tablerunner.simulation import PersonState
from tablerunner.simulation.fleet.radio import FleetRadio, person_blocks_many
from tablerunner.simulation.radio import Radio
from tablerunner.simulation.sight import Sight, person_blocks
from tablerunner.types import ExchangeSample
from tablerunner.uwb import ranging

AT = Pose2(4.0, 3.0, 0.5)
SLOT_NS = 25_000_000
ROUNDS = 1500
place = st.floats(0.1, 9.9)


@settings(max_examples=200)
@given(
    st.lists(st.tuples(place, place), min_size=1, max_size=4),
    st.lists(
        st.tuples(place, place, st.floats(0.05, 0.6), st.floats(0.5, 2.5)), min_size=0, max_size=4
    ),
    st.tuples(place, place, st.floats(0.3, 3.0)),
)
def test_people_block_as_for_one_robot(tags, people, anchor):
    states = [PersonState('', Pose2(x, y, 0.0), 0.0, radius) for x, y, radius, _ in people]
    heights = [height for *_, height in people]
    expected = [person_blocks((x, y, 1.1), anchor, states, heights) for x, y in tags]
    shape = (2, len(people), len(tags))
    places = np.broadcast_to(
        np.array([(x, y) for x, y, *_ in people]).reshape(-1, 2).T[:, :, None], shape
    )
    sizes = np.array([(radius, height) for *_, radius, height in people]).reshape(-1, 2).T
    sizes = np.broadcast_to(sizes[:, :, None], shape)
    found = person_blocks_many(np.array(tags).T, 1.1, anchor, places, sizes)
    assert found.tolist() == expected


@settings(max_examples=100)
@given(
    st.lists(st.tuples(place, place), min_size=1, max_size=5),
    st.tuples(place, place, st.floats(0.3, 3.0)),
)
def test_things_block_as_for_one_robot(tags, anchor):
    outlines = (
        Wall(((2.0, 2.0), (6.0, 3.0), (6.0, 8.0)), 'wall').outline,
        Box('low', 4.0, 6.0, 1.2, 0.8, heading=0.3, height=0.9).outline,
        Box('high', 8.0, 2.0, 0.6, 0.6, height=1.8).outline,
    )
    sight = Sight(outlines)
    expected = [sight.thing_blocks((x, y, 1.1), anchor) for x, y in tags]
    assert sight.thing_blocks_many(np.array(tags).T, 1.1, anchor).tolist() == expected


@pytest.mark.parametrize('blocked', ['', 'person', 'thing'])
def test_errors_have_the_moments_of_the_one_robot_radio(make_scenario, blocked):
    """Range error, power gap and losses of 6000 exchanges each, in sight and out of it."""
    errors = {
        'uwb': {
            'range_std': 0.1,
            'nlos_excess': (0.3, 1.0),
            'person_excess': (0.1, 0.5),
            'nlos_std': 0.15,
            'loss_probability': 0.05,
            'nlos_loss_probability': 0.2,
            'power_std': 1.0,
            'nlos_hold': 0.3,
        }
    }
    walls = make_scenario().walls
    if blocked == 'thing':
        ring = ((3.5, 2.5), (4.5, 2.5), (4.5, 3.5), (3.5, 3.5))
        walls = (*walls, Wall(ring, 'ring', closed=True))
    room = make_scenario(errors=errors, walls=walls)
    around = PersonState('', AT, 0.0, 0.3)  # all lines pass through
    people = (around,) if blocked == 'person' else ()
    heights = [3.0] * len(people)

    runs = 40
    fleet = FleetRadio(room, range(runs))
    tag = fleet.tag(*(np.full(runs, value) for value in (AT.x, AT.y, AT.heading)))
    shape = (2, len(people), runs)
    places = np.broadcast_to(np.array([[AT.x], [AT.y]])[:, : len(people), None], shape)
    sizes = np.broadcast_to(np.array([[0.3], [3.0]])[:, : len(people), None], shape)
    fleet_errors, fleet_gaps, fleet_lost = [], [], []
    for index in range(ROUNDS // 10):
        seen = fleet.exchange((index + 1) * SLOT_NS, tag, places, sizes)
        anchor = room.anchors[seen.anchor].position
        distance = math.dist((tag[0, 0], tag[1, 0], room.robot.tag_position[2]), anchor)
        assert seen.blocked.all() == bool(blocked)
        fleet_errors.append(ranging.distance(seen.flight_s) - distance)
        fleet_gaps.append(seen.rx_power_dbm - seen.first_path_power_dbm)
        fleet_lost.append(np.isnan(seen.flight_s))

    single_errors, single_gaps, single_lost = [], [], []
    for seed in range(4):
        radio = Radio(room, 1000 + seed)
        radio._heights = heights  # people of the test, not of the scenario
        for index in range(ROUNDS):
            sample, truth = radio.exchange((index + 1) * SLOT_NS, AT, people)
            single_lost.append(truth.lost)
            if isinstance(sample, ExchangeSample):
                times = ranging.intervals(
                    sample.poll_tx,
                    sample.poll_rx,
                    sample.response_tx,
                    sample.response_rx,
                    sample.final_tx,
                    sample.final_rx,
                )
                range_m = ranging.distance(ranging.double_sided(*times))
                single_errors.append(range_m - truth.distance_m)
                single_gaps.append(sample.rx_power_dbm - sample.first_path_power_dbm)
    many = np.array(fleet_errors)[~np.array(fleet_lost)]
    gaps = np.array(fleet_gaps)[~np.array(fleet_lost)]
    # The excess lasts a dozen exchanges of an anchor: so many draws count as one.
    each = 12.0 if blocked else 1.0
    for ours, theirs in ((many, single_errors), (gaps, single_gaps)):
        spread = np.std(theirs) * math.sqrt(each * 2 / len(theirs))
        assert np.mean(ours) == pytest.approx(np.mean(theirs), abs=4 * spread)
        assert np.std(ours) == pytest.approx(np.std(theirs), abs=4 * spread)
    share = np.mean(single_lost)
    off = 4 * math.sqrt(2 * share * (1 - share) / len(single_lost))
    assert np.mean(fleet_lost) == pytest.approx(share, abs=off)


def test_excess_lasts_as_long_as_that_of_the_one_robot_radio(make_scenario):
    """Correlation from one exchange of an anchor to the next: exp(-dt / hold) of the normals."""
    ring = ((3.5, 2.5), (4.5, 2.5), (4.5, 3.5), (3.5, 3.5))
    room = make_scenario(
        errors={'uwb': {'nlos_excess': (0.0, 1.0), 'nlos_hold': 0.3}},
        walls=(*make_scenario().walls, Wall(ring, 'ring', closed=True)),
    )
    runs = 50
    radio = FleetRadio(room, range(runs))
    tag = radio.tag(*(np.full(runs, value) for value in (AT.x, AT.y, AT.heading)))
    none = np.empty((2, 0, runs))
    seen = [radio.exchange((k + 1) * SLOT_NS, tag, none, none).excess_m for k in range(1600)]
    excess = np.array(seen[::4])  # of the first anchor, every 0.1 s
    now, after = excess[:-1].ravel(), excess[1:].ravel()
    normal = math.exp(-0.1 / 0.3)
    uniform = 6 / math.pi * math.asin(normal / 2)  # of the distribution function of both
    assert np.corrcoef(now, after)[0, 1] == pytest.approx(uniform, abs=0.03)
    assert np.mean(excess) == pytest.approx(0.5, abs=0.02)
    assert np.std(excess) == pytest.approx(math.sqrt(1 / 12), abs=0.01)
