from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from tablerunner.control.fuzzy import (
    FuzzySet,
    Gaussian,
    Trapezoid,
    Variable,
    left_shoulder,
    right_shoulder,
    triangle,
)
from tablerunner.control.fuzzy.membership import LARGEST, LEAST_SIDE

NUMBERS = st.floats(-100.0, 100.0)
SIDES = st.floats(LEAST_SIDE, 50.0)


@pytest.mark.parametrize(
    ('member', 'points', 'degrees'),
    [
        (triangle(1.0, 2.0, 4.0), [0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0], [0, 0, 0.5, 1, 0.5, 0, 0]),
        (Trapezoid(0.0, 1.0, 3.0, 5.0), [-1.0, 0.5, 1.0, 3.0, 4.0, 9.0], [0, 0.5, 1, 1, 0.5, 0]),
        (left_shoulder(1.0, 3.0), [-50.0, 1.0, 2.0, 3.0, 50.0], [1, 1, 0.5, 0, 0]),
        (right_shoulder(1.0, 3.0), [-50.0, 1.0, 1.5, 3.0, 50.0], [0, 0, 0.25, 1, 1]),
        (Gaussian(2.0, 0.5), [2.0, 2.5, 1.5], [1, math.exp(-0.5), math.exp(-0.5)]),
    ],
)
def test_degrees_are_those_of_the_definition(member, points, degrees) -> None:
    np.testing.assert_allclose(member.degrees(np.array(points)), degrees, atol=1e-12)


@given(NUMBERS, SIDES, st.floats(0.0, 50.0), SIDES, NUMBERS)
@example(0.0, LEAST_SIDE, 1.0, LEAST_SIDE, 0.0)
def test_degree_of_any_trapezoid_is_interpolated_between_its_corners(
    low: float, rise: float, top: float, fall: float, value: float
) -> None:
    left = low + rise
    corners = low, left, left + top, left + top + fall
    assume(min(corners[1] - corners[0], corners[3] - corners[2]) >= LEAST_SIDE)
    expected = np.interp(value, corners, [0.0, 1.0, 1.0, 0.0], 0.0, 0.0)
    degree = Trapezoid(*corners).degrees(np.array([value]))[0]
    assert 0.0 <= degree <= 1.0
    # Slope times value and slope times corner, up to 260, are rounded before they are subtracted.
    steepest = 1.0 / min(rise, fall)
    assert degree == pytest.approx(expected, abs=1e-12 + 4 * 260 * 2.3e-16 * steepest)


@pytest.mark.parametrize(
    'corners',
    [
        (1.0, 1.0, 1.0, 2.0),
        (0.0, 1.0, 2.0, 2.0),
        (0.0, 2.0, 1.0, 3.0),
        (3.0, 2.0, 1.0, 0.0),
        (0.0, 5e-324, 1.0, 2.0),  # a slope that overflows: its degree was not a number
        (0.0, 1.0, 2.0, math.nan),
        (0.0, 1.0, 2.0, 2.0 * LARGEST),
    ],
)
def test_upright_or_upside_down_sides_are_refused(corners) -> None:
    with pytest.raises(ValueError, match='corners'):
        Trapezoid(*corners)


@pytest.mark.parametrize(
    ('mean', 'std'), [(0.0, 0.0), (0.0, -1.0), (math.nan, 1.0), (0.0, math.inf), (0.0, 5e-324)]
)
def test_bell_without_width_is_refused(mean, std) -> None:
    with pytest.raises(ValueError, match='bell'):
        Gaussian(mean, std)


@pytest.mark.parametrize(
    ('member', 'centre'),
    [
        (triangle(-1.0, 0.25, 1.0), 0.25),
        (Trapezoid(-1.0, -0.5, 0.1, 1.0), -0.2),
        (left_shoulder(-1.0, 0.0), -1.0),
        (left_shoulder(-0.5, 0.0), -0.75),  # the middle of where it is 1, within the domain
        (right_shoulder(0.0, 0.8), 0.9),
        (Gaussian(0.3, 9.0), 0.3),
    ],
)
def test_centre_is_the_middle_of_where_a_set_is_one_in_the_domain(member, centre) -> None:
    assert member.centre(-1.0, 1.0) == pytest.approx(centre)


def two(first, second) -> Variable:
    return Variable('x', 0.0, 10.0, (FuzzySet('a', first), FuzzySet('b', second)))


def test_values_beyond_the_domain_count_as_its_ends() -> None:
    variable = two(triangle(-1.0, 1.0, 9.0), right_shoulder(1.0, 12.0))
    inside = variable.degrees(np.array([0.0, 10.0]))
    np.testing.assert_array_equal(variable.degrees(np.array([-5.0, np.inf])), inside)


def test_barest_value_is_found_between_and_at_corners() -> None:
    value, degree = two(left_shoulder(2.0, 4.0), right_shoulder(4.0, 6.0)).barest()
    assert (value, degree) == (4.0, 0.0)  # a single point
    value, degree = two(left_shoulder(2.0, 4.01), right_shoulder(4.03, 6.0)).barest()
    assert degree == 0.0
    assert 4.01 <= value <= 4.03  # narrower than the grid of 0.05
    value, degree = two(left_shoulder(2.0, 4.0), right_shoulder(2.0, 4.0)).barest()
    assert (value, degree) == (pytest.approx(3.0), pytest.approx(0.5))
    value, degree = two(Gaussian(0.0, 1.0), Gaussian(8.0, 1.0)).barest()
    assert (value, degree) == (pytest.approx(4.0), pytest.approx(math.exp(-8.0)))
