"""Filters over arrays against the single ones, run by run, to 1e-9."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablerunner.estimation import EstimatorConfig, Start
from tablerunner.estimation.batch import BatchEkf, BatchEkfCv, BatchEstimate
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.ekf_cv import EkfCv
from tablerunner.odometry.batch import Motions
from tablerunner.odometry.motion import Motion
from tablerunner.types import Anchor, Estimate, RangeSample

ANCHORS = (
    Anchor('A0', (0.0, 0.0, 2.25), 0.07),
    Anchor('A1', (12.0, 0.0, 2.25)),
    Anchor('A2', (12.0, 9.0, 1.8), -0.1),
)
LEVER = (-0.1, 0.05, 1.1)
PAIRS = {'ekf': (Ekf, BatchEkf), 'ekf_cv': (EkfCv, BatchEkfCv)}
RUNS = 9


def states(rng: np.random.Generator, name: str) -> list[Estimate]:
    """Return estimates anywhere, with full covariances of all sizes and histories of all kinds."""
    found = []
    for _ in range(RUNS):
        single = PAIRS[name][0](EstimatorConfig(), ANCHORS, LEVER)
        pose = np.array([rng.uniform(0, 12), rng.uniform(0, 9), rng.uniform(-math.pi, math.pi)])
        first = single.start(Start(1, pose, np.diag(rng.uniform(1e-4, 0.1, 3))))
        size = len(first.mean)
        mixed = np.eye(size) + 0.3 * rng.normal(size=(size, size))
        covariance = mixed @ first.covariance @ mixed.T
        mean = first.mean + np.sqrt(np.diag(covariance)) * rng.normal(size=size) * 0.5
        mean[2] = pose[2]
        memory = tuple(rng.uniform(-2.0, 2.0, len(first.memory)))
        twist = (rng.uniform(-0.5, 0.7), rng.uniform(-1.0, 1.0))
        found.append(
            first._replace(
                mean=mean,
                covariance=0.5 * (covariance + covariance.T),
                memory=memory,
                twist=twist,
            )
        )
    return found


def together(estimates: list[Estimate]) -> BatchEstimate:
    return BatchEstimate(
        np.array([one.mean for one in estimates]),
        np.array([one.covariance for one in estimates]),
        np.array([one.twist for one in estimates]),
        np.array([one.memory for one in estimates]).reshape(len(estimates), -1),
    )


def assert_same(batch: BatchEstimate, singles: list[Estimate]) -> None:
    for run, single in enumerate(singles):
        off = batch.mean[run] - single.mean
        off[2] = math.remainder(off[2], 2 * math.pi)
        assert np.abs(off).max() < 1e-9
        assert batch.covariance[run] == pytest.approx(single.covariance, abs=1e-9)
        assert np.array_equal(batch.covariance[run], batch.covariance[run].T)
        assert batch.twist[run] == pytest.approx(single.twist, abs=1e-9)
        assert batch.memory[run] == pytest.approx(np.array(single.memory), abs=1e-9)


def config_of(rng: np.random.Generator) -> EstimatorConfig:
    return EstimatorConfig(
        huber=rng.uniform(0.5, 3.0),
        gate=rng.uniform(2.0, 30.0),
        persistence=rng.uniform(0.3, 1.5),
        doubt=rng.uniform(0.3, 1.5),
        range_bias_std=0.05,
        range_bias_common_std=0.02,
        doubt_limit=rng.uniform(0.1, 1.0),
    )


@pytest.mark.parametrize('name', PAIRS)
@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_predict_equals_the_single_filter(name: str, seed: int) -> None:
    """Driving, turning, standing, slipping wheels, and steps of no time at all."""
    rng = np.random.default_rng(seed)
    config = config_of(rng)
    single, batch = (kind(config, ANCHORS, LEVER) for kind in PAIRS[name])
    estimates = states(rng, name)
    distance, turn = rng.normal(0, 0.05, RUNS), rng.normal(0, 0.05, RUNS)
    dt_s, told = rng.uniform(0.01, 0.2, RUNS), rng.uniform(0, 1e-3, RUNS)
    distance[:2] = turn[:2] = 0.0  # stand
    dt_s[1] = told[1] = 0.0
    motions = Motions(distance, turn, dt_s, told)
    expected = [
        single.predict(one, Motion(*values), 2)
        for one, *values in zip(estimates, distance, turn, dt_s, told, strict=True)
    ]
    assert_same(batch.predict(together(estimates), motions), expected)


@pytest.mark.parametrize('name', PAIRS)
@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_update_equals_the_single_filter(name: str, seed: int) -> None:
    """Ranges that fit, that lose weight, beyond the gate, blocked, lost, of unknown variance."""
    rng = np.random.default_rng(seed)
    config = config_of(rng)
    single, batch = (kind(config, ANCHORS, LEVER) for kind in PAIRS[name])
    estimates = states(rng, name)
    anchor = int(rng.integers(len(ANCHORS)))
    distance = [
        math.dist((*one.mean[:2], LEVER[2]), ANCHORS[anchor].position) for one in estimates
    ]
    range_m = np.array(distance) + rng.normal(0, rng.choice([0.1, 0.5, 2.0]), RUNS)
    probability = rng.choice([0.0, 0.02, 0.7, math.nan], RUNS)
    variance = float(rng.choice([0.0, 0.01, 1e-9]))
    range_m[0] = math.nan
    after, innovation = batch.update_range(
        together(estimates), anchor, range_m, variance, probability
    )
    expected = [estimates[0]]
    assert not innovation.accepted[0]
    assert math.isnan(innovation.nis[0])
    for run in range(1, RUNS):
        name_ = ANCHORS[anchor].anchor_id
        sample: Any = RangeSample(
            1, name_, 'tag', run, range_m[run], variance, nlos_probability=probability[run]
        )
        corrected, told = single.update(estimates[run], sample)
        expected.append(corrected)
        assert innovation.accepted[run] == told.accepted
        assert innovation.nis[run] == pytest.approx(told.nis, rel=1e-9)
        assert innovation.spread[run] == pytest.approx(told.covariance[0, 0], rel=1e-9)
        assert innovation.innovation[run] == pytest.approx(told.innovation[0], abs=1e-9)
    assert_same(after, expected)


@pytest.mark.parametrize('name', PAIRS)
def test_start_equals_the_single_filter(name: str) -> None:
    single, batch = (kind(EstimatorConfig(), ANCHORS, LEVER) for kind in PAIRS[name])
    start = Start(5, np.array([1.0, 2.0, 4.0]), np.diag([0.1, 0.2, 0.3]))
    assert_same(batch.start(start, 4), [single.start(start)] * 4)


def test_update_leaves_what_it_was_given_alone() -> None:
    """Values in, values out: nothing is changed in place."""
    rng = np.random.default_rng(1)
    for name, (_, kind) in PAIRS.items():
        batch = kind(EstimatorConfig(), ANCHORS, LEVER)
        before = together(states(rng, name))
        copies = [np.array(before.mean), np.array(before.covariance), np.array(before.memory)]
        motions = Motions(*(np.full(RUNS, value) for value in (0.1, 0.1, 0.1, 0.0)))
        batch.predict(before, motions)
        batch.update_range(before, 0, np.full(RUNS, 5.0), 0.01, np.zeros(RUNS))
        for value, copy in zip(
            (before.mean, before.covariance, before.memory), copies, strict=True
        ):
            assert np.array_equal(value, copy)
