"""Radii and track from drives: errors beside what is said of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.evaluation.consistency import chi_square_bounds
from tablerunner.experiments.survey import (
    NEES_SLACK,
    WHEEL_ERRORS,
    WINDING,
    Recorded,
    judge_wheels,
    recorded,
    wheel_data,
)
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry import Odometer, OdometerConfig
from tablerunner.scenario import SensorErrors
from tablerunner.survey.wheel_motion import Sizes, WheelAngles, integrated
from tablerunner.survey.wheels import WheelConfig, fit_wheels
from tablerunner.types import Anchor, OdometrySample, WheelSample


@pytest.fixture(scope='module')
def winding() -> list[Recorded]:
    """Return drives with wheels that are off by 2 %, a track by 4 %, and slips."""
    return recorded(SensorErrors(wheels=WHEEL_ERRORS), range(6), WINDING)


def test_sizes_are_right_and_say_how_right(winding: list[Recorded]) -> None:
    """Errors of six drives against what is stated, from both sides."""
    judged, spread = [], []
    for drive in winding:
        fit = fit_wheels(wheel_data(drive), WheelConfig())
        judged.append(judge_wheels(fit, drive.sizes))
        spread.append(drive.sizes.values / fit.nominal.values - 1.0)
    errors = np.array(judged)
    low, high = chi_square_bounds(3 * len(errors))
    mean = float(errors[:, 3].mean())
    assert low / (3 * len(errors)) / NEES_SLACK < mean < high / (3 * len(errors)) * NEES_SLACK
    # A quarter of a percent is what four anchors with scales of 0.5 % leave; three of it.
    assert np.abs(errors[:, 0]).max() < 0.75
    assert np.sqrt(np.mean(errors[:, 1] ** 2)) < 0.1
    assert np.sqrt(np.mean(errors[:, 2] ** 2)) < 0.6
    # They were worth finding.
    assert np.std(spread) > 0.01


def test_without_a_gyroscope_it_is_less_certain(winding: list[Recorded]) -> None:
    data = wheel_data(winding[0])
    blind = replace(data, wheels=replace(data.wheels, gyro=None))
    alone = fit_wheels(blind, WheelConfig())
    both = fit_wheels(data, WheelConfig())
    assert alone.gyro_scale is None
    assert alone.difference[1] > both.difference[1]
    error = alone.sizes.values - winding[0].sizes.values
    assert np.all(np.abs(error) < 4.0 * alone.std)


def test_wheels_are_integrated_as_by_the_odometer() -> None:
    rng = np.random.default_rng(0)
    angles = np.cumsum(rng.uniform(0.0, 0.2, (100, 2)), axis=0)
    stamps = (1 + np.arange(100)) * 20_000_000
    config = replace(OdometerConfig(), heading_source='wheels')
    odometer, pose = Odometer(config), Pose2()
    for stamp, (left, right) in zip(stamps, angles, strict=True):
        moved = odometer.add_wheels(WheelSample(int(stamp), left, right))
        assert isinstance(moved, OdometrySample)
        pose = moved.pose
    track = integrated(WheelAngles(stamps, angles), Sizes(0.06, 0.06, 0.34))
    np.testing.assert_allclose(track.poses[-1], (pose.x, pose.y, pose.heading), atol=1e-9)


def test_bad_input_is_named(winding: list[Recorded]) -> None:
    data = wheel_data(winding[0])
    with pytest.raises(ConfigError, match=r'A3.*one of A0, A1, A2'):
        fit_wheels(replace(data, anchors=data.anchors[:3]), WheelConfig())
    off = Anchor('A3', (4.0, 15.0, 2.25))
    with pytest.raises(ConfigError, match='m off'):
        fit_wheels(replace(data, anchors=(*data.anchors[:3], off)), WheelConfig())
    end = int(np.searchsorted(data.track.turned, 3.0))
    with pytest.raises(ConfigError, match='degrees of turning'):
        fit_wheels(replace(data, track=data.track.cut(end)), WheelConfig())
