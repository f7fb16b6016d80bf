"""A tag seen from a robot that drives: ranges one at a time, refused ones with a reason."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.estimation.person_config import PersonLocatorConfig
from tablerunner.estimation.person_locator import IMPLAUSIBLE, SILENT, UNSOLVED, PersonLocator
from tablerunner.geometry.pose import Pose2
from tablerunner.types import NANOSECONDS, OdometrySample, RangeSample, nanoseconds

IDS = ('R0', 'R1', 'R2', 'R3')
PLACES = ((0.17, 0.17, 0.6), (-0.17, 0.17, 0.6), (-0.17, -0.17, 0.6), (0.17, -0.17, 0.6))
CONFIG = PersonLocatorConfig(
    tag_id='host',
    anchor_ids=IDS,
    anchor_positions=tuple(value for place in PLACES for value in place),
)
SLOT_S = 0.025


def range_of(index, pose, tag, stamp, extra=0.0, **changes):
    """Return the range from the tag at `tag` in map to an anchor of a robot at `pose`."""
    x, y = pose.transform(np.array(PLACES[index][:2]))
    values = {
        'stamp': stamp,
        'anchor_id': IDS[index],
        'tag_id': 'host',
        'sequence': 0,
        'range_m': math.dist((x, y, PLACES[index][2]), (*tag, CONFIG.tag_height)) + extra,
        'variance_m2': 0.05**2,
        'nlos_probability': 0.0,
    }
    return RangeSample(**{**values, **changes})


def drive(locator, robot, tag, duration_s, begin_s=1.0, noise=None, extra=None):
    """Feed a locator with a robot at `robot(t)` and a tag at `tag(t)`; return the last stamp."""
    stamp = 0
    for number in range(round(duration_s / SLOT_S)):
        t = begin_s + number * SLOT_S
        stamp = nanoseconds(t)
        step = robot(t).between(robot(t + 1e-3))
        locator.add_odometry(OdometrySample(stamp, robot(t), step.x / 1e-3, step.heading / 1e-3))
        more = 0.0 if noise is None else float(noise.normal(scale=0.05))
        more += 0.0 if extra is None else extra(number)
        locator.add_range(range_of(number % 4, robot(t), tag(t), stamp, more))
    return stamp


def stands(_t):
    return Pose2(2.0, 1.0, 0.3)


def test_locator_exact_ranges_while_robot_turns_tells_the_place():
    """Without noise only the turn between ranges could bend the place, and it is taken out."""
    locator = PersonLocator(CONFIG)

    def circles(t):
        return Pose2(math.sin(t) * 0.5, -math.cos(t) * 0.5, t)

    stamp = drive(locator, circles, lambda _t: (3.0, 1.0), 4.0)
    seen = locator.sight(stamp).person
    place = circles(stamp / 1e9).transform(np.array(seen.position))
    assert place == pytest.approx([3.0, 1.0], abs=0.03)
    assert np.hypot(*seen.velocity) < 0.1


def test_locator_walking_tag_tells_velocity_over_the_floor():
    """A robot that drives beside a person at the same speed sees the person walk, not stand."""
    locator = PersonLocator(CONFIG)
    stamp = drive(locator, lambda t: Pose2(0.4 * t, 0.0, 0.0), lambda t: (0.4 * t + 1.5, 0.5), 6.0)
    seen = locator.sight(stamp).person
    assert seen.position == pytest.approx((1.5, 0.5), abs=0.05)
    assert seen.velocity == pytest.approx((0.4, 0.0), abs=0.08)


def test_locator_noise_is_within_its_covariance():
    """Over 60 seeds the mean of the normalised square of the place is near two degrees of freedom.

    It moves by 0.37 at 95 % (chi-square of 120 degrees over 60); the filter's walk of the velocity
    is more than this person's, so that it may be too careful, never too sure.
    """
    squares = []
    for seed in range(60):
        locator = PersonLocator(CONFIG)
        rng = np.random.default_rng(seed)
        stamp = drive(locator, stands, lambda _t: (3.5, 1.8), 2.0, noise=rng)
        seen = locator.sight(stamp).person
        true = stands(0).inverse().transform(np.array([3.5, 1.8]))
        error = np.array(seen.position) - true
        squares.append(error @ np.linalg.solve(seen.covariance[:2, :2], error))
    assert 0.3 < np.mean(squares) < 2.4


def test_locator_silence_loses_and_new_ranges_find_again():
    locator = PersonLocator(CONFIG)
    assert locator.sight(NANOSECONDS).reason == SILENT
    stamp = drive(locator, stands, lambda _t: (3.5, 1.8), 1.0)
    assert locator.sight(stamp + nanoseconds(0.5)).person is not None
    gone = locator.sight(stamp + nanoseconds(0.7))
    assert gone.person is None
    assert gone.reason == SILENT
    # Five seconds later somewhere else: the old place is forgotten, no gate keeps it out.
    stamp = drive(locator, stands, lambda _t: (1.0, 3.0), 0.5, begin_s=7.0)
    found = stands(0).transform(np.array(locator.sight(stamp).person.position))
    assert found == pytest.approx([1.0, 3.0], abs=0.05)


def test_locator_ranges_that_do_not_fit_are_refused_and_lose_the_person():
    locator = PersonLocator(CONFIG)
    drive(locator, stands, lambda _t: (3.5, 1.8), 1.0)
    stamp = drive(locator, stands, lambda _t: (3.5, 1.8), 1.0, 2.0, extra=lambda n: 3.0 + n % 4)
    sight = locator.sight(stamp)
    assert sight.person is None
    assert sight.reason == IMPLAUSIBLE


def test_locator_two_anchors_tell_no_place():
    locator = PersonLocator(CONFIG)
    locator.add_odometry(OdometrySample(NANOSECONDS, stands(0), 0.0, 0.0))
    for number in range(8):
        stamp = NANOSECONDS + nanoseconds(0.05 * number)
        locator.add_range(range_of(number % 2, stands(0), (3.5, 1.8), stamp))
    assert locator.sight(stamp).reason == UNSOLVED


def test_locator_three_anchors_are_enough_when_one_is_dead():
    locator = PersonLocator(CONFIG)
    locator.add_odometry(OdometrySample(NANOSECONDS, stands(0), 0.0, 0.0))
    for number in range(9):
        stamp = NANOSECONDS + nanoseconds(0.025 * number)
        locator.add_range(range_of(number % 3, stands(0), (3.5, 1.8), stamp))
    place = stands(0).transform(np.array(locator.sight(stamp).person.position))
    assert place == pytest.approx([3.5, 1.8], abs=0.05)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'tag_id': 'robot'}, 'another tag'),
        ({'anchor_id': 'A0'}, 'unknown anchor'),
        ({'stamp': 0}, 'zero stamp'),
        ({'range_m': math.nan}, 'range is not positive and finite'),
        ({'range_m': -1.0}, 'range is not positive and finite'),
        ({'range_m': math.inf}, 'range is not positive and finite'),
        ({'stamp': NANOSECONDS + 1}, 'stamp does not advance'),
    ],
)
def test_locator_bad_range_is_refused_with_its_reason(changes, reason):
    locator = PersonLocator(CONFIG)
    drive(locator, stands, lambda _t: (3.5, 1.8), 1.0)
    refusal = locator.add_range(
        range_of(0, stands(0), (3.5, 1.8), **{'stamp': 3 * NANOSECONDS, **changes})
    )
    assert refusal.reason == reason


def test_locator_without_odometry_refuses_ranges():
    refusal = PersonLocator(CONFIG).add_range(range_of(0, stands(0), (3.5, 1.8), NANOSECONDS))
    assert refusal.reason == 'no odometry yet'


def test_locator_component_wise_tells_place_and_no_velocity():
    """Bae's filter lags, so the tag stands; what is not known of the velocity is infinite."""
    locator = PersonLocator(CONFIG.replace(method='component_wise'))
    stamp = drive(locator, stands, lambda _t: (3.5, 1.8), 2.0)
    seen = locator.sight(stamp).person
    assert stands(0).transform(np.array(seen.position)) == pytest.approx([3.5, 1.8], abs=0.02)
    assert np.isinf(seen.covariance[2, 2])


@pytest.mark.parametrize(
    ('changes', 'field'),
    [
        ({'tag_id': ''}, 'tag_id'),
        ({'anchor_ids': IDS[:3]}, 'anchor_positions'),
        ({'anchor_ids': ('R0', 'R1', 'R2', 'R0')}, r'anchor_ids\[3\]'),
        (
            {'anchor_positions': (0.1, 0.1, 1.0, 0.2, 0.2, 1.0, 0.3, 0.3, 1.0, 0.4, 0.4, 1.0)},
            'line',
        ),
        ({'direction_bias': (0.1,)}, 'direction_bias'),
        ({'method': 'guess'}, 'method'),
    ],
)
def test_config_that_cannot_be_is_refused(changes, field):
    with pytest.raises(ConfigError, match=field):
        CONFIG.replace(**changes)
