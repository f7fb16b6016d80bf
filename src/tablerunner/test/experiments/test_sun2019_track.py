"""Keeping to Sun's square on the ekf: what is measured, and that the bound holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tablerunner.experiments import sun2019_track
from tablerunner.experiments.sun2019_track import (
    BEYOND_M,
    SQUARE,
    Tracked,
    drive_square,
    rms,
    room,
    run_sun2019_track,
)
from tablerunner.scenario import load_scenario

SCENARIO = Path(__file__).parents[3] / 'tablerunner_bringup' / 'scenarios' / 'sun2019.yaml'


def test_room_is_that_of_the_scenario_file() -> None:
    file = load_scenario(SCENARIO)
    for name in ('walls', 'anchors', 'robot', 'sensors', 'people'):
        assert getattr(room(), name) == getattr(file, name), name
    assert room().start == pytest.approx(file.start, abs=1e-6)
    assert SQUARE.points.tolist() == [list(point) for point in file.routes['square']]


def test_errors_across_the_track_are_those_across_each_leg() -> None:
    """Truth 0.1 m inside of the square, belief on it and 0.3 m farther along."""
    arcs = np.concatenate([np.arange(leg * 9.0 + 0.2, leg * 9.0 + 8.6, 0.1) for leg in range(4)])
    on = np.array([SQUARE.at(arc) for arc in arcs])
    ahead = np.array([SQUARE.at(arc + 0.3) for arc in arcs])
    inward = np.array([[0.1, 0.0], [0.0, -0.1], [-0.1, 0.0], [0.0, 0.1]])
    leg = (arcs // 9.0).astype(int)
    run = Tracked.of(on + inward[leg], ahead, 1.0)
    np.testing.assert_allclose(run.track_m, 0.1, atol=1e-9)
    np.testing.assert_allclose(run.control_m, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(run.across_m), 0.1, atol=1e-9)


def test_corners_are_what_lies_near_them_along_the_track() -> None:
    arcs = np.arange(0.0, 36.0, 0.1)
    on = np.array([SQUARE.at(arc) for arc in arcs])
    run = Tracked.of(on, on, 1.0)
    near = np.abs(arcs[:, None] - [9.0, 18.0, 27.0]).min(axis=1)
    assert run.corner[near < 0.49].all()
    assert not run.corner[near > 0.51].any()


def test_fuzzy_controller_keeps_to_the_square_on_the_ekf() -> None:
    """The whole loop; corners are driven without swinging out."""
    run = drive_square('fuzzy', 100)
    assert rms(run.track_m) - rms(run.across_m) <= BEYOND_M
    assert 0.005 < rms(run.across_m) < 0.08  # it is the ekf on noisy ranges, not the truth
    assert rms(run.track_m[run.corner]) < 0.08
    assert len(run.truth) > 60 * 20


@pytest.mark.parametrize(('swing_m', 'holds'), [(0.04, True), (0.06, False)])
def test_outcome_fails_when_one_seed_is_too_far_off(
    swing_m: float, holds: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    on = np.array([SQUARE.at(arc) for arc in np.arange(0.1, 8.0, 0.1)])
    good = Tracked.of(on, on, 70.0)
    # Truth and belief off the track together: the controller's doing.
    off = on + np.array([swing_m, 0.0])
    bad = Tracked.of(off, off, 70.0)
    monkeypatch.setattr(
        sun2019_track, 'run_seeds', lambda run, tasks, progress: [bad, *[good] * (len(tasks) - 1)]
    )
    monkeypatch.setattr(sun2019_track, 'rms', lambda values: rms(values) if len(values) else 0.0)
    assert run_sun2019_track(range(3), lambda done, count: None).holds is holds
