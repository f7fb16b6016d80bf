"""Rounds of ranges on the move, with some that are not heard."""

import math

import numpy as np
import pytest

from tablerunner.estimation.fix_maker import FixMaker
from tablerunner.estimation.track import OdometryTrack
from tablerunner.geometry.pose import Pose2
from tablerunner.types import OdometrySample, PoseSample, RangeSample
from tablerunner.uwb import PositionerConfig

SPEED = 0.5
SLOT_NS = 25_000_000


@pytest.mark.parametrize('lost', [(), (6,), (5, 14), (4, 9, 18)])
def test_fixes_are_where_the_tag_was_whichever_range_is_lost(room, lost):
    """Exact ranges on the move: each fix lies on the way, and no instant comes twice."""
    track = OdometryTrack()
    maker = FixMaker(PositionerConfig(), room.anchors, (0.0, 0.0, 1.1))
    fixes = []
    for slot in range(1, 41):
        stamp = slot * SLOT_NS
        x = SPEED * stamp * 1e-9
        track.add(OdometrySample(stamp, Pose2(x, 0.0, 0.0), SPEED, 0.0))
        if slot in lost:
            continue
        anchor = room.anchors[slot % 4]
        distance = math.dist((4.0 + x, 3.0, 1.1), anchor.position)
        sample = RangeSample(stamp, anchor.anchor_id, 'tag', slot, distance, 0.01)
        fix = maker.add(sample, Pose2(4.0, 3.0, 0.0), track)
        if isinstance(fix, PoseSample):
            fixes.append(fix)
    stamps = [fix.stamp for fix in fixes]
    assert len(set(stamps)) == len(stamps)
    # Ten rounds less the one that is under way; a lost range costs no more than its own round.
    assert len(fixes) >= 9
    for fix in fixes:
        assert fix.pose.x == pytest.approx(4.0 + SPEED * fix.stamp * 1e-9, abs=1e-6)
        assert fix.pose.y == pytest.approx(3.0, abs=1e-6)
    assert np.all(np.diff(stamps) > 0)
