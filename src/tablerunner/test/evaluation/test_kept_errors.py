"""What is kept of the errors of many runs, and how much memory that takes."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.evaluation.kept_errors import KEEP, ErrorKeeper, KeptErrors


def feed(keep: str, stamps: int, runs: int, seed: int = 0) -> tuple[KeptErrors, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = np.zeros((stamps, 2, runs))
    ends = rng.integers(1, stamps + 1, runs)
    ends[0] = 0  # a run that never was
    counts = np.arange(stamps)[:, None] < ends
    keeper = ErrorKeeper(keep, truth, counts)
    places = rng.normal(size=(stamps, runs, 2))
    for index in range(stamps):
        keeper.add(index, places[index])
    error = np.where(counts, np.linalg.norm(places, axis=2), np.nan)
    return keeper.result(), error


@pytest.mark.parametrize('keep', KEEP)
def test_figures_are_those_of_all_errors_of_a_run(keep):
    kept, error = feed(keep, 40, 6)
    assert np.isnan(kept.largest[0])
    assert np.isnan(kept.final[0])
    for run in range(1, 6):
        own = error[~np.isnan(error[:, run]), run]
        assert kept.largest[run] == pytest.approx(own.max())
        assert kept.mean[run] == pytest.approx(own.mean())
        assert kept.rms[run] == pytest.approx(np.sqrt(np.mean(own**2)))
        assert kept.final[run] == pytest.approx(own[-1])
    assert (kept.errors is None) == (keep == 'summary')
    assert (kept.places is None) == (keep != 'all')
    if kept.errors is not None:
        assert kept.errors == pytest.approx(error, nan_ok=True)
    if kept.places is not None:
        found = np.hypot(kept.places[:, 0], kept.places[:, 1])
        assert found == pytest.approx(error, nan_ok=True)


def kept_bytes(keep: str, stamps: int, runs: int) -> int:
    """Return what stays in memory when everything has been added, truth not counted."""
    truth = np.zeros((stamps, 2, runs))
    counts = np.ones((stamps, runs), dtype=bool)
    places = np.ones((runs, 2))
    tracemalloc.start()
    try:
        keeper = ErrorKeeper(keep, truth, counts)
        for index in range(stamps):
            keeper.add(index, places)
        result = keeper.result()
        del keeper
        size, _ = tracemalloc.get_traced_memory()
        assert len(result.largest) == runs
    finally:
        tracemalloc.stop()
    return size


@pytest.mark.parametrize(('keep', 'for_each_stamp'), [('summary', 0), ('errors', 8), ('all', 24)])
def test_memory_is_linear_in_what_is_kept(keep, for_each_stamp):
    """As the module says: 32 bytes for each run, and so many for each stamp."""
    for stamps, runs in ((200, 400), (400, 400), (200, 800)):
        expected = runs * (32 + for_each_stamp * stamps)
        # Some 2 kB of Python's own objects.
        assert expected <= kept_bytes(keep, stamps, runs) <= expected * 1.02 + 4000


def test_keeping_something_else_is_refused():
    with pytest.raises(ConfigError, match=r'keep.*summary, errors, all'):
        ErrorKeeper('everything', np.zeros((1, 2, 1)), np.ones((1, 1), dtype=bool))
