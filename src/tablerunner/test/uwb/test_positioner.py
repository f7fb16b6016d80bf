"""The positioner closes an epoch when all have answered, one answers again, or time is up."""

import numpy as np
import pytest

from tablerunner.errors import ConfigError, GeometryError
from tablerunner.types import Anchor, PoseSample, RangeSample, Refusal
from tablerunner.uwb import SOLVERS, Positioner, PositionerConfig

ANCHORS = tuple(
    Anchor(f'A{i}', position)
    for i, position in enumerate(
        [(0.0, 0.0, 2.0), (10.0, 0.0, 2.0), (10.0, 10.0, 2.0), (0.0, 10.0, 2.0)]
    )
)
PLACE = np.array([3.0, 4.0, 1.1])
START = 1_000_000_000


def ranged(index, stamp_ms, extra=0.0, probability=0.0):
    distance = float(np.linalg.norm(PLACE - ANCHORS[index].position)) + extra
    return RangeSample(
        START + stamp_ms * 1_000_000,
        f'A{index}',
        'tag',
        0,
        distance,
        0.01,
        nlos_probability=probability,
    )


def positioner():
    return Positioner(PositionerConfig(), ANCHORS)


def test_add_every_anchor_gives_a_fix_at_the_mean_stamp():
    """The fourth answer completes the epoch; the fix knows no heading."""
    gatherer = positioner()
    results = [gatherer.add(ranged(i, 20 * i)) for i in range(4)]
    assert results[:3] == [None, None, None]
    fix = results[3]
    assert isinstance(fix, PoseSample)
    assert (fix.pose.x, fix.pose.y) == pytest.approx((3.0, 4.0), abs=1e-6)
    assert fix.stamp == START + 30_000_000
    assert np.isinf(fix.covariance[2, 2])


def test_add_same_anchor_again_closes_the_epoch_before_it():
    """With one anchor silent, three ranges make the fix once the first anchor comes round."""
    gatherer = positioner()
    results = [gatherer.add(ranged(i, 20 * k)) for k, i in enumerate((0, 1, 2, 0))]
    assert results[:3] == [None, None, None]
    assert isinstance(results[3], PoseSample)


def test_add_after_a_pause_refuses_the_thin_epoch():
    """Two ranges and then silence are no fix, and said to be none."""
    gatherer = positioner()
    gatherer.add(ranged(0, 0))
    gatherer.add(ranged(1, 20))
    result = gatherer.add(ranged(2, 500))
    assert isinstance(result, Refusal)
    assert result.reason == 'fewer than three ranges in an epoch'


def test_add_nlos_range_widens_the_covariance_and_counts_less():
    """A range marked NLOS pulls the fix less than the same range unmarked."""

    def fix_with(probability):
        gatherer = positioner()
        fix = None
        for i in range(4):
            late = (0.8, probability) if i == 0 else (0.0, 0.0)
            fix = gatherer.add(ranged(i, 20 * i, *late))
        assert isinstance(fix, PoseSample)
        return np.hypot(fix.pose.x - 3.0, fix.pose.y - 4.0)

    assert fix_with(1.0) < 0.5 * fix_with(0.0)


def test_add_unknown_anchor_is_refused():
    """A range of an anchor that nobody described is refused by name."""
    stranger = RangeSample(START, 'B7', 'tag', 0, 3.0)
    result = positioner().add(stranger)
    assert isinstance(result, Refusal)
    assert (result.key, result.reason) == ('B7', 'unknown anchor')


def test_positioner_anchor_given_twice_raises():
    """Two anchors of one name would make ranges ambiguous."""
    with pytest.raises(GeometryError, match='given twice: A1'):
        Positioner(PositionerConfig(), (*ANCHORS, ANCHORS[1]))


def test_add_ranges_of_anchors_in_line_is_refused_with_the_reason():
    """Three of five anchors in one line answer: no fix on a guessed side."""
    line = tuple(Anchor(f'L{i}', (5.0 * i, 0.0, 2.0)) for i in range(3))
    gatherer = Positioner(PositionerConfig(), (*line, *ANCHORS[2:]))
    results = [
        gatherer.add(RangeSample(START + 20_000_000 * i, f'L{i}', 'tag', 0, 5.0, 0.01))
        for i in range(3)
    ]
    results.append(gatherer.add(RangeSample(START + 900_000_000, 'L0', 'tag', 0, 5.0, 0.01)))
    assert results[:3] == [None, None, None]
    assert isinstance(results[3], Refusal)
    assert results[3].reason == 'anchors in one line'


@pytest.mark.parametrize('solver', SOLVERS)
def test_every_solver_can_be_chosen(solver):
    """Exact ranges give the place by each of them, and the detail says what went in."""
    gatherer = Positioner(PositionerConfig(solver=solver), ANCHORS)
    fix = None
    for i in range(4):
        fix = gatherer.add(ranged(i, 20 * i))
    assert isinstance(fix, PoseSample)
    assert (fix.pose.x, fix.pose.y) == pytest.approx((3.0, 4.0), abs=1e-4)
    assert gatherer.last.stamp == fix.stamp
    assert gatherer.last.gdop > 0.5
    assert gatherer.last.residuals == pytest.approx(dict.fromkeys(gatherer._order, 0.0), abs=1e-4)
    assert set(gatherer.last.used) <= {'A0', 'A1', 'A2', 'A3'}


def test_unknown_solver_is_refused_with_the_names():
    with pytest.raises(ConfigError, match=r'solver.*magic.*nonlinear'):
        PositionerConfig(solver='magic')


def test_residual_test_takes_the_weight_off_the_blocked_range():
    """With five anchors the test finds the one that is too long, and the fix moves less."""
    anchors = (*ANCHORS, Anchor('A4', (5.0, -3.0, 2.0)))

    def off(residual_test):
        gatherer = Positioner(PositionerConfig(residual_test=residual_test), anchors)
        fix = None
        for i, anchor in enumerate(anchors):
            distance = float(np.linalg.norm(PLACE - anchor.position)) + (1.0 if i == 2 else 0.0)
            fix = gatherer.add(RangeSample(START + i, f'A{i}', 'tag', 0, distance, 0.01))
        return np.hypot(fix.pose.x - 3.0, fix.pose.y - 4.0)

    assert off(True) < 0.5 * off(False)


def test_covariance_of_fixes_is_consistent():
    """NEES of fixes over the whole room, for honest noise of 0.1 m: two degrees of freedom.

    The mean of 600 has a standard error of 0.08; that of each solver is in test_registry.
    """
    rng = np.random.default_rng(11)
    positioner = Positioner(PositionerConfig(), ANCHORS)
    nees = []
    for index in range(600):
        place = np.array([*rng.uniform(0.5, 9.5, 2), 1.1])
        fix = None
        for i, anchor in enumerate(ANCHORS):
            distance = float(np.linalg.norm(place - anchor.position)) + rng.normal(scale=0.1)
            stamp = START + index * 10**9 + i
            fix = positioner.add(RangeSample(stamp, f'A{i}', 'tag', 0, distance, 0.01))
        if isinstance(fix, PoseSample):
            error = np.array([fix.pose.x, fix.pose.y]) - place[:2]
            nees.append(error @ np.linalg.solve(fix.covariance[:2, :2], error))
    assert len(nees) == 600
    assert 1.83 < np.mean(nees) < 2.17
