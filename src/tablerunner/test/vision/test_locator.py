from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.geometry.angles import wrap
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Marker
from tablerunner.types import ImageSample, Refusal
from tablerunner.vision import CeilingLocator, LocatorConfig, MarkerConfig, Observation

STEP_NS = 100_000_000
PLAIN = Marker(front_radius=0.0, disc_x=0.0)


def locator_of(room: object, marker: MarkerConfig | None = None) -> CeilingLocator:
    worn = MarkerConfig(hues=(329.0,)) if marker is None else marker
    return CeilingLocator(LocatorConfig(mount=room.mount, marker=worn), room.lens)


def test_observation_carries_the_stamp_of_the_exposure(room: object) -> None:
    pose = Pose2(0.3, -0.2, 1.0)
    (seen,) = locator_of(room).add(ImageSample(7 * STEP_NS, room.picture(pose)))
    assert isinstance(seen, Observation)
    assert (seen.sample.stamp, seen.sample.source) == (7 * STEP_NS, 'camera/pose')
    assert seen.sample.pose.distance_to(pose) < 0.002
    assert np.linalg.eigvalsh(seen.sample.covariance)[0] > 0.0


@pytest.mark.parametrize('disc_x', [0.0, -0.1])
def test_plain_disc_takes_its_heading_from_the_course(room: object, disc_x: float) -> None:
    """The first place has none; from the second on it follows the drive, within its variance."""
    marker = Marker(front_radius=0.0, disc_x=disc_x)
    config = MarkerConfig(hues=(329.0,), front_radius=0.0, disc_x=disc_x)
    locator, pose = locator_of(room, config), Pose2(-0.5, -0.3, 0.6)
    headings = []
    for index in range(12):
        picture = room.picture(pose, marker=marker)
        (seen,) = locator.add(ImageSample((index + 1) * STEP_NS, picture))
        if index == 0:
            assert math.isinf(seen.sample.covariance[2, 2])
        else:
            error = np.array(
                [
                    seen.sample.pose.x - pose.x,
                    seen.sample.pose.y - pose.y,
                    wrap(seen.sample.pose.heading - pose.heading),
                ]
            )
            headings.append(error[2])
            # 16.3: beyond it lies a thousandth of chi-square with three degrees of freedom.
            assert error @ np.linalg.solve(seen.sample.covariance, error) < 16.3
        # Along an arc.
        pose = pose @ Pose2(0.0, 0.0, 0.025) @ Pose2(0.06, 0.0, 0.025)
    # The chord lags by half the turn of a step, and a disc behind the axle swings out.
    assert np.mean(headings) == pytest.approx(-0.025 + disc_x * 0.05 / 0.06, abs=0.01)


def test_course_is_not_taken_from_a_robot_that_stands(room: object) -> None:
    config = MarkerConfig(hues=(329.0,), front_radius=0.0, disc_x=0.0)
    locator = locator_of(room, config)
    for index in range(3):
        picture = room.picture(Pose2(0.1, 0.1, 1.0), marker=PLAIN)
        (seen,) = locator.add(ImageSample((index + 1) * STEP_NS, picture))
        assert math.isinf(seen.sample.covariance[2, 2])


def test_bad_pictures_are_refused_with_a_reason(room: object) -> None:
    locator, good = locator_of(room), room.picture(Pose2())
    torn = good.copy()
    torn[200:] = 0
    cases = [
        (ImageSample(0, good), '', 'zero stamp'),
        (ImageSample(STEP_NS, np.zeros_like(good)), '', 'picture is black'),
        (ImageSample(STEP_NS, torn), '', 'picture is torn'),
        (ImageSample(STEP_NS, good[:, :-1]), '', 'picture is not of the size'),
        (ImageSample(2 * STEP_NS, room.picture()), 'robot', 'no marker seen'),
        (ImageSample(2 * STEP_NS, good), '', 'stamp does not advance'),
    ]
    for image, key, reason in cases:
        (refusal,) = locator.add(image)
        assert isinstance(refusal, Refusal)
        assert refusal.key == key
        assert refusal.reason.startswith(reason)
