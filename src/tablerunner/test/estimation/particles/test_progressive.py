"""A sharp measurement of a wide cloud, taken in parts."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.estimation.particles.progressive import FEWEST, largest_part, progressed
from tablerunner.estimation.particles.swarm import Swarm, Way
from tablerunner.estimation.particles.weights import effective_size, normalised

COUNT = 4000


def cloud(seed=0):
    poses = np.random.default_rng(seed).uniform(-5.0, 5.0, (COUNT, 3))
    return Swarm(
        poses,
        np.zeros((COUNT, 3)),
        np.zeros((COUNT, 0)),
        np.full(COUNT, -math.log(COUNT)),
        np.zeros((3, 3)),
        np.empty((0, 0)),
        Way.none(),
    )


def sharp(swarm):
    """Log likelihood of a place known to 2 cm."""
    return -0.5 * np.sum((swarm.poses[:, :2] - (1.0, 2.0)) ** 2, axis=1) / 0.02**2


def jittered(seed):
    rng = np.random.default_rng(seed)

    def resampled(swarm):
        rows = rng.choice(len(swarm), len(swarm), p=np.exp(swarm.log_weights))
        spread = np.minimum(0.3 * swarm.poses[rows].std(axis=0), 0.2)
        poses = swarm.poses[rows] + spread * rng.standard_normal((len(rows), 3))
        even = np.full(len(rows), -math.log(len(rows)))
        return replace(swarm, poses=poses, log_weights=even)

    return resampled


def test_a_part_leaves_as_many_as_it_is_to():
    swarm = cloud()
    gained = sharp(swarm)
    part = largest_part(swarm.log_weights, gained, 1.0)
    assert 0.0 < part < 0.1
    left = normalised(swarm.log_weights + part * gained).log_weights
    assert effective_size(left) == pytest.approx(FEWEST, rel=0.01)


def test_what_leaves_enough_is_taken_whole():
    swarm = cloud()
    assert largest_part(swarm.log_weights, 1e-4 * sharp(swarm), 1.0) == 1.0
    assert largest_part(swarm.log_weights, 1e-4 * sharp(swarm), 0.3) == 0.3


@pytest.mark.parametrize('seed', range(4))
def test_parts_keep_what_the_measurement_says_nothing_of(seed):
    """At once, three particles or so are left; in parts, the third number stays uniform."""
    swarm = cloud(seed)
    at_once = normalised(swarm.log_weights + sharp(swarm)).log_weights
    assert effective_size(at_once) < 5.0
    after = progressed(swarm, sharp(swarm), sharp, jittered(seed))
    weights = np.exp(after.log_weights)
    assert weights.sum() == pytest.approx(1.0)
    assert effective_size(after.log_weights) >= FEWEST
    mean = weights @ after.poses
    spread = np.sqrt(weights @ (after.poses - mean) ** 2)
    assert mean[:2] == pytest.approx([1.0, 2.0], abs=0.01)
    assert spread[:2] == pytest.approx([0.02, 0.02], rel=0.3)
    assert spread[2] == pytest.approx(10.0 / math.sqrt(12.0), rel=0.25)


def test_nothing_that_fits_ends_all_the_same():
    """All but one particle impossible: parts grow small, and it comes to an end."""
    swarm = cloud()
    gained = np.full(COUNT, -np.inf)
    gained[7] = 0.0
    after = progressed(swarm, gained, sharp, jittered(0))
    assert np.exp(after.log_weights).sum() == pytest.approx(1.0)
