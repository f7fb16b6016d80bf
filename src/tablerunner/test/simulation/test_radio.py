"""Timestamps of the simulated radio, read by a formula of the test's own."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from scipy import stats

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Box, Person, Scenario, Wall
from tablerunner.simulation import PersonState, RangeTruth
from tablerunner.simulation.radio import Radio
from tablerunner.types import ExchangeSample

MakeScenario = Callable[..., Scenario]
AT = Pose2(4.0, 3.0, 0.5)
SLOT_NS = 25_000_000


def distance_of(sample: ExchangeSample) -> float:
    """Return the distance [m] by asymmetric double-sided ranging in whole numbers."""
    turn = 1 << 40
    round_tag = (sample.response_rx - sample.poll_tx) % turn
    reply_anchor = (sample.response_tx - sample.poll_rx) % turn
    round_anchor = (sample.final_rx - sample.response_tx) % turn
    reply_tag = (sample.final_tx - sample.response_rx) % turn
    ticks = Fraction(
        round_tag * round_anchor - reply_anchor * reply_tag,
        round_tag + round_anchor + reply_anchor + reply_tag,
    )
    return float(ticks * 299_792_458 / (638_976 * 10**5))  # 128 x 499.2 MHz


def collect(
    radio: Radio,
    count: int,
    pose: Pose2 = AT,
    people: tuple[PersonState, ...] = (),
    slot_ns: int = SLOT_NS,
) -> tuple[list[ExchangeSample], list[RangeTruth]]:
    samples, truths = [], []
    for index in range(1, count + 1):
        sample, truth = radio.exchange(index * slot_ns, pose, people)
        truths.append(truth)
        if sample is not None:
            samples.append(sample)
    return samples, truths


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('reply_delay', [(0.0008, 0.0012), (0.009, 0.01)])
def test_radio_without_noise_tells_the_distance(
    make_scenario: MakeScenario, seed: int, reply_delay: tuple[float, float]
) -> None:
    """Clocks 50 ppm off that wander, 75 s of exchanges: still within 8 mm.

    The rest is the rounding of six registers to ticks of 4.7 mm of flight.
    """
    clocks = {'clock_error_ppm': 50.0, 'clock_walk_ppm': 1.0, 'reply_delay': reply_delay}
    scenario = make_scenario(errors={'uwb': clocks})
    samples, _ = collect(Radio(scenario, seed), 3000)
    tag = AT.transform(np.array(scenario.robot.tag_position[:2]))
    true = {anchor.id: math.dist((*tag, 1.1), anchor.position) for anchor in scenario.anchors}
    errors = np.array([distance_of(sample) - true[sample.anchor_id] for sample in samples])
    assert len(errors) == 3000
    assert np.abs(errors).max() < 0.008
    assert abs(errors.mean()) < 0.0005


def test_radio_counters_wrap_during_an_exchange(make_scenario: MakeScenario) -> None:
    """Registers have 40 bits; exchanges of 20 ms meet the wrap, on either side, and stay right."""
    scenario = make_scenario(errors={'uwb': {'reply_delay': (0.01, 0.01)}})
    runs = [collect(Radio(scenario, seed), 2000) for seed in range(4)]
    samples = [sample for run in runs for sample in run[0]]
    truths = [truth for run in runs for truth in run[1]]
    tag = np.array([(s.poll_tx, s.response_rx, s.final_tx) for s in samples])
    anchor = np.array([(s.poll_rx, s.response_tx, s.final_rx) for s in samples])
    assert min(tag.min(), anchor.min()) >= 0
    assert max(tag.max(), anchor.max()) < 1 << 40
    for registers in (tag, anchor):
        wrapped = np.flatnonzero((np.diff(registers, axis=1) < 0).any(axis=1))
        assert len(wrapped) > 0
        for index in wrapped:
            error = distance_of(samples[index]) - truths[index].distance_m
            assert abs(error) < 0.008


def test_radio_antenna_is_off_centre(make_scenario: MakeScenario) -> None:
    """Turning on the spot changes the ranges by twice the lever arm."""
    scenario = make_scenario()
    ahead = collect(Radio(scenario, 0), 4, Pose2(5.0, 5.0, math.atan2(-5.0, -5.0)))[1][0]
    away = collect(Radio(scenario, 0), 4, Pose2(5.0, 5.0, math.atan2(5.0, 5.0)))[1][0]
    assert ahead.anchor_id == away.anchor_id == 'A0'
    flat = math.hypot(5.0, 5.0)
    assert ahead.distance_m == pytest.approx(math.hypot(flat + 0.05, 1.15))
    assert away.distance_m == pytest.approx(math.hypot(flat - 0.05, 1.15))


def test_radio_serves_anchors_in_turn_and_counts(make_scenario: MakeScenario) -> None:
    samples, _ = collect(Radio(make_scenario(), 0), 9)
    assert [sample.anchor_id for sample in samples] == [f'A{i % 4}' for i in range(9)]
    assert [sample.sequence for sample in samples] == list(range(1, 10))
    assert {sample.tag_id for sample in samples} == {'tag'}


def test_radio_noise_in_sight_is_normal_with_range_std(make_scenario: MakeScenario) -> None:
    """The spread of the range, not of one timestamp, is what is configured."""
    scenario = make_scenario(errors={'uwb': {'range_std': 0.08}})
    samples, truths = collect(Radio(scenario, 3), 4000)
    errors = np.array(
        [distance_of(s) - t.distance_m for s, t in zip(samples, truths, strict=True)]
    )
    # Reply delays differ by up to 20 %, which shifts the weights of the receptions a little.
    assert errors.std() == pytest.approx(0.08, rel=0.05)
    assert stats.kstest(errors / errors.std(), 'norm').pvalue > 0.01
    assert abs(errors.mean()) < 4 * 0.08 / math.sqrt(4000)


def test_radio_bias_and_scale_are_constant_per_anchor(make_scenario: MakeScenario) -> None:
    """Each link is off by its own bias + scale x distance, and only by that."""
    scenario = make_scenario(errors={'uwb': {'bias_std': 0.1, 'scale_std': 0.01}})
    radio = Radio(scenario, 7)
    samples, truths = collect(radio, 400)
    for anchor_id, bias in radio.bias_m.items():
        pairs = [
            (distance_of(s), t.distance_m)
            for s, t in zip(samples, truths, strict=True)
            if s.anchor_id == anchor_id
        ]
        found = np.mean([measured - true for measured, true in pairs])
        assert found == pytest.approx(bias + radio.scale[anchor_id] * pairs[0][1], abs=1e-3)


def test_radio_biases_spread_as_configured(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(errors={'uwb': {'bias_std': 0.1, 'scale_std': 0.01}})
    radios = [Radio(scenario, seed) for seed in range(150)]
    biases = [bias for radio in radios for bias in radio.bias_m.values()]
    scales = [scale for radio in radios for scale in radio.scale.values()]
    assert stats.kstest(biases, stats.norm(0, 0.1).cdf).pvalue > 0.01
    assert stats.kstest(scales, stats.norm(0, 0.01).cdf).pvalue > 0.01


def test_radio_loses_as_configured_and_counts(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(errors={'uwb': {'loss_probability': 0.1}})
    radio = Radio(scenario, 1)
    samples, truths = collect(radio, 4000)
    lost = [truth for truth in truths if truth.lost]
    assert len(samples) + len(lost) == 4000
    assert sum(radio.lost.values()) == len(lost)
    assert stats.binomtest(len(lost), 4000, 0.1).pvalue > 0.01


def blocked_room(make_scenario: MakeScenario, **uwb: object) -> Scenario:
    """Return a room where a high wall stands between the robot and anchor A2 alone."""
    wall = Wall(points=((8.0, 6.0), (6.0, 8.0)), name='screen')
    hull = make_scenario().walls[0]
    return make_scenario(walls=(hull, wall), errors={'uwb': uwb})


def test_radio_behind_a_wall_is_late_uniformly_within_its_bounds(
    make_scenario: MakeScenario,
) -> None:
    """Only A2 is out of sight; at any time its detour is uniform between least and most."""
    scenario = blocked_room(make_scenario, nlos_excess=(0.2, 1.0), nlos_hold=0.05)
    samples, truths = collect(Radio(scenario, 2), 8000)
    late: dict[str, list[float]] = {f'A{i}': [] for i in range(4)}
    for sample, truth in zip(samples, truths, strict=True):
        late[truth.anchor_id].append(distance_of(sample) - truth.distance_m)
        assert truth.blocked_by == ('thing' if truth.anchor_id == 'A2' else '')
    for anchor_id in ('A0', 'A1', 'A3'):
        assert np.abs(late[anchor_id]).max() < 0.01
    # One in three: neighbours 0.1 s apart correlate by exp(-2), those by exp(-6).
    assert stats.kstest(late['A2'][::3], stats.uniform(0.2, 0.8).cdf).pvalue > 0.01


def test_radio_detour_changes_slowly(make_scenario: MakeScenario) -> None:
    """With a hold of 10 s, neighbours 0.1 s apart are much nearer than any two."""
    scenario = blocked_room(make_scenario, nlos_hold=10.0, nlos_excess=(0.2, 1.0))
    truths = collect(Radio(scenario, 2), 8000)[1]
    detours = np.array([truth.excess_m for truth in truths if truth.anchor_id == 'A2'])
    assert np.std(np.diff(detours)) < 0.25 * np.std(detours)


def test_radio_noise_out_of_sight_adds_up(make_scenario: MakeScenario) -> None:
    scenario = blocked_room(make_scenario, range_std=0.06, nlos_std=0.08)
    samples, truths = collect(Radio(scenario, 2), 8000)
    errors = np.array(
        [
            distance_of(s) - t.distance_m - t.excess_m
            for s, t in zip(samples, truths, strict=True)
            if t.blocked_by
        ]
    )
    assert errors.std() == pytest.approx(0.10, rel=0.05)


def test_radio_powers_tell_sight_from_none(make_scenario: MakeScenario) -> None:
    """The first path lies less than 6 dB under the rest in sight, mostly more than 10 behind."""
    scenario = blocked_room(make_scenario, power_std=1.0, nlos_excess=(0.2, 1.0), nlos_hold=0.1)
    samples, truths = collect(Radio(scenario, 5), 4000)
    gaps = np.array([s.rx_power_dbm - s.first_path_power_dbm for s in samples])
    blocked = np.array([bool(t.blocked_by) for t in truths])
    assert np.mean(gaps[~blocked] < 6.0) > 0.99
    assert np.mean(gaps[blocked] > 10.0) > 0.75
    assert np.mean(gaps[blocked] < 6.0) < 0.01
    powers = np.array([s.rx_power_dbm for s in samples])
    assert -100 < powers.min() < powers.max() < -60
    assert powers[~blocked].mean() > powers[blocked].mean() + 5.0


def test_radio_power_falls_by_six_decibels_with_twice_the_distance(
    make_scenario: MakeScenario,
) -> None:
    scenario = make_scenario(robot=make_scenario().robot.replace(tag_position=(0.0, 0.0, 2.25)))
    near, far = (
        collect(Radio(scenario, 0), 1, Pose2(x, 0.0, 0.0))[0][0].rx_power_dbm for x in (2.0, 4.0)
    )
    assert near - far == pytest.approx(20 * math.log10(2.0), abs=1e-9)


def test_radio_behind_a_person_is_late_by_less(
    make_scenario: MakeScenario, make_person: Callable[..., Person]
) -> None:
    """A person of 1.7 m half a metre from the tag covers the anchor behind; a child may not."""
    person = make_person(name='p')
    tag = AT.transform(np.array([-0.05, 0.0]))
    course = math.atan2(10.0 - tag[1], 10.0 - tag[0])
    at = Pose2(tag[0] + 0.5 * math.cos(course), tag[1] + 0.5 * math.sin(course), 0.0)
    state = PersonState('p', at, 0.0, 0.25)
    for height, expected in ((1.7, {'A2'}), (1.0, set())):
        scenario = make_scenario(
            people=(person.replace(height=height),),
            errors={'uwb': {'person_excess': (0.1, 0.5)}},
        )
        samples, truths = collect(Radio(scenario, 1), 400, people=(state,))
        assert {t.anchor_id for t in truths if t.blocked_by == 'person'} == expected
        for sample, truth in zip(samples, truths, strict=True):
            late = distance_of(sample) - truth.distance_m
            assert late == pytest.approx(truth.excess_m, abs=0.01)
            assert 0.1 <= truth.excess_m <= 0.5 or not truth.blocked_by


def test_radio_same_seed_same_registers_other_seed_others(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(errors={'uwb': {'range_std': 0.1, 'loss_probability': 0.1}})
    assert collect(Radio(scenario, 4), 200) == collect(Radio(scenario, 4), 200)
    assert collect(Radio(scenario, 4), 200)[0] != collect(Radio(scenario, 5), 200)[0]


def test_radio_links_do_not_disturb_each_other(make_scenario: MakeScenario) -> None:
    """A box before one anchor changes that link alone, to the last tick of the others."""
    box = Box(name='column', x=8.0, y=7.6, length=1.5, width=1.5, height=2.5)
    noisy = {'uwb': {'range_std': 0.1, 'loss_probability': 0.05}}
    free, _ = collect(Radio(make_scenario(errors=noisy), 4), 200)
    hidden, _ = collect(Radio(make_scenario(errors=noisy, boxes=(box,)), 4), 200)
    assert [s for s in free if s.anchor_id != 'A2'] == [s for s in hidden if s.anchor_id != 'A2']
    assert [s for s in free if s.anchor_id == 'A2'] != [s for s in hidden if s.anchor_id == 'A2']
