"""Wheels tell driving from jumps, resets and silence."""

import math

import pytest

from tablerunner.odometry.motion import Motion
from tablerunner.odometry.wheels import Wheels, WheelsConfig
from tablerunner.types import Refusal, WheelSample

CONFIG = WheelsConfig(wheel_radius=0.1, track=0.5)
STEP = 20_000_000


def sample(k, left, right):
    return WheelSample(k * STEP, left, right)


def test_add_equal_wheels_drives_straight_and_unequal_turns_left():
    """Distance is the mean of both arcs; a faster right wheel turns counter-clockwise."""
    wheels = Wheels(CONFIG)
    assert wheels.add(sample(1, 7.0, -3.0)) is None
    assert wheels.add(sample(2, 7.2, -2.8)) == Motion(
        pytest.approx(0.02), pytest.approx(0.0), 0.02
    )
    assert wheels.add(sample(3, 7.2, -2.6)) == Motion(
        pytest.approx(0.01), pytest.approx(0.04), 0.02
    )


def test_add_single_glitch_loses_no_distance():
    """One wild sample is refused; the next one bridges the gap whole."""
    wheels = Wheels(CONFIG)
    wheels.add(sample(1, 0.0, 0.0))
    glitch = wheels.add(sample(2, 900.0, 0.1))
    assert isinstance(glitch, Refusal)
    assert glitch.reason == 'encoder jump'
    assert wheels.add(sample(3, 0.2, 0.2)) == Motion(pytest.approx(0.02), pytest.approx(0), 0.04)


def test_add_encoder_reset_goes_on_from_the_new_count():
    """When the count stays elsewhere, one step is lost and counting goes on."""
    wheels = Wheels(CONFIG)
    wheels.add(sample(1, 1000.0, 1000.0))
    assert isinstance(wheels.add(sample(2, 0.0, 0.0)), Refusal)
    assert wheels.add(sample(3, 0.1, 0.1)) == Motion(pytest.approx(0.01), pytest.approx(0), 0.02)


@pytest.mark.parametrize(
    ('bad', 'words'),
    [
        (WheelSample(0, 0.0, 0.0), 'zero stamp'),
        (WheelSample(STEP, 0.0, 0.0), 'stamp does not advance'),
        (WheelSample(2 * STEP, math.nan, 0.0), 'wheel angle not finite'),
        (WheelSample(2 * STEP, 0.0, math.inf), 'wheel angle not finite'),
        (WheelSample(100 * STEP, 0.0, 0.0), 'encoders were silent'),
    ],
)
def test_add_bad_sample_is_refused_with_reason(bad, words):
    """Each fault has its own words."""
    wheels = Wheels(CONFIG)
    wheels.add(sample(1, 0.0, 0.0))
    result = wheels.add(bad)
    assert isinstance(result, Refusal)
    assert (result.source, result.reason) == ('joint_states', words)


def test_add_restarted_stream_begins_anew():
    """A bag played again from its start is taken up after three samples, without a jump."""
    wheels = Wheels(CONFIG)
    wheels.add(sample(500, 100.0, 100.0))
    results = [wheels.add(sample(k, 0.1 * k, 0.1 * k)) for k in (1, 2, 3, 4)]
    assert [isinstance(item, Refusal) for item in results[:2]] == [True, True]
    assert results[2] is None
    assert results[3] == Motion(pytest.approx(0.01), pytest.approx(0.0), 0.02)
