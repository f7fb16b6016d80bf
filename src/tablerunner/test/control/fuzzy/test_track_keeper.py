from __future__ import annotations

import math

import numpy as np
import pytest

from tablerunner.control import Path, VelocityLimits
from tablerunner.control.fuzzy import TrackConfig, TrackKeeper, load_base
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.types import Velocity

WHEELS_M = 0.34  # Sun's track
LINE = Path(np.array([[0.0, 0.0], [10.0, 0.0]]))
SQUARE = Path(np.array([[3.0, 3.0], [3.0, 12.0], [12.0, 12.0], [12.0, 3.0], [3.0, 3.0]]))


@pytest.fixture
def keeper() -> TrackKeeper:
    """Return a keeper on a straight track along x."""
    keeper = TrackKeeper(TrackConfig(), WHEELS_M)
    keeper.follow(LINE)
    return keeper


def test_inside_the_corridor_the_direction_is_held(keeper: TrackKeeper) -> None:
    for deviation in (-0.049, 0.0, 0.049):
        step = keeper.step(Pose2(0.5, deviation, 0.0), 0.4)
        assert not step.correcting
        assert step.deviation_m == pytest.approx(deviation)
        assert step.velocity == Velocity(pytest.approx(0.4), pytest.approx(0.0))
        turned = keeper.step(Pose2(0.5, deviation, 0.1), 0.4)
        assert turned.velocity.angular_rad_s == pytest.approx(-2.0 * 0.1)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_outside_the_wheel_on_its_side_is_faster(keeper: TrackKeeper, side: float) -> None:
    """A robot that left the track to the left (right) gets a faster left (right) wheel (2.6)."""
    step = keeper.step(Pose2(0.5, side * 0.1, 0.0), 0.4, traced=True)
    assert step.correcting
    assert side * (step.left_m_s - step.right_m_s) > 0.02
    assert (step.left_m_s + step.right_m_s) / 2.0 == pytest.approx(0.4)
    rate = (step.right_m_s - step.left_m_s) / WHEELS_M
    assert step.velocity == Velocity(pytest.approx(0.4), pytest.approx(rate))
    assert step.trace is not None
    assert 0.3 * step.trace.output == pytest.approx(step.right_m_s - step.left_m_s)
    assert step.trace.fired


def test_correcting_goes_on_until_well_inside(keeper: TrackKeeper) -> None:
    """It begins at the edge, 0.05 m, and ends at 0.3 of it: no change of mind at the edge."""
    states = [
        keeper.step(Pose2(0.5, deviation, 0.0), 0.4).correcting
        for deviation in (0.049, 0.051, 0.049, 0.02, 0.014, 0.02, 0.049, 0.051)
    ]
    assert states == [False, True, True, True, False, False, False, True]


def test_table_is_the_same_to_both_sides() -> None:
    base = load_base('sun_track')
    rows = np.random.default_rng(3).uniform([-0.5, -100.0], [0.5, 100.0], (500, 2))
    np.testing.assert_allclose(base.infer(-rows), -base.infer(rows), atol=1e-12)


def test_correction_grows_with_deviation_and_with_heading_error() -> None:
    base = load_base('sun_track')
    grid = np.linspace(-0.4, 0.4, 161)
    for degrees in (-20.0, 0.0, 10.0, 25.0):
        outputs = base.infer(np.column_stack([grid, np.full_like(grid, degrees)]))
        assert np.diff(outputs).max() < 0.02  # min makes ripples, a hundredth of the range
        assert outputs[0] - outputs[-1] > 0.9
    for deviation in (-0.3, 0.0, 0.1):
        angles = np.linspace(-90.0, 90.0, 181)
        outputs = base.infer(np.column_stack([np.full_like(angles, deviation), angles]))
        assert np.diff(outputs).max() < 0.05
        assert (outputs[0], outputs[-1]) == (pytest.approx(1.0), pytest.approx(-1.0))


def run(
    path: Path, start: Pose2, drift: float = 0.0, steps: int = 3000, speed: float = 0.4
) -> tuple[np.ndarray, float]:
    """Return the deviations of a drive, 20 steps a second, and the way left over."""
    keeper, limits, dt = TrackKeeper(TrackConfig(), WHEELS_M), VelocityLimits(), 0.05
    keeper.follow(path)
    pose, velocity, deviations = start, Velocity(), []
    for _ in range(steps):
        step = keeper.step(pose, speed)
        deviations.append(step.deviation_m)
        if step.left_over_m < 0.05:
            break
        velocity = limits.approach(velocity, step.velocity, dt)
        turn = (velocity.angular_rad_s + drift) * dt
        moved = velocity.linear_m_s * dt
        pose = pose @ Pose2(moved * math.cos(turn / 2), moved * math.sin(turn / 2), turn)
    return np.array(deviations), step.left_over_m


@pytest.mark.parametrize('speed', [0.4, 0.6])
@pytest.mark.parametrize('drift', [0.0, 0.03, -0.03])
def test_square_of_sun_is_kept_within_five_centimetres_rms(drift: float, speed: float) -> None:
    """Issue 5 asks for 0.05 m RMS; also with wheels that pull to a side, by a drift in rad/s.

    At the corners, which are sharp, the robot turns before it drives on: a robot that drives on as
    it turns is 0.23 m off at 0.6 m/s.
    """
    start = Pose2(3.0, 3.0, math.pi / 2)
    deviations, left_over = run(SQUARE, start, drift, speed=speed)
    assert left_over < 0.05
    assert math.sqrt(np.mean(deviations**2)) < 0.05
    assert np.abs(deviations).max() < 0.1


def test_robot_comes_back_from_anywhere_without_swinging_over() -> None:
    rng = np.random.default_rng(8)
    for _ in range(30):
        start = Pose2(0.2, rng.choice([-1.0, 1.0]) * rng.uniform(0.06, 1.5), rng.uniform(-3, 3))
        deviations, _ = run(LINE, start, steps=500)
        assert np.abs(deviations[-40:]).max() < 0.05, start
        if abs(start.heading) < 1.0:  # one that is turned away drives out first
            other_side = -math.copysign(1.0, start.y) * deviations
            assert other_side.max() < 0.05, start


def test_progress_does_not_jump_to_another_leg() -> None:
    """The first leg is not left for the last one, which ends where the first begins."""
    keeper = TrackKeeper(TrackConfig(), WHEELS_M)
    keeper.follow(SQUARE)
    step = keeper.step(Pose2(3.1, 3.0, math.pi / 2), 0.4)
    assert step.left_over_m == pytest.approx(36.0)
    assert step.deviation_m == pytest.approx(-0.1)


def test_unusable_tracks_poses_and_bases_are_refused(keeper: TrackKeeper) -> None:
    with pytest.raises(ConfigError, match=r'lv_speed.inputs: .*expected deviation, heading_error'):
        TrackKeeper(TrackConfig(), WHEELS_M, load_base('lv_speed'))
    with pytest.raises(ValueError, match='the pose is not finite'):
        keeper.step(Pose2(math.nan, 0.0, 0.0), 0.4)
    keeper.follow(Path(np.array([[1.0, 1.0]])))
    with pytest.raises(ValueError, match='no track'):
        keeper.step(Pose2(), 0.4)
    with pytest.raises(ValueError, match='no track'):
        TrackKeeper(TrackConfig(), WHEELS_M).step(Pose2(), 0.4)
