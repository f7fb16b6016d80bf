"""What carries the pose, and that the localiser says so: silence, refusals, slip, a switch."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tablerunner.estimation import Cause, Localizer, LocalizerConfig, LocalizerState
from tablerunner.estimation.uwb_health import UwbHealthConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import OdometrySample, PoseSample, RangeSample

SECOND = 1_000_000_000
STEP = 20_000_000
START = Pose2(4.0, 3.0, 0.8)
CONFIG = LocalizerConfig(tag_position=(-0.1, 0.05, 1.1), initial_pose=(4.0, 3.0, 0.8))


class Robot:
    """A robot that drives, slips and is carried, with a localiser that hears of it."""

    def __init__(self, room, seed=1, config=CONFIG):
        self.room, self.rng = room, np.random.default_rng(seed)
        self.localizer = Localizer(config, room.anchors)
        self.stamp, self.true, self.odom, self.count = SECOND, START, Pose2(), 0
        self.heard = list(room.anchors)
        self.seen, self.outcomes = [], []  # causes, outcomes of ranges

    def drive(self, seconds, spoil=lambda sample: sample, slip=1.0, speed=0.5):
        """Drive; `slip` is the share of odometry's way that is true."""
        for _ in range(round(seconds / 0.02)):
            self.stamp, self.count = self.stamp + STEP, self.count + 1
            told = Motion(speed * 0.02, 0.1 * speed * 0.02, 0.02)
            self.true = advance(self.true, Motion(told.distance_m * slip, told.turn_rad, 0.02))
            self.odom = advance(self.odom, told)
            sample = OdometrySample(self.stamp, self.odom, speed, 0.1 * speed)
            self.localizer.add_odometry(sample)
            if self.count % 2 == 0 and self.heard:
                anchor = self.heard[(self.count // 2) % len(self.heard)]
                tag = self.true.transform(np.array(self.room.lever[:2]))
                distance = math.dist((*tag, self.room.lever[2]), anchor.position)
                measured = distance + self.rng.normal(0.0, 0.1)
                sample = RangeSample(
                    self.stamp, anchor.anchor_id, 'tag', self.count, measured, 0.01
                )
                self.outcomes.append(self.localizer.add_range(spoil(sample)))
            status = self.localizer.status
            if not self.seen or self.seen[-1] is not status.cause:
                self.seen.append(status.cause)
        return self.localizer.status

    @property
    def error(self):
        """Return how far the estimate is off [m]."""
        return self.localizer.estimate.pose.distance_to(self.true)

    @property
    def deviation(self):
        """Return how far it may be off by itself [m]."""
        return math.sqrt(np.trace(self.localizer.estimate.covariance[:2, :2]))


@pytest.fixture
def robot(room):
    item = Robot(room)
    item.drive(4.0)
    return item


def test_status_of_fused_data_is_fused_from_the_start(room):
    """Nothing is alarmed by good data: not at the start, not in a minute, whatever the seed."""
    for seed in range(3):
        item = Robot(room, seed)
        status = item.drive(20.0)
        assert item.seen == [Cause.FUSED]
        assert (status.words, status.degraded) == ('tracking', False)


def nlos(sample):
    return replace(sample, nlos_probability=0.9)


@pytest.mark.parametrize(
    ('seconds', 'spoil', 'cause'),
    [
        (1.2, lambda sample: replace(sample, range_m=sample.range_m + 9.0), Cause.REFUSED),
        (1.2, lambda sample: replace(sample, variance_m2=math.nan), Cause.REFUSED),
        (1.2, lambda sample: replace(sample, stamp=1), Cause.REFUSED),
        (2.2, nlos, Cause.BLOCKED),
        (1.2, lambda sample: nlos(replace(sample, range_m=sample.range_m + 99.0)), Cause.BLOCKED),
    ],
)
def test_status_of_useless_ranges_says_why(robot, seconds, spoil, cause):
    """Refused by gate or check, or all of them blocked."""
    status = robot.drive(seconds, spoil)
    assert status.cause is cause
    assert status.words.startswith(f'dead reckoning: {cause.value}')
    assert status.degraded
    assert status.trusted  # as far as the covariance says


def test_status_of_silence_and_of_one_anchor(robot, room):
    """All silent for a minute: growing covariance; then one anchor; then all again, taken back."""
    robot.heard = []
    deviations = []
    for _ in range(6):
        status = robot.drive(10.0)
        deviations.append(robot.deviation)
    assert status.cause is Cause.SILENT
    assert status.dead_reckoning_s == pytest.approx(60.0, abs=0.1)
    assert np.all(np.diff(deviations) > 0.0)
    robot.heard = [room.anchors[1]]
    assert robot.drive(3.0).cause is Cause.ONE_ANCHOR
    robot.heard = list(room.anchors)
    assert robot.drive(3.0).cause is Cause.FUSED
    assert robot.error < 0.15


@pytest.mark.parametrize('seed', range(5))
def test_slip_is_noticed_and_made_good_by_the_ranges(room, seed):
    """Wheels that spin on the spot for two seconds: said, and the ranges are taken all the time.

    Odometry alone would be a metre off. Three seconds later nothing is left of it; the robot never
    counts as lost.
    """
    robot = Robot(room, seed)
    robot.drive(5.0)
    assert robot.drive(2.0, slip=0.0).words == 'tracking: wheels slip'
    assert robot.localizer.status.degraded
    assert robot.outcomes[-1].innovations[0].accepted
    assert robot.error < 0.5
    robot.drive(3.0)
    assert robot.seen[-1] is Cause.FUSED
    assert robot.localizer.starts == 1
    assert robot.error < 0.15


@pytest.mark.parametrize('seed', range(5))
def test_uwb_that_wanders_is_not_followed(room, seed):
    """All anchors together shift the tag by 0.6 m/s, and odometry is to be believed (Sun 2.6).

    Before it is noticed UWB drags the pose along; at the alarm what it said in the last second is
    taken back, and from then on it is only judged. What contradicts the pose for two seconds may
    be a robot that is carried: then it is lost.
    """
    health = CONFIG.health.replace(dead_reckon=True)
    robot = Robot(room, seed, CONFIG.replace(health=health))
    robot.drive(5.0)

    def wander(sample):
        tag = robot.true.transform(np.array(room.lever[:2]))
        place = next(a.position for a in room.anchors if a.anchor_id == sample.anchor_id)
        away = 0.6 * (sample.stamp - begin) / SECOND
        here = math.dist((*tag, room.lever[2]), place)
        there = math.dist((tag[0] + away, tag[1], room.lever[2]), place)
        return replace(sample, range_m=sample.range_m + there - here)

    begin = robot.stamp
    status = robot.drive(1.4, wander)
    assert status.cause is Cause.DISAGREE
    assert status.words.startswith('dead reckoning: UWB and odometry disagree')
    assert robot.error < 0.15  # 0.84 m by the ranges
    last = robot.outcomes[-1].innovations[0]
    assert (last.accepted, last.reason) == (False, 'UWB and odometry disagree')
    assert last.nis > 0.0
    assert robot.outcomes[-1].estimate is not None
    assert robot.localizer.starts == 1


@pytest.mark.parametrize('withhold', [False, True])
def test_robot_carried_off_is_said_to_disagree_and_is_lost(room, withhold):
    """Four metres in no time; ranges that are withheld still tell that the pose is wrong."""
    health = CONFIG.health.replace(dead_reckon=withhold)
    robot = Robot(room, config=CONFIG.replace(health=health))
    robot.drive(4.0)
    robot.true = Pose2(9.0, 6.5, 0.3)
    robot.drive(4.0)
    assert Cause.DISAGREE in robot.seen
    assert robot.localizer.status.state is not LocalizerState.TRACKING or (
        robot.localizer.starts > 1
    )


def test_push_is_said_and_made_up_for(robot):
    """Half a metre aside by a hand: UWB and odometry disagree, and by default UWB is believed."""
    robot.true = replace(robot.true, x=robot.true.x + 0.4, y=robot.true.y - 0.3)
    status = robot.drive(1.2)
    assert status.words == 'tracking: UWB and odometry disagree'
    assert status.degraded
    robot.drive(3.0)
    assert robot.localizer.status.cause is Cause.FUSED
    assert robot.error < 0.2
    assert robot.localizer.starts == 1


def test_switch_off_lets_odometry_carry_the_pose_and_on_takes_ranges_back(robot):
    """Refused with their own reason meanwhile, and counted as such; the covariance grows."""
    before = robot.deviation
    robot.localizer.switch(False)
    robot.outcomes.clear()
    status = robot.drive(5.0)
    assert status.cause is Cause.SWITCHED_OFF
    assert status.words == 'dead reckoning: switched off, for 5.0 s'
    reasons = {item.refusals[0].reason for item in robot.outcomes}
    assert reasons == {'switched off'}
    assert not any(item.innovations for item in robot.outcomes)
    assert robot.deviation > before
    pose = PoseSample(robot.stamp, robot.true, np.eye(3) * 0.01, 'camera/pose')
    assert robot.localizer.add_pose(pose).refusals[0].reason == 'switched off'
    assert robot.localizer.set_pose(pose).estimate is not None  # a user may still say where it is
    robot.localizer.switch(True)
    assert robot.drive(1.0).cause is Cause.FUSED
    assert robot.outcomes[-1].innovations[0].accepted


def test_switch_survives_a_reset(robot):
    """What a user switched off stays off until it is switched on."""
    robot.localizer.switch(False)
    robot.localizer.reset()
    robot.drive(0.2)
    assert not robot.localizer.fusing
    assert robot.localizer.status.cause is Cause.SWITCHED_OFF


def test_status_of_dead_reckoning_by_choice_is_no_complaint(room):
    """Who chooses the estimator that takes nothing wants it so."""
    status = Robot(room, config=CONFIG.replace(estimator='dead_reckoning')).drive(3.0)
    assert status.cause is Cause.CHOSEN
    assert not status.degraded


def test_limits_are_live(room):
    """Another disagreement in metres counts from the next comparison on."""
    robot = Robot(room)
    robot.drive(5.0)
    health = UwbHealthConfig(disagreement=3.0)
    robot.localizer.configure(CONFIG.replace(health=health))
    assert robot.drive(2.0, slip=0.0).cause is Cause.FUSED
