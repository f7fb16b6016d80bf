"""The magnetometer: the earth's field turned into the robot's axes, dipoles of iron added."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Box, Scenario
from tablerunner.simulation.magnetometer import Magnetometer

MakeScenario = Callable[..., Scenario]


@pytest.mark.parametrize('heading', np.linspace(-3.0, 3.0, 7))
def test_magnetometer_far_from_iron_tells_the_heading(
    make_scenario: MakeScenario, heading: float
) -> None:
    """North minus the direction of the horizontal field in base_link is the heading."""
    scenario = make_scenario(errors={'magnetic': {'north': 1.0}})
    sample = Magnetometer(scenario, np.random.default_rng(0)).read(1, Pose2(5.0, 5.0, heading))
    north_in_base = math.atan2(sample.field_y_t, sample.field_x_t)
    assert math.remainder(1.0 - north_in_base - heading, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert math.hypot(sample.field_x_t, sample.field_y_t) == pytest.approx(20e-6)
    assert sample.field_z_t == pytest.approx(-44e-6)


@pytest.mark.parametrize('distance', [0.8, 1.0, 2.0])
def test_magnetometer_on_the_axis_of_a_dipole_reads_the_textbook_value(
    make_scenario: MakeScenario, distance: float
) -> None:
    """Along the moment mu0 2m / (4 pi r^3), across it -mu0 m / (4 pi r^3)."""
    iron = Box(
        name='iron',
        x=5.0,
        y=5.0,
        length=0.1,
        width=0.1,
        height=0.2,
        magnetic_moment=(30.0, 0.0, 0.0),
    )
    scenario = make_scenario(
        boxes=(iron,), start=None, errors={'magnetic': {'horizontal': 0.0, 'vertical': 0.0}}
    )
    magnetometer = Magnetometer(scenario, np.random.default_rng(0))
    strength = 4e-7 * math.pi * 30.0 / (4 * math.pi * distance**3)
    ahead = magnetometer.field(np.array([5.0 + distance, 5.0, 0.1]))
    beside = magnetometer.field(np.array([5.0, 5.0 + distance, 0.1]))
    assert ahead == pytest.approx([2 * strength, 0.0, 0.0], abs=1e-15)
    assert beside == pytest.approx([-strength, 0.0, 0.0], abs=1e-15)


def test_magnetometer_noise_and_hard_iron_have_the_configured_spread(
    make_scenario: MakeScenario,
) -> None:
    """Hard iron differs from run to run, noise from reading to reading."""
    scenario = make_scenario(errors={'magnetic': {'std': 1e-6, 'hard_iron_std': 5e-6}})
    means, spreads = [], []
    for seed in range(100):
        magnetometer = Magnetometer(scenario, np.random.default_rng(seed))
        values = [magnetometer.read(i, Pose2(5.0, 5.0, 0.0)).field_z_t for i in range(30)]
        means.append(np.mean(values))
        spreads.append(np.std(values))
    assert np.mean(means) == pytest.approx(-44e-6, abs=2e-6)
    assert np.std(means) == pytest.approx(5e-6, rel=0.25)
    assert np.mean(spreads) == pytest.approx(1e-6, rel=0.1)
