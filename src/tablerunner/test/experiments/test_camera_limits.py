"""The limits of finding a marker: one mild case, and one in which nothing can be seen."""

from __future__ import annotations

import pytest

from tablerunner.experiments.camera_limits import CONDITIONS, FOUND, WORST_M, run_case


@pytest.mark.parametrize('index', range(len(CONDITIONS)), ids=lambda i: CONDITIONS[i].name)
def test_limits_lie_among_the_values(index: int) -> None:
    condition = CONDITIONS[index]
    assert any(condition.limits[0] <= value <= condition.limits[1] for value in condition.values)


@pytest.mark.parametrize(('value', 'seen'), [(1.0, True), (3.0, False)])
def test_case_counts_what_is_found(value: float, seen: bool) -> None:
    """In the usual light all are found; at three times as much the colours are burnt out."""
    share, worst = run_case((0, value, 7))
    assert (share >= FOUND) == seen
    assert worst < WORST_M
