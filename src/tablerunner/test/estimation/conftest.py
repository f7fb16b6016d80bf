"""A small room, a drive through it and ranges in it, made without the simulator."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, advance
from tablerunner.types import Anchor, OdometrySample, RangeSample

STEP = 20_000_000
EARLIER = 7_000_000
ANCHORS = tuple(
    Anchor(f'A{i}', position)
    for i, position in enumerate(
        [(0.0, 0.0, 2.25), (12.0, 0.0, 2.25), (12.0, 9.0, 2.25), (0.0, 9.0, 2.25)]
    )
)
LEVER = (-0.1, 0.05, 1.1)


@dataclass(frozen=True)
class Drive:
    """A recorded drive: odometry, ranges and the truth at each odometry stamp."""

    odometry: list[OdometrySample]
    ranges: list[RangeSample]
    truth: dict[int, Pose2]


START = Pose2(4.0, 3.0, 0.8)


def make_drive(seed, seconds=20.0, start=START, noise=0.1, bias=0.0, **options):
    """Drive gentle curves; odometry is exact but for `scale` and `drift` [rad/s]."""
    rng = np.random.default_rng(seed)
    scale, drift = options.get('scale', 0.0), options.get('drift', 0.0)
    still = options.get('still', 0.0)
    biases = options.get('biases', [bias] * len(ANCHORS))
    true, odom = start, Pose2()
    drive = Drive([], [], {})
    for k in range(1, int(seconds * 50) + 1):
        stamp = 1_000_000_000 + k * STEP
        speed = 0.5 if k * 0.02 > still else 0.0
        curve = 0.35 * math.sin(0.25 * k * 0.02) if options.get('turning', True) else 0.0
        turn = curve if speed else 0.0
        before, true = true, advance(true, Motion(speed * 0.02, turn * 0.02, 0.02))
        told = Motion(speed * 0.02 / (1 + scale), (turn + (drift if speed else 0.0)) * 0.02, 0.02)
        odom = advance(odom, told)
        drive.odometry.append(
            OdometrySample(stamp, odom, told.distance_m / 0.02, told.turn_rad / 0.02)
        )
        drive.truth[stamp] = true
        if k % 2 == 0:
            anchor = ANCHORS[(k // 2) % 4]
            # Ranges fall between odometry stamps: 7 ms before the one that follows.
            then = advance(before, Motion(speed * 0.013, turn * 0.013, 0.013))
            tag = then.transform(np.array(LEVER[:2]))
            distance = math.dist((*tag, LEVER[2]), anchor.position)
            measured = distance + biases[(k // 2) % 4] + rng.normal(0, noise)
            drive.ranges.append(
                RangeSample(
                    stamp - EARLIER, anchor.anchor_id, 'tag', k, measured, max(noise, 1e-3) ** 2
                )
            )
    return drive


@dataclass(frozen=True)
class Room:
    """What tests need of the room."""

    anchors: tuple[Anchor, ...] = ANCHORS
    lever: tuple[float, float, float] = LEVER
    drive = staticmethod(make_drive)


@pytest.fixture(scope='session')
def room():
    """Anchors, lever arm and drives."""
    return Room()
