"""Wheels tell driving from jumps, resets and silence."""

import math

import numpy as np
import pytest

from tablerunner.odometry.motion import Motion
from tablerunner.odometry.wheels import Wheels, WheelsConfig
from tablerunner.types import Refusal, WheelSample, seconds

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


def speeds(k, left, right):
    return WheelSample(k * STEP, math.nan, math.nan, left, right)


def driven(wheels, samples):
    """Return distance, turn and refusals of a stream."""
    distance = turn = 0.0
    refused = []
    for item in samples:
        result = wheels.add(item)
        if isinstance(result, Refusal):
            refused.append(result.reason)
        elif result is not None:
            distance, turn = distance + result.distance_m, turn + result.turn_rad
    return distance, turn, refused


def test_add_speeds_only_are_integrated():
    """Trapezoids: exact for speeds that change evenly, also over a message that was lost."""
    ramp = [speeds(k, 0.1 * k, 0.2 * k) for k in range(1, 51) if k != 20]
    distance, turn, refused = driven(Wheels(CONFIG), ramp)
    left = 0.1 * 0.5 * (0.1 + 5.0) * seconds(49 * STEP)  # radius times mean speed times time
    assert distance == pytest.approx(1.5 * left)
    assert turn == pytest.approx(left / 0.5)
    assert refused == []


def test_add_speeds_below_still_speed_are_those_of_standing_wheels():
    """Not one tick, as `Odometer` wants it for learning the gyroscope's bias."""
    wheels = Wheels(CONFIG)
    wheels.add(speeds(1, 0.009, -0.009))
    assert wheels.add(speeds(2, -0.009, 0.004)) == Motion(0.0, 0.0, 0.02)


@pytest.mark.parametrize(
    ('feedback', 'bad', 'words'),
    [
        ('auto', speeds(2, 1.0, math.nan), 'wheel angle not finite'),
        ('auto', speeds(2, 1.0, 51.0), 'wheel speed beyond max_wheel_speed'),
        ('velocity', sample(2, 1.0, 1.0), 'wheel speed not finite'),
        ('position', speeds(2, 1.0, 1.0), 'wheel angle not finite'),
    ],
)
def test_add_without_what_is_asked_for_is_refused(feedback, bad, words):
    """Each way of feedback wants its own numbers."""
    wheels = Wheels(CONFIG.replace(feedback=feedback))
    first = sample(1, 0.0, 0.0) if feedback == 'position' else speeds(1, 1.0, 1.0)
    assert wheels.add(first) is None
    assert wheels.add(bad).reason == words


def test_add_angles_that_are_missing_once_are_not_replaced_by_speeds():
    """The next angles bridge the gap exactly; speeds would add their own error for good."""
    full = [WheelSample(k * STEP, 0.1 * k, 0.1 * k, 9.0, 9.0) for k in range(1, 6)]
    full[2] = WheelSample(3 * STEP, math.nan, 0.3, 9.0, 9.0)
    distance, _, refused = driven(Wheels(CONFIG), full)
    assert distance == pytest.approx(0.1 * 0.4)
    assert refused == ['wheel angle not finite']


def test_add_angles_that_begin_after_speeds_take_over():
    """A broadcaster that starts before its hardware: NaN angles first, then counts from 700."""
    wheels = Wheels(CONFIG)
    stream = [speeds(1, 5.0, 5.0), speeds(2, 5.0, 5.0)]
    stream += [WheelSample(k * STEP, 700.0 + 0.1 * k, 700.0 + 0.1 * k, 5.0, 5.0) for k in (3, 4)]
    distance, _, refused = driven(wheels, stream)
    assert distance == pytest.approx(0.1 * 0.1 * 3)
    assert refused == []


@pytest.mark.parametrize('wrap', [2.0 * math.pi, 65536 * 2 * math.pi / 4096, 7.3])
def test_add_wrapping_angles_lead_where_endless_ones_lead(wrap):
    """Forwards and backwards over the end of the range, from 20 random starts."""
    random = np.random.default_rng(4)
    config = CONFIG.replace(wrap=wrap)
    for _ in range(20):
        # Up to 40 rad/s over 20 ms: 0.8 rad a step, below half of each range.
        steps = random.uniform(-0.8, 0.8, (200, 2)) + random.uniform(-0.15, 0.15, 2)
        angles = np.cumsum(steps, axis=0) + random.uniform(-50.0, 50.0, 2)
        endless = [sample(k + 1, *row) for k, row in enumerate(angles.tolist())]
        wrapped = [sample(k + 1, *row) for k, row in enumerate((angles % wrap).tolist())]
        expected, found = driven(Wheels(CONFIG), endless), driven(Wheels(config), wrapped)
        assert found[:2] == pytest.approx(expected[:2], abs=1e-9)
        assert found[2] == expected[2] == []


def test_add_wrapping_glitch_loses_no_distance():
    """A wild count within the range, too, is refused, and the next sample is not a turn off."""
    config = CONFIG.replace(wrap=2.0 * math.pi)
    stream = [sample(1, 6.2, 6.2), sample(2, 3.0, 3.2), sample(3, 0.1, 0.1)]
    distance, turn, refused = driven(Wheels(config), stream)
    assert distance == pytest.approx(0.1 * (2.0 * math.pi - 6.1))
    assert turn == pytest.approx(0.0, abs=1e-9)
    assert refused == ['encoder jump']


def test_add_wrapping_angles_after_a_silence_follow_the_speeds_or_are_refused():
    """In 0.4 s a wheel at 20 rad/s turns once and a bit more: only its speed tells."""
    config = CONFIG.replace(wrap=2.0 * math.pi)
    told = [
        WheelSample(1 * STEP, 1.0, 1.0, 20.0, 20.0),
        WheelSample(21 * STEP, (1.0 + 8.0) % config.wrap, (1.0 + 8.0) % config.wrap, 20.0, 20.0),
    ]
    assert driven(Wheels(config), told)[0] == pytest.approx(0.8)
    silent = [sample(1, 1.0, 1.0), sample(21, 9.0 % config.wrap, 9.0 % config.wrap)]
    silent.append(sample(22, (9.0 + 0.1) % config.wrap, (9.0 + 0.1) % config.wrap))
    distance, _, refused = driven(Wheels(config), silent)
    assert refused == ['angles may have wrapped more than once']
    assert distance == pytest.approx(0.1 * 0.1)


def test_add_several_wheels_on_a_side_count_by_their_mean():
    """Of wheels that wrap at different places, too, and each side by itself."""
    config = CONFIG.replace(wrap=2.0 * math.pi)
    first = WheelSample(STEP, 6.2, 1.0, further=((3.0, 6.28, math.nan, math.nan),))
    second = WheelSample(2 * STEP, 0.1, 1.2, further=((3.3, 0.2, math.nan, math.nan),))
    left = 0.5 * (0.1 + 2.0 * math.pi - 6.2 + 0.3)
    right = 0.5 * (0.2 + 0.2 + 2.0 * math.pi - 6.28)
    wheels = Wheels(config)
    wheels.add(first)
    assert wheels.add(second) == Motion(
        pytest.approx(0.05 * (left + right)), pytest.approx(0.1 * (right - left) / 0.5), 0.02
    )


def test_add_radii_and_directions_of_each_side():
    """A right joint that counts backwards, and a left wheel that is two percent larger."""
    config = CONFIG.replace(left_radius_multiplier=1.02, right_reversed=True)
    wheels = Wheels(config)
    wheels.add(sample(1, 0.0, 0.0))
    motion = wheels.add(sample(2, 0.2, -0.2))
    assert motion.distance_m == pytest.approx(0.5 * (0.0204 + 0.02))
    assert motion.turn_rad == pytest.approx((0.02 - 0.0204) / 0.5)


def test_add_angles_that_stand_while_speeds_do_not_are_refused():
    """A driver that fills its positions with zeros: said after two radians, not driven on."""
    stream = [WheelSample(k * STEP, 0.0, 0.0, 5.0, 5.0) for k in range(1, 31)]
    _, _, refused = driven(Wheels(CONFIG), stream)
    assert set(refused) == {'angles stand while speeds do not: feedback by velocity?'}
    assert len(refused) in (29 - 19, 29 - 20)  # 2 rad are 20 steps of 5 rad/s, to a rounding
    assert driven(Wheels(CONFIG.replace(feedback='velocity')), stream)[0] == pytest.approx(
        0.1 * 5.0 * seconds(29 * STEP)
    )
