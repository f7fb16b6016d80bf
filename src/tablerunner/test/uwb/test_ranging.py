"""Two-way ranging: exact where physics is exact, and as wrong as theory says where it is not."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.uwb import ranging


def exchange(distance, tag_ppm, anchor_ppm, reply_anchor, reply_tag, tag_zero=0, anchor_zero=0):
    """Return six stamps, written from the physics: true times, then each clock's own count."""
    flight = distance / 299_702_547.0
    true = [0.0, flight, flight + reply_anchor]
    true += [true[2] + flight, true[2] + flight + reply_tag]
    true += [true[4] + flight]
    rate = 128 * 499.2e6
    owner = ['tag', 'anchor', 'anchor', 'tag', 'tag', 'anchor']
    ppm = {'tag': tag_ppm, 'anchor': anchor_ppm}
    zero = {'tag': tag_zero, 'anchor': anchor_zero}
    return [
        (zero[who] + round(at * rate * (1 + ppm[who] * 1e-6))) % (1 << 40)
        for at, who in zip(true, owner, strict=True)
    ]


TICK_M = 299_702_547.0 / (128 * 499.2e6)


@given(
    st.floats(0.1, 60.0),
    st.floats(-20, 20),
    st.floats(-20, 20),
    st.floats(2e-4, 3e-3),
    st.floats(2e-4, 3e-3),
    st.integers(0, (1 << 40) - 1),
    st.integers(0, (1 << 40) - 1),
)
def test_double_sided_any_drift_and_wrap_gives_the_distance(
    distance, tag, anchor, reply_anchor, reply_tag, tag_zero, anchor_zero
):
    """Drift of 20 ppm, unequal replies and wrapped counters leave tick rounding and tof * ppm."""
    stamps = exchange(distance, tag, anchor, reply_anchor, reply_tag, tag_zero, anchor_zero)
    measured = ranging.distance(ranging.double_sided(*ranging.intervals(*stamps)))
    assert measured == pytest.approx(distance, abs=2 * TICK_M + 20e-6 * distance)


def test_simpler_forms_feel_drift_as_theory_says():
    """Single-sided: half the drift times the reply; symmetric: a quarter of the difference."""
    drift, reply_anchor, reply_tag = 10e-6, 1e-3, 3e-3
    stamps = exchange(10.0, 10.0, 0.0, reply_anchor, reply_tag)
    times = ranging.intervals(*stamps)
    light = ranging.SPEED_OF_LIGHT_M_S
    single = ranging.distance(ranging.single_sided(times[0], times[1])) - 10.0
    symmetric = ranging.distance(ranging.symmetric_double_sided(*times)) - 10.0
    assert single == pytest.approx(light * drift * reply_anchor / 2, rel=0.01)
    assert symmetric == pytest.approx(light * drift * (reply_anchor - reply_tag) / 4, rel=0.01)


def test_array_of_exchanges_equals_one_at_a_time():
    """Whole arrays give what single exchanges give."""
    rng = np.random.default_rng(3)
    stamps = np.array(
        [
            exchange(distance, 5, -3, 1e-3, 1.2e-3, int(rng.integers(1 << 40)), 7)
            for distance in rng.uniform(1, 30, 50)
        ]
    )
    together = ranging.double_sided(*ranging.intervals(*stamps.T))
    alone = [ranging.double_sided(*ranging.intervals(*map(int, row))) for row in stamps]
    assert together == pytest.approx(np.array(alone), abs=1e-15)


def test_calibrated_undoes_the_error_model():
    """Bias and scale put on (Sun 34-35) are taken off (Sun 36)."""
    true = np.array([1.0, 5.0, 20.0])
    assert ranging.calibrated(true * 1.03 + 0.2, 0.2, 0.03) == pytest.approx(true)


def test_nlos_probability_rises_with_the_power_gap():
    """Below 6 dB likely clear, above 10 dB likely blocked, unknown where a power is unknown."""
    at = [ranging.nlos_probability(-80.0, -80.0 - gap, 8.0, 1.0) for gap in (2, 6, 8, 10, 20)]
    assert at == sorted(at)
    assert at[1] < 0.15
    assert at[2] == pytest.approx(0.5)
    assert at[3] > 0.85
    assert math.isnan(ranging.nlos_probability(math.nan, -80.0, 8.0, 1.0))


def test_nlos_corrected_takes_the_constant_off_blocked_ranges_only():
    """A blocked range loses the building's constant, a clear one nothing (Sun 37)."""
    found = ranging.nlos_corrected(np.array([5.0, 6.0]), np.array([True, False]), 0.4)
    assert found.tolist() == pytest.approx([4.6, 6.0])
    assert ranging.nlos_corrected(5.0, True, 0.4) == pytest.approx(4.6)
