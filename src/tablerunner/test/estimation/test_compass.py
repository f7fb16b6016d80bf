"""A heading is taken from the field where it is the earth's, and nowhere else."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.estimation import EstimatorConfig, Localizer, LocalizerConfig, Start
from tablerunner.estimation.compass import Compass, CompassConfig
from tablerunner.estimation.ekf import Ekf
from tablerunner.geometry.angles import wrap
from tablerunner.types import HeadingSample, MagneticSample, Refusal

CONFIG = CompassConfig(use=True, north=0.7, interval=0.0)


def field(heading, stamp=1_000_000_000, extra=(0.0, 0.0, 0.0)):
    """Return what a robot reads that heads so, with iron that adds `extra` in map."""
    x = CONFIG.horizontal * math.cos(CONFIG.north) + extra[0]
    y = CONFIG.horizontal * math.sin(CONFIG.north) + extra[1]
    cos, sin = math.cos(heading), math.sin(heading)
    return MagneticSample(stamp, cos * x + sin * y, -sin * x + cos * y, CONFIG.vertical + extra[2])


@given(st.floats(-math.pi, math.pi))
def test_add_any_heading_comes_back(heading):
    """Reading and heading are inverse, across the seam too."""
    found = Compass(CONFIG).add(field(heading))
    assert isinstance(found, HeadingSample)
    assert wrap(found.heading_rad - heading) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('extra', [(12e-6, 0, 0), (-9e-6, -5e-6, 0), (0, 0, 9e-6), (0, 0, -9e-6)])
def test_add_field_bent_by_iron_is_refused(extra):
    """Strength or dip that is not the earth's: no heading, and a reason."""
    refused = Compass(CONFIG).add(field(0.3, extra=extra))
    assert isinstance(refused, Refusal)
    assert refused.reason == 'field not plausible'


@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_add_field_that_is_no_number_is_refused(value):
    """NaN and infinity are named."""
    refused = Compass(CONFIG).add(MagneticSample(5, value, 0.0, 0.0))
    assert refused == Refusal(5, 'imu/mag', '', 'field not finite')


def test_add_sooner_than_the_interval_is_left_out():
    """Neighbouring readings share their error: one in half a second is enough."""
    compass = Compass(CompassConfig(use=True, north=0.7))
    given_ = [
        compass.add(field(0.0, stamp=1_000_000_000 + k * 50_000_000)) is not None
        for k in range(40)
    ]
    assert [k for k, value in enumerate(given_) if value] == [0, 10, 20, 30]


def test_update_heading_equals_the_linear_filter(room):
    """A heading is a linear measurement; off by far more than both deviations it is refused."""
    ekf = Ekf(EstimatorConfig(), room.anchors, room.lever)
    before = ekf.start(Start(1, np.array([4.0, 3.0, 3.1]), np.diag([0.01, 0.01, 0.04])))
    after, innovation = ekf.update(before, HeadingSample(2, -3.1, 0.01, 'imu/mag'))
    step = wrap(-3.1 - 3.1)
    assert innovation.accepted
    assert wrap(float(after.mean[2]) - 3.1) == pytest.approx(0.8 * step)
    assert after.covariance[2, 2] == pytest.approx(0.008)
    _, innovation = ekf.update(before, HeadingSample(2, 1.0, 0.01, 'imu/mag'))
    assert (innovation.accepted, innovation.reason) == (False, 'beyond the gate')


def test_localizer_with_compass_holds_the_heading_that_the_gyro_loses(room):
    """A gyro that drifts on a straight: a good compass shows the heading before ranges do."""
    errors = {}
    for use in (False, True):
        found = []
        for seed in range(8):
            drive = room.drive(seed, seconds=6.0, drift=0.05, turning=False)
            start = drive.truth[min(drive.truth)]
            localizer = Localizer(
                LocalizerConfig(
                    tag_position=room.lever,
                    initial_pose=(start.x, start.y, start.heading),
                    compass=CONFIG.replace(interval=0.5, heading_std=0.03),
                ),
                room.anchors,
            )
            ranges = list(drive.ranges)
            for odometry in drive.odometry:
                while ranges and ranges[0].stamp <= odometry.stamp:
                    localizer.add_range(ranges.pop(0))
                localizer.add_odometry(odometry)
                truth = drive.truth[odometry.stamp]
                if use:
                    localizer.add_magnetic(field(truth.heading, odometry.stamp))
                found.append(wrap(localizer.estimate.pose.heading - truth.heading))
        errors[use] = float(np.sqrt(np.mean(np.square(found))))
    assert errors[True] < 0.7 * errors[False]
