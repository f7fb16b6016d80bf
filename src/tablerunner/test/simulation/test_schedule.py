"""When sensors are due, and their random streams."""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.simulation.schedule import Schedule
from tablerunner.simulation.streams import stream


@pytest.mark.parametrize(('rate', 'count'), [(100.0, 1000), (50.0, 500), (40.0, 400), (30.0, 300)])
def test_schedule_keeps_the_rate_on_average(rate: float, count: int) -> None:
    """Also where the period is no multiple of the step of 10 ms."""
    schedule = Schedule(1.0 / rate, 0)
    fired = [now for now in range(0, 10_000_000_001, 10_000_000) if schedule.is_due(now)]
    assert len(fired) == count
    exact = np.arange(1, count + 1) / rate * 1e9
    late = np.array(fired) - exact
    assert (late > -2).all()
    assert (late < 10_000_001).all()


def test_streams_depend_on_seed_and_name_alone() -> None:
    assert stream(1, 'imu').random() == stream(1, 'imu').random()
    values = {
        stream(seed, name).random() for seed in range(20) for name in ('imu', 'uwb', 'drive')
    }
    assert len(values) == 60


def test_streams_of_different_names_are_uncorrelated() -> None:
    first = stream(5, 'imu').standard_normal(20_000)
    second = stream(5, 'uwb A0').standard_normal(20_000)
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.03
