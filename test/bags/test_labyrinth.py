"""The recording of a real robot: it finds its start, and stays within the bound."""

from __future__ import annotations

import numpy as np
import pytest

from tablerunner.evaluation.errors import compare as compare_with_truth

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

REQUIRED_M = 0.18
"""What is asked of the position's RMSE."""

EXPECTED_M = 0.10
"""What the default settings are good for.

A filter on raw ranges gets 0.15 to 0.16 m here, for these ranges are 0.12 m too long on average;
one that estimates that along the way gets 0.07 to 0.08 m. Beyond 0.1 m self-calibration is lost.
"""

START_M, START_RAD = 0.03, 0.06
"""How far the played run may be from the replay.

In the bag the wheels come before the range of the same stamp. Over DDS that range is there first,
since odom_node stands between fusion_node and the wheels, so that the start is worked out from a
window that ends one range and one interval apart. It is good to some 5 cm and 0.1 rad by 25
ranges, and one of 25 moves it by a fifth of that; the attempt that is believed may be the next.
Measured: 4 mm, 0.011 rad.
"""

SETTLED_NS = 10_000_000_000
SETTLED_M, SETTLED_RAD = START_M / 3.0, START_RAD / 3.0
"""The same over the last ten seconds: the ranges they share have made them forget their starts, to
the third part or less. Measured: 1.1 mm, 1.3 mrad; on a busy machine 3.3 of 11 mm, 2.4 mrad."""

LATEST_START_NS = 1_000_000_000
"""Four attempts to find the start."""


def test_replay_labyrinth_position_is_within_bound(labyrinth):
    """From the moment the estimator declares itself initialised; nothing knows the truth."""
    result = labyrinth.replay()
    summary = result.errors.summary()
    took_s = (result.initialised - result.first_stamp) * 1e-9
    print(f'initialised after {took_s:.1f} s; RMSE {summary.rmse:.3f} m, max {summary.max:.3f} m')
    assert result.state.value == 'tracking'
    assert took_s < 8.0, 'nearly everything is judged'
    assert summary.count > 190
    assert summary.rmse <= REQUIRED_M
    assert summary.rmse <= EXPECTED_M


def test_play_labyrinth_over_dds_is_within_bound_and_agrees(labyrinth, play, compare):
    """Played into fresh odom_node and fusion_node: the same bound, and what `replay` finds."""
    played = play(labyrinth, 2.0)
    result = labyrinth.replay()
    stamps = np.array(sorted(played.poses), dtype=np.int64)
    poses = np.array([played.poses[int(stamp)] for stamp in stamps])
    summary = compare_with_truth(stamps, poses, result.truth).summary()
    apart = compare(result.estimates, played)
    settled = apart.since(apart.stamps[-1] - SETTLED_NS)
    print(f'rate {played.rate:g}; RMSE {summary.rmse:.3f} m; {apart}; at last {settled}')
    assert not played.losses
    assert summary.count > 190
    assert summary.rmse <= REQUIRED_M
    assert summary.rmse <= EXPECTED_M
    assert abs(played.initialised - result.initialised) <= LATEST_START_NS
    # What is in the bag is used, or said to be lost; at equal stamps the last word is the same.
    assert len(apart.stamps) >= 0.95 * len(result.estimates.settled().stamps)
    assert apart.distances.max() <= START_M
    assert apart.turns.max() <= START_RAD
    assert settled.distances.max() <= SETTLED_M
    assert settled.turns.max() <= SETTLED_RAD
