"""Whatever comes in: nothing is raised, what is believed stays a belief, good data is followed."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tablerunner.estimation import ESTIMATORS, Localizer, LocalizerConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import LosState, MagneticSample, OdometrySample, PoseSample, RangeSample

SECOND = 1_000_000_000
STEP = 20_000_000
EPOCH = 1_700_000_000 * SECOND  # of the robot's clock
START = Pose2(4.0, 3.0, 0.8)
CONFIG = LocalizerConfig(
    tag_position=(-0.1, 0.05, 1.1), initial_pose=(START.x, START.y, START.heading)
)

numbers = st.sampled_from(
    [math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1e-320, 1e-200, 1e-13, 1e-6, 1.0, 1e6, 1e150]
) | st.floats(allow_nan=True, allow_infinity=True)
stamps = st.sampled_from(
    [0, -5, 1, SECOND, 2**31 * SECOND, EPOCH * 3, -SECOND, 2**62]
) | st.integers(-3 * SECOND, 3 * SECOND).map(lambda shift: EPOCH + shift)
SHAPES = {
    'identity': np.eye(3),
    'singular': np.ones((3, 3)),
    'zero': np.zeros((3, 3)),
    'not symmetric': np.eye(3) + np.triu(np.full((3, 3), 0.5), 1),
    'not positive': np.full((3, 3), 2.0) - np.eye(3),
    'no heading': np.diag([1.0, 1.0, math.inf]),
    'nan': np.full((3, 3), math.nan),
}
covariances = st.builds(
    lambda shape, scale: SHAPES[shape] * scale,
    st.sampled_from(sorted(SHAPES)),
    st.sampled_from([1e-300, 1e-13, 1e-8, 1e-3, 1.0, 1e4, 1e300, -1.0]),
)
anchor_ids = st.sampled_from(['A0', 'A1', 'A2', 'A3', 'B9', ''])

# What may go wrong: a name and what it needs, for `Robot.suffer`.
faults = st.one_of(
    st.tuples(st.just('drive'), st.integers(1, 40)),
    st.tuples(st.just('silence'), st.integers(1, 60)),
    st.tuples(st.just('one anchor'), st.integers(1, 40)),
    st.tuples(st.just('blocked'), st.integers(1, 40)),
    st.tuples(st.just('ten times'), st.integers(1, 10)),
    st.tuples(st.just('late'), st.integers(1, 40)),
    st.tuples(st.just('odometry gap'), st.integers(1, 200)),
    st.tuples(st.just('odometry elsewhere'), st.floats(-50, 50)),
    st.tuples(st.just('odometry'), stamps, st.tuples(*[numbers] * 5), covariances),
    st.tuples(st.just('range'), stamps, anchor_ids, st.tuples(*[numbers] * 3)),
    st.tuples(st.just('range now'), anchor_ids, st.tuples(*[numbers] * 3)),
    st.tuples(st.just('pose'), stamps, st.tuples(*[numbers] * 3), covariances),
    st.tuples(st.just('pose now'), st.tuples(*[st.floats(-20, 20)] * 3), covariances),
    st.tuples(st.just('set pose'), stamps, st.tuples(*[numbers] * 3), covariances),
    st.tuples(st.just('set pose now'), st.tuples(*[st.floats(-20, 20)] * 3), covariances),
    st.tuples(st.just('magnetic'), stamps, st.tuples(*[numbers] * 3)),
    st.tuples(st.just('north'), st.floats(-4, 4)),
    st.tuples(st.just('anchors'), st.integers(0, 4)),
    st.tuples(st.just('estimator'), st.sampled_from(sorted(ESTIMATORS))),
    st.tuples(st.just('switch'), st.booleans()),
    st.tuples(st.just('reset')),
)


class Robot:
    """Drives gently; good and broken data of it go to a localiser, whose answers are checked."""

    def __init__(self, room, config):
        self.room, self.rng = room, np.random.default_rng(5)
        self.localizer = Localizer(config, room.anchors)
        self.stamp, self.true, self.odom, self.count = EPOCH, START, Pose2(), 0
        self.heard = range(4)

    # -- what is checked of each answer ---------------------------------------------------------

    def take(self, give, sample):
        """Hand a sample over; nothing may be raised and all that is believed must be sound."""
        outcome = give(sample)
        for item in (*outcome.refusals, *outcome.innovations):
            accepted = getattr(item, 'accepted', False)
            assert accepted or item.reason, item
        for estimate in (outcome.estimate, self.localizer.estimate):
            if estimate is not None:
                assert_sound(estimate)
        place = self.localizer.map_to_odom
        assert place is None or place.is_finite
        status = self.localizer.status
        assert status.words
        assert math.isfinite(status.dead_reckoning_s)
        return outcome

    # -- good data ------------------------------------------------------------------------------

    def odometry(self):
        """Return the odometry of the next 20 ms."""
        self.stamp, self.count = self.stamp + STEP, self.count + 1
        step = Motion(0.01, 0.006 * math.sin(self.count * 0.005), 0.02)
        self.true, self.odom = advance(self.true, step), advance(self.odom, step)
        return OdometrySample(self.stamp, self.odom, 0.5, step.turn_rad / 0.02)

    def range_of(self, index):
        """Return the range of an anchor now."""
        anchor = self.room.anchors[index]
        tag = self.true.transform(np.array(self.room.lever[:2]))
        distance = math.dist((*tag, self.room.lever[2]), anchor.position)
        return RangeSample(
            self.stamp,
            anchor.anchor_id,
            'tag',
            self.count,
            distance + self.rng.normal(0.0, 0.05),
            0.0025,
        )

    def drive(self, steps, change=lambda sample: sample, times=1):
        """Drive, with a range at every second step, or many."""
        for _ in range(steps):
            self.take(self.localizer.add_odometry, self.odometry())
            if self.count % 2 == 0 and self.heard:
                sample = self.range_of(self.heard[self.count // 2 % len(self.heard)])
                for copy in range(times):
                    again = replace(sample, stamp=sample.stamp - copy * 1_000_000)
                    self.take(self.localizer.add_range, change(again))

    # -- broken data ----------------------------------------------------------------------------

    def suffer(self, fault):
        """Let a fault happen."""
        kind, *given = fault
        localizer = self.localizer
        if kind == 'drive':
            self.drive(given[0])
        elif kind in ('silence', 'one anchor'):
            self.heard = range(0 if kind == 'silence' else 1)
            self.drive(given[0])
            self.heard = range(4)
        elif kind == 'blocked':
            self.drive(
                given[0],
                lambda s: replace(
                    s, range_m=s.range_m + 0.5, nlos_probability=1.0, los=LosState.NLOS
                ),
            )
        elif kind == 'ten times':
            self.drive(given[0], times=10)
        elif kind == 'late':
            self.drive(given[0], lambda s: replace(s, stamp=s.stamp - 300_000_000))
        elif kind == 'odometry gap':
            self.stamp += given[0] * SECOND
        elif kind == 'odometry elsewhere':
            self.odom = Pose2(given[0], -given[0], given[0])
        elif kind == 'odometry':
            stamp, (x, y, heading, linear, angular), covariance = given
            sample = OdometrySample(stamp, Pose2(x, y, heading), linear, angular, covariance)
            self.take(localizer.add_odometry, sample)
        elif kind.startswith('range'):
            stamp = given[0] if len(given) == 3 else self.stamp
            measured, variance, probability = given[-1]
            sample = RangeSample(
                stamp, given[-2], 'tag', 0, measured, variance, nlos_probability=probability
            )
            self.take(localizer.add_range, sample)
        elif 'pose' in kind:
            stamp = given[0] if len(given) == 3 else self.stamp
            sample = PoseSample(stamp, Pose2(*given[-2]), given[-1], 'camera/pose')
            self.take(localizer.set_pose if 'set' in kind else localizer.add_pose, sample)
        elif kind == 'magnetic':
            self.take(localizer.add_magnetic, MagneticSample(given[0], *given[1]))
        elif kind == 'north':
            field = CONFIG.compass
            north, east = math.cos(given[0]), math.sin(given[0])
            self.take(
                localizer.add_magnetic,
                MagneticSample(
                    self.stamp, field.horizontal * north, field.horizontal * east, field.vertical
                ),
            )
        elif kind == 'anchors':
            localizer.set_anchors(self.room.anchors[: given[0]])
        elif kind == 'estimator':
            localizer.configure(localizer.config.replace(estimator=given[0]))
        elif kind == 'switch':
            localizer.switch(given[0])
        elif kind == 'reset':
            localizer.reset()


def assert_sound(estimate):
    """Finite, and with a covariance: symmetric, no variance below zero in any direction."""
    pose = np.append(estimate.mean[:3], estimate.stamp)
    assert np.isfinite(pose).all()
    assert abs(pose[2]) <= math.pi
    covariance = estimate.pose_covariance
    assert np.isfinite(covariance).all()
    scale = max(float(np.trace(covariance)), 1e-30)
    assert np.abs(covariance - covariance.T).max() <= 1e-9 * scale
    # Sixteen digits of products of numbers as large as the trace.
    assert np.linalg.eigvalsh(covariance)[0] >= -1e-9 * scale


def recover(robot, room):
    """Switch all on again, with good data from here on, until it is followed."""
    localizer = robot.localizer
    localizer.switch(True)
    localizer.set_anchors(room.anchors)
    localizer.configure(localizer.config.replace(estimator='ekf'))
    robot.heard = range(4)
    for _ in range(40):
        robot.drive(50)
        estimate = localizer.estimate
        if (
            estimate is not None
            and abs(estimate.stamp - robot.stamp) < SECOND
            and estimate.pose.distance_to(robot.true) < 0.2
        ):
            return
    pytest.fail(f'good data is not followed: {localizer.status}, {localizer.estimate}')


@pytest.mark.parametrize('name', sorted(ESTIMATORS))
@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(known=st.booleans(), sequence=st.lists(faults, max_size=25))
def test_any_sequence_of_faults_leaves_a_sound_belief(room, name, known, sequence):
    """Each estimator, from a known or unknown start; afterwards `ekf` follows good data again."""
    config = CONFIG.replace(estimator=name)
    robot = Robot(room, config if known else config.replace(initial_pose=()))
    with warnings.catch_warnings():
        warnings.simplefilter('error', RuntimeWarning)  # overflow, division by zero, NaN made
        robot.drive(10)
        for fault in sequence:
            robot.suffer(fault)
            robot.drive(3)
        recover(robot, room)
