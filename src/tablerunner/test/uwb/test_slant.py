"""Slant ranges, heights and lever arms."""

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.uwb.slant import (
    base_in_map,
    plane_deviation,
    plane_to_slant,
    slant_to_plane,
    tag_in_map,
)

ARM = (0.1, -0.2, 1.1)


def test_slant_to_plane_and_back_is_the_same():
    """Both directions undo each other, for anchors above and below the tag."""
    plane = np.array([0.0, 0.01, 3.0, 40.0])
    for height in (1.15, -0.4, 0.0):
        assert slant_to_plane(plane_to_slant(plane, height), height) == pytest.approx(
            plane, abs=1e-7
        )


@pytest.mark.parametrize('slant', [1.0, -2.0, np.nan])
def test_slant_to_plane_too_short_is_nan(slant):
    """A range shorter than its height, or negative, has no plane distance."""
    assert np.isnan(slant_to_plane(slant, 1.15))


def test_plane_deviation_grows_towards_the_foot_of_the_anchor():
    """The deviation is that of simulated ranges; right below the anchor it has no bound."""
    rng = np.random.default_rng(1)
    slant = plane_to_slant(2.0, 1.5) + rng.normal(0, 0.02, 20_000)
    scatter = slant_to_plane(slant, 1.5).std()
    assert plane_deviation(plane_to_slant(2.0, 1.5), 1.5, 0.02) == pytest.approx(scatter, rel=0.03)
    assert np.isinf(plane_deviation(1.5, 1.5, 0.02))


def test_tag_and_base_undo_each_other():
    """From base to tag and back, for many poses at once."""
    rng = np.random.default_rng(2)
    base, heading = rng.uniform(-9, 9, (20, 2)), rng.uniform(-4, 4, 20)
    tag = tag_in_map(base, heading, ARM)
    assert tag.shape == (20, 3)
    assert tag[:, 2] == pytest.approx(1.1)
    back, _ = base_in_map(tag[:, :2], np.zeros((2, 2)), heading, 0.0, ARM)
    assert back == pytest.approx(base)


def test_tag_ahead_of_the_base_turns_with_it():
    """A quarter turn to the left puts a tag ahead to the left (REP-103)."""
    tag = tag_in_map([1.0, 2.0], np.pi / 2, (0.5, 0.0, 1.0))
    assert tag == pytest.approx([1.0, 2.5, 1.0])


def test_base_covariance_is_that_of_the_scatter():
    """Uncertain heading and tag give the base the scatter that is claimed."""
    rng = np.random.default_rng(3)
    heading = 0.7 + rng.normal(0, 0.1, 20_000)
    tag = rng.normal(0, 0.02, (20_000, 2))
    base, _ = base_in_map(tag, np.zeros((2, 2)), heading, 0.0, (0.6, 0.1, 1.0))
    _, claimed = base_in_map([0.0, 0.0], np.eye(2) * 0.02**2, 0.7, 0.1**2, (0.6, 0.1, 1.0))
    assert np.cov(base.T) == pytest.approx(claimed, rel=0.06, abs=1e-4)


def test_lever_arm_that_is_none_raises():
    """Three finite numbers are needed."""
    with pytest.raises(GeometryError, match='three finite numbers'):
        tag_in_map([0.0, 0.0], 0.0, (0.1, 0.2))
