from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from tablerunner.config import Document
from tablerunner.control.fuzzy import RuleBase, base_names, load_base, read_base
from tablerunner.errors import ConfigError

METHODS = [
    (conjunction, defuzzification)
    for conjunction in ('min', 'product')
    for defuzzification in ('weighted_average', 'centroid')
]


@pytest.fixture
def base(text: str) -> RuleBase:
    return read_base(Document.parse(text, 'brake.yaml'), 'brake')


def by_the_book(base: RuleBase, row: np.ndarray) -> float:
    """Return the output by plain loops over rules and a fine grid, from the definitions."""
    used = [min(max(x, v.low), v.high) for x, v in zip(row, base.inputs, strict=True)]
    heights = [0.0] * len(base.output.sets)
    weighted = total = 0.0
    for rule in base.rules:
        strength = 1.0
        for index, word in rule.when:
            member = base.inputs[index].sets[word].membership
            degree = float(member.degrees(np.array([used[index]]))[0])
            strength = min(strength, degree) if base.conjunction == 'min' else strength * degree
        heights[rule.then] = max(heights[rule.then], strength)
        weighted += strength * base.output.centres()[rule.then]
        total += strength
    if base.defuzzification == 'weighted_average':
        return weighted / total
    grid = np.linspace(base.output.low, base.output.high, 20001)
    union = np.zeros_like(grid)
    for item, height in zip(base.output.sets, heights, strict=True):
        union = np.maximum(union, np.minimum(item.membership.degrees(grid), height))
    return float(np.sum(grid * union) / np.sum(union))


def rows_of(base: RuleBase, count: int) -> np.ndarray:
    """Return inputs over the domains and a little beyond."""
    low = np.array([item.low for item in base.inputs])
    high = np.array([item.high for item in base.inputs])
    return np.random.default_rng(3).uniform(
        1.1 * low - 0.1 * high, 1.1 * high - 0.1 * low, (count, len(low))
    )


@pytest.mark.parametrize(('conjunction', 'defuzzification'), METHODS)
@pytest.mark.parametrize('name', ['brake', *base_names()])
def test_inference_is_that_of_the_definitions(
    name: str, conjunction: str, defuzzification: str, base: RuleBase
) -> None:
    """Against plain loops; the centroid's grid of 401 points is good to 1e-4 of the domain."""
    chosen = base if name == 'brake' else load_base(name)
    chosen = replace(chosen, conjunction=conjunction, defuzzification=defuzzification)
    rows = rows_of(chosen, 60)
    expected = [by_the_book(chosen, row) for row in rows]
    width = chosen.output.high - chosen.output.low
    tolerance = 1e-12 if defuzzification == 'weighted_average' else 1e-4
    np.testing.assert_allclose(chosen.infer(rows), expected, atol=tolerance * width)


def test_weighted_average_by_hand(base: RuleBase) -> None:
    """Lv (12) at distance 2 m, speed 1: degrees 2/3, 1/3; exp(-25/18), 0.8; centres 0, 40, 95."""
    slow = math.exp(-0.5 * (1.0 / 0.6) ** 2)
    strengths = [min(2 / 3, slow), min(2 / 3, 0.8), min(1 / 3, slow), min(1 / 3, 0.8)]
    expected = np.dot(strengths, [40.0, 95.0, 0.0, 40.0]) / sum(strengths)
    assert base.infer_one(2.0, 1.0) == pytest.approx(expected, rel=1e-12)


def test_many_inputs_at_once_are_each_as_alone(base: RuleBase) -> None:
    """Also across the batches of 4096."""
    rows = rows_of(base, 9000)
    together = base.infer(rows)
    assert together.shape == (9000,)
    for index in (0, 4095, 4096, 8191, 8192, 8999):
        # The sum over rules may be taken in another order.
        assert base.infer_one(*rows[index]) == pytest.approx(together[index], rel=1e-12)


def test_infinity_counts_as_the_end_of_a_domain_and_nan_stays_nan(base: RuleBase) -> None:
    assert base.infer_one(math.inf, 1.0) == base.infer_one(10.0, 1.0)
    assert base.infer_one(-math.inf, 1.0) == base.infer_one(0.0, 1.0)
    output = base.infer(np.array([[np.nan, 1.0], [2.0, 1.0]]))
    assert math.isnan(output[0])
    assert output[1] == pytest.approx(base.infer_one(2.0, 1.0), rel=1e-12)


@pytest.mark.parametrize('name', base_names())
def test_output_stays_in_its_domain_and_does_not_jump(name: str) -> None:
    """Along straight lines: ten times finer steps make the largest change several times less."""
    base = load_base(name)
    rng = np.random.default_rng(5)
    low = np.array([item.low for item in base.inputs])
    high = np.array([item.high for item in base.inputs])
    for _ in range(5):
        ends = rng.uniform(low, high, (2, len(low)))
        line = ends[0] + np.linspace(0.0, 1.0, 20001)[:, None] * (ends[1] - ends[0])
        output = base.infer(line)
        assert base.output.low - 1e-12 <= output.min()  # rounding of the mean
        assert output.max() <= base.output.high + 1e-12
        coarse, fine = (np.abs(np.diff(part)).max() for part in (output[::10], output))
        assert fine <= 0.25 * coarse + 1e-12


def test_trace_tells_the_whole_decision(base: RuleBase) -> None:
    trace = base.trace({'speed': 1.0, 'distance': 2.0})
    assert trace.output == pytest.approx(base.infer_one(2.0, 1.0), rel=1e-12)
    assert (trace.base, trace.name, trace.unit) == ('brake', 'brake', '%')
    assert [item.name for item in trace.inputs] == ['distance', 'speed']
    assert dict(trace.inputs[0].degrees) == {
        'near': pytest.approx(2 / 3),
        'middle': pytest.approx(1 / 3),
        'far': 0.0,
    }
    strengths = [item.strength for item in trace.fired]
    assert strengths == sorted(strengths, reverse=True)
    assert len(trace.fired) == 4  # distance is not far at all
    first = trace.fired[0]
    assert first.rule == 'first, near/fast'
    assert first.when == (('distance', 'near'), ('speed', 'fast'))
    assert (first.then, first.strength) == ('full', pytest.approx(2 / 3))
    assert sum(item.share for item in trace.fired) == pytest.approx(1.0)
    # What fired is enough to compute the output again.
    assert sum(item.share * item.centre for item in trace.fired) == pytest.approx(trace.output)


def test_trace_shows_what_was_given_and_what_was_used(base: RuleBase) -> None:
    item = base.trace({'speed': -3.0, 'distance': math.inf}).inputs
    assert (item[0].given, item[0].used) == (math.inf, 10.0)
    assert (item[1].given, item[1].used) == (-3.0, 0.0)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'distance': 1.0}, "speed: got 'nothing', expected a number from 0 to 2"),
        (
            {'distance': math.nan, 'speed': 1.0},
            'distance: got nan, expected a number from 0 to 10',
        ),
        ({'distance': 1.0, 'speed': 1.0, 'weather': 3.0}, 'weather: got 3.0, expected an input'),
    ],
)
def test_trace_refuses_missing_unknown_and_nan(base: RuleBase, values, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        base.trace(values)


def test_records_are_frozen_and_methods_known(base: RuleBase) -> None:
    with pytest.raises(FrozenInstanceError):
        base.name = 'other'
    for field in ('conjunction', 'defuzzification'):
        with pytest.raises(ConfigError, match=f"{field}: got 'mean', expected one of"):
            replace(base, **{field: 'mean'})
