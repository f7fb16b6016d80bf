"""Every setting that is live takes effect while the localiser runs."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tablerunner.config import Config
from tablerunner.config.parameter import parameters_of
from tablerunner.estimation import Localizer, LocalizerConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import MagneticSample, OdometrySample, PoseSample, RangeSample

CONFIG = LocalizerConfig(tag_position=(-0.1, 0.05, 1.1), initial_pose=(4.0, 3.0, 0.8))
SECOND = 1_000_000_000
STEP = 50_000_000
CHANGE_AT = 3 * SECOND


def live(config, prefix=''):
    """Return the dotted names of all live settings."""
    names = []
    for name, (_, info) in parameters_of(type(config)).items():
        value = getattr(config, name)
        if isinstance(value, Config):
            names += live(value, f'{prefix}{name}.')
        elif info.dynamic:
            names.append(prefix + name)
    return names


def changed(config, name):
    """Return the settings with one of them changed to something larger, and to smaller."""
    first, _, rest = name.partition('.')
    value = getattr(config, first)
    if rest:
        return [config.replace(**{first: item}) for item in changed(value, rest)]
    _, info = parameters_of(type(config))[first]
    if isinstance(value, bool):
        others = {not value}
    elif info.choices:
        others = {item for item in info.choices if item != value}
    else:
        most = math.inf if info.high is None else info.high
        least = info.above + 1e-3 if info.above is not None else info.low
        others = {min(value * 5 + 1, most), *(max(value / k, least) for k in (2, 5, 50))}
        others = {type(value)(item) for item in others}
    return [config.replace(**{first: item}) for item in sorted(others - {value})]


def eventful(room):
    """Return a drive with all that settings are for.

    A curve, a straight, turns on the spot and on the way; an anchor that reads long; wheels that
    slip; ranges that are blocked, wild or silent; poses of a camera and a magnetic field; at last
    the robot is carried off.
    """
    rng = np.random.default_rng(1)
    true, odom, samples = Pose2(4.0, 3.0, 0.8), Pose2(), []
    for count in range(1, 361):
        stamp, now = SECOND + count * STEP, count * 0.05
        turn = 0.02 if now < 3.0 else 0.045 if 5.0 < now < 6.5 else 0.0
        way = 0.0 if 5.0 < now < 5.75 else 0.015 if 5.75 < now < 6.5 else 0.025
        told = Motion(way, turn, 0.05)
        slips, silent, carried = 7.0 < now < 9.0, 11.0 < now < 12.5, now > 13.5
        true, odom = true if slips else advance(true, told), advance(odom, told)
        samples.append(OdometrySample(stamp, odom, told.distance_m / 0.05, told.turn_rad / 0.05))
        if silent:
            continue
        here = Pose2(true.x + 4.0, true.y + 3.5, true.heading) if carried else true
        tag = here.transform(np.array(room.lever[:2]))
        for anchor in (room.anchors[count % 4], room.anchors[(count + 1) % 4]):
            measured = math.dist((*tag, room.lever[2]), anchor.position) + rng.normal(0.0, 0.1)
            wild, missing, variance = rng.uniform(size=3) < (0.15, 0.1, 0.85)
            if anchor is room.anchors[1] and now < 5.0:
                measured += 0.4
            if wild:
                measured += rng.uniform(0.2, 1.0)
            if not missing:
                variance *= 0.01  # else 0: unknown
                sample = RangeSample(stamp, anchor.anchor_id, 'tag', count, measured, variance)
                samples.append(
                    replace(sample, nlos_probability=0.3 * (count % 8 < 4 and not carried))
                )
        if count % 3 == 0:
            field, turned = CONFIG.compass, here.heading + rng.normal(0.0, 0.1)
            level = field.horizontal * (1.0 + rng.normal(0.0, 0.04))
            north, east = level * math.cos(turned), -level * math.sin(turned)
            samples.append(MagneticSample(stamp, north, east, field.vertical))
        if count % 10 == 0:
            seen = Pose2(here.x + rng.normal(0.0, 0.3), here.y, here.heading)
            samples.append(PoseSample(stamp, seen, np.eye(3) * 1e-2, 'camera/pose'))
    return samples


def run(room, samples, config, later):
    """Yield what is said at each sample by a localiser whose settings change on the way."""
    localizer = Localizer(config, room.anchors)
    configured = False
    for sample in samples:
        if sample.stamp > CHANGE_AT and not configured:
            configured = True
            localizer.configure(later)
        if isinstance(sample, OdometrySample):
            outcome = localizer.add_odometry(sample)
        elif isinstance(sample, PoseSample):
            outcome = localizer.add_pose(sample)
        elif isinstance(sample, MagneticSample):
            outcome = localizer.add_magnetic(sample)
        else:
            outcome = localizer.add_range(sample)
        estimate = outcome.estimate
        yield repr(
            (
                None if estimate is None else (*estimate.mean[:3], *estimate.covariance.ravel()),
                tuple((item.nis, item.gate, item.reason) for item in outcome.innovations),
                localizer.status,
            )
        )


ESTIMATOR_OF = {
    'filter.sun.': ('kf', 'ekf_cv'),
    'filter.ddf.': ('ddf',),
    'filter.particles.': ('pf',),
    'positioner.': ('kf',),
}

# What another setting would hide: the robot is lost for one reason before it is for the next.
BESIDE = {'lost_silence': {'lost_nis': 1000.0}, 'lost_doubt': {'lost_nis': 1000.0}}


@pytest.fixture(scope='module')
def samples(room):
    """Return the eventful drive."""
    return eventful(room)


@pytest.fixture(scope='module')
def unchanged(room, samples):
    """Return a function that tells what is said where no setting changes."""

    @cache
    def said(config):
        return list(run(room, samples, config, config))

    return said


@pytest.mark.parametrize('name', live(CONFIG))
def test_live_setting_takes_effect_while_running(room, samples, unchanged, name):
    """The same data, from the change on, lead to something else; before it, to the same."""
    estimators = next((e for key, e in ESTIMATOR_OF.items() if name.startswith(key)), ('ekf',))
    for estimator in estimators:
        config = CONFIG.replace(estimator=estimator, **BESIDE.get(name, {}))
        before = unchanged(config)
        for later in changed(config, name):
            after = run(room, samples, config, later)
            for sample, ours, theirs in zip(samples, before, after, strict=True):
                if ours != theirs:
                    assert sample.stamp > CHANGE_AT, 'it had an effect before it was changed'
                    return
    pytest.fail('nothing changes')
