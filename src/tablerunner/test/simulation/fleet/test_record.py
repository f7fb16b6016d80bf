"""The truth between the stamps of a record."""

import numpy as np
import pytest

from tablerunner.simulation.fleet import FleetRecord


def test_truth_at_interpolates_each_run_and_holds_the_ends():
    rng = np.random.default_rng(1)
    stamps = np.array([10, 20, 40, 50], dtype=np.int64)
    truth = rng.normal(size=(4, 3, 3))
    none = np.empty((0, 3))
    empty = np.empty(0, dtype=np.int64)
    record = FleetRecord(
        stamps,
        truth,
        np.zeros((4, 2, 3)),
        empty,
        none,
        empty,
        empty,
        none,
        none,
        none.astype(bool),
        np.array([50, 40, 20]),
        np.full(3, np.inf),
    )
    asked = rng.integers(0, 60, (30, 3))
    found = record.truth_at(asked)
    assert found.shape == (30, 2, 3)
    for run in range(3):
        for axis in range(2):
            expected = np.interp(asked[:, run], stamps, truth[:, axis, run])
            assert found[:, axis, run] == pytest.approx(expected)
    assert record.counts.sum(axis=0).tolist() == [4, 3, 2]
    assert record.runs == 3
