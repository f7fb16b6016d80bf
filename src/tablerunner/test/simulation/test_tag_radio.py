"""Tags that people wear, ranged from the robot: distance, bodies in the way, streams."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import AnchorMount, Box, Person, PersonTag, RobotGeometry, Scenario
from tablerunner.simulation import PersonState, RangeTruth, Simulator
from tablerunner.simulation.tag_radio import TagRadio
from tablerunner.types import ExchangeSample, WheelSample
from tablerunner.uwb import Ranger, RangerConfig

MakeScenario = Callable[..., Scenario]
PLACES = ((0.17, 0.17, 1.0), (-0.17, 0.17, 1.0), (-0.17, -0.17, 1.0), (0.17, -0.17, 1.0))
ROBOT = RobotGeometry(
    anchors=tuple(
        AnchorMount(id=f'R{index}', position=place) for index, place in enumerate(PLACES)
    )
)
AT = Pose2(4.0, 3.0, 0.5)


def person(name: str = 'host', tag: str | None = 'host_tag', **changes: object) -> Person:
    values: dict[str, object] = {'name': name, 'route': ((7.0, 3.0),)}
    values['tag'] = None if tag is None else PersonTag(id=tag)
    return Person(**{**values, **changes})  # type: ignore[arg-type]


def state(x: float, y: float, heading: float = 0.0, name: str = 'host') -> PersonState:
    return PersonState(name, Pose2(x, y, heading), 0.0, 0.25)


def test_tag_radio_without_noise_tells_the_distance(make_scenario: MakeScenario) -> None:
    """The tag at the back of a person at (7, 3) who looks to +y hangs at (7, 2.75)."""
    scenario = make_scenario(people=(person(),), robot=ROBOT)
    radio = TagRadio(scenario, 3)
    ranger = Ranger(
        RangerConfig(
            anchor_ids=('R0', 'R1', 'R2', 'R3'),
            anchor_positions=tuple(value for place in PLACES for value in place),
        )
    )
    people = (state(7.0, 3.0, math.pi / 2),)
    for index in range(40):
        exchange, truth = radio.exchange((index + 1) * 25_000_000, AT, people)
        assert exchange is not None
        x, y = AT.transform(np.array(PLACES[index % 4][:2]))
        expected = math.dist((x, y, 1.0), (7.0, 2.75, 1.0))
        assert truth.distance_m == pytest.approx(expected, abs=1e-9)
        assert truth.tag_id == exchange.tag_id == 'host_tag'
        # Registers round to ticks of 4.7 mm.
        assert ranger.add(exchange).range_m == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    ('heading', 'expected'),
    [
        (0.0, ''),  # walks away, the tag on the back looks at the robot
        (math.pi, 'person'),  # looks at the robot, the body hides the tag
    ],
)
def test_tag_radio_own_body_blocks(
    make_scenario: MakeScenario, heading: float, expected: str
) -> None:
    radio = TagRadio(make_scenario(people=(person(),), robot=ROBOT), 0)
    robot = Pose2(4.0, 3.0, 0.0)
    blocked = {
        radio.exchange(n * 10**7, robot, (state(7.0, 3.0, heading),))[1].blocked_by
        for n in range(1, 9)
    }
    assert blocked == {expected}


def test_tag_radio_somebody_between_blocks_and_lengthens(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(
        people=(person(), person('other', None)),
        robot=ROBOT,
        errors={'uwb': {'person_excess': (0.1, 0.5)}},
    )
    radio = TagRadio(scenario, 0)
    robot = Pose2(4.0, 3.0, 0.0)
    people = (state(7.0, 3.0), state(5.5, 3.0, name='other'))
    truths = [radio.exchange(n * 10**7, robot, people)[1] for n in range(1, 41)]
    assert {truth.blocked_by for truth in truths} == {'person'}
    assert all(0.1 <= truth.excess_m <= 0.5 for truth in truths)
    aside = (state(7.0, 3.0), state(5.5, 4.0, name='other'))
    assert radio.exchange(10**9, robot, aside)[1].blocked_by == ''


def test_tag_radio_high_things_block_low_ones_do_not(make_scenario: MakeScenario) -> None:
    robot = Pose2(4.0, 3.0, 0.0)
    for height, expected in ((0.75, ''), (1.6, 'thing')):
        box = Box(name='shelf', x=5.5, y=3.0, length=0.3, width=2.0, height=height)
        scenario = make_scenario(
            people=(person(),), robot=ROBOT, boxes=(box,), start=(2.0, 3.0, 0.0)
        )
        truth = TagRadio(scenario, 0).exchange(10**7, robot, (state(7.0, 3.0),))[1]
        assert truth.blocked_by == expected


def test_simulator_ranges_every_tag_at_its_rate_and_moves_no_other_stream(
    make_scenario: MakeScenario,
) -> None:
    """Two tags with four anchors at 10 Hz: 80 exchanges a second; all else is as without them."""
    people = (person(), person('guest', 'guest_tag', route=((7.0, 6.0),)))
    plain = tuple(one.replace(tag=None) for one in people)
    worn = Simulator(make_scenario(people=people, robot=ROBOT), 5)
    bare = Simulator(make_scenario(people=plain), 5)
    tagged, others, expected = [], [], []
    for _ in range(200):
        for sample in worn.step():
            if isinstance(sample, (ExchangeSample, RangeTruth)) and sample.tag_id != 'tag':
                tagged.append(sample)
            else:
                others.append(sample)
        expected.extend(bare.step())
    assert others == expected
    assert sum(isinstance(sample, WheelSample) for sample in others) == 100
    truths = [sample for sample in tagged if isinstance(sample, RangeTruth)]
    assert len(truths) == pytest.approx(160, abs=1)
    counts = {
        (tag, anchor): sum(s.tag_id == tag and s.anchor_id == anchor for s in truths)
        for tag in ('host_tag', 'guest_tag')
        for anchor in ('R0', 'R1', 'R2', 'R3')
    }
    assert set(counts.values()) <= {19, 20}
