import numpy as np
import pytest

from tablerunner.estimation.models.position_model import predict_position
from tablerunner.estimation.models.range_model import predict_ranges
from tablerunner.estimation.particles.sight import position_of, ranges_of

ANCHORS = [(0.0, 0.0, 2.2), (9.0, 1.0, 2.4), (4.0, 8.0, 1.9)]
LEVER = (-0.2, 0.1, 1.1)


def poses(count=30):
    rng = np.random.default_rng(0)
    return rng.uniform((-1.0, -1.0, -3.1), (10.0, 9.0, 3.1), size=(count, 3))


def differences(of, at, step=1e-6):
    """Return d(of)/d(pose) by central differences, shape (n, m, 3)."""
    columns = []
    for axis in range(3):
        way = np.zeros(3)
        way[axis] = step
        columns.append((of(at + way) - of(at - way)) / (2.0 * step))
    return np.stack(columns, axis=2)


@pytest.mark.parametrize('lever', [LEVER, (0.0, 0.0, 1.1)])
def test_ranges_and_their_slopes(lever):
    """Against the `ekf`'s model, written for one state, and against differences."""
    at = poses()
    expected, slope = ranges_of(at, ANCHORS, lever)
    for row, pose in enumerate(at):
        state = np.concatenate([pose, np.zeros(4), np.zeros(6)])
        values, slopes = predict_ranges(state, list(zip(ANCHORS, range(3), strict=True)), lever)
        assert expected[row] == pytest.approx(values, abs=1e-12)
        assert slope[row] == pytest.approx(slopes[:, :3], abs=1e-12)
    assert slope == pytest.approx(
        differences(lambda p: ranges_of(p, ANCHORS, lever)[0], at), abs=1e-7
    )


def test_an_anchor_that_the_tag_touches_gives_no_direction():
    expected, slope = ranges_of(np.array([[1.0, 2.0, 0.3]]), [(1.0, 2.0, 1.1)], (0.0, 0.0, 1.1))
    assert expected[0, 0] == 0.0
    assert not slope.any()


@pytest.mark.parametrize('point', [(0.3, -0.1), (0.0, 0.0)])
def test_positions_and_their_slopes(point):
    at = poses()
    expected, slope = position_of(at, point)
    for row, pose in enumerate(at):
        value, along = predict_position(pose, point)
        assert expected[row] == pytest.approx(value, abs=1e-12)
        assert slope[row] == pytest.approx(along, abs=1e-12)
    assert slope == pytest.approx(differences(lambda p: position_of(p, point)[0], at), abs=1e-7)
