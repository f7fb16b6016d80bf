"""Component-wise correction: each step as the paper has it, and its figures."""

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.uwb import Epochs, FixState, solve
from tablerunner.uwb.solvers.component_wise import ComponentCorrector, calibrate_bias

WX, WY, HEIGHT = 0.502, 0.510, 0.594
ROBOT = np.array([[WX, WY], [-WX, WY], [-WX, -WY], [WX, -WY]]) / 2
ANCHORS = np.column_stack([ROBOT, np.full(4, HEIGHT)])
BIAS = np.array([-0.010, -0.180, 0.056, -0.029])
STAGES = ('raw', 'calibrated', 'radial', 'filtered')


def measured(position, rng, bias=BIAS, std=0.05):
    ranges = np.linalg.norm(position[:, None] - ROBOT, axis=2)
    return ranges + bias + rng.normal(0, std, ranges.shape)


def circle(count=2000):
    angle = np.linspace(0, 2 * np.pi, count)
    return 2.5 * np.column_stack([np.cos(angle), np.sin(angle)])


def square(count=2000):
    along = (np.linspace(0, 20, count) + 2.5) % 20
    side, rest = (along // 5).astype(int), along % 5 - 2.5
    x = np.choose(side, [2.5, -rest, -2.5, rest])
    return np.column_stack([x, np.choose(side, [rest, 2.5, -rest, -2.5])])


def calibrated_bias(rng):
    points = np.array([[1, 0], [0, 1], [-1, 0], [0, -1.0]])
    found = solve('linear', ANCHORS, measured(np.repeat(points, 300, 0), rng), 0.05, HEIGHT)
    return calibrate_bias(points, found.position.reshape(4, 300, 2).mean(axis=1))


@pytest.mark.parametrize(
    ('path', 'paper'),
    [(square, (703.3, 360.2, 239.5, 162.2)), (circle, (610.2, 314.8, 212.8, 143.3))],
)
def test_corrector_stages_have_the_papers_errors(path, paper):
    """Mean errors of T, T_C, T_R and T_F are within 10 % of tables 2 and 3, over ten seeds."""
    position = path()
    errors = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        corrector = ComponentCorrector(calibrated_bias(rng), 0.01)
        fix = corrector.add(Epochs.of(ANCHORS, measured(position, rng), 0.05, HEIGHT))
        errors.append(
            [np.linalg.norm(getattr(fix, stage) - position, axis=1).mean() for stage in STAGES]
        )
    assert 1e3 * np.mean(errors, axis=0) == pytest.approx(paper, rel=0.1)


def test_calibrate_bias_is_that_of_the_formula():
    """For a rectangle of anchors the bias follows from those of the ranges (Bae 8)."""
    e = BIAS
    expected = [
        -(e[0] - e[1] - e[2] + e[3]) / (2 * WX),
        -(e[0] + e[1] - e[2] - e[3]) / (2 * WY),
    ]
    assert calibrated_bias(np.random.default_rng(1)) == pytest.approx(expected, rel=0.1, abs=0.02)


def test_corrector_exact_ranges_pass_unchanged_wherever_the_tag_stands():
    """Without errors every stage is the truth, also while the tag moves along a ray."""
    position = np.column_stack([np.linspace(1, 4, 50), np.linspace(0.5, 2, 50)])
    epochs = Epochs.of(ANCHORS, measured(position, np.random.default_rng(1), 0, 0), 0.05, HEIGHT)
    fix = ComponentCorrector().add(epochs)
    for stage in STAGES:
        assert getattr(fix, stage) == pytest.approx(position, abs=1e-6)


def test_corrector_one_by_one_equals_all_at_once():
    """The filter's memory passes from call to call."""
    rng = np.random.default_rng(2)
    ranges = measured(circle(40), rng)
    whole = ComponentCorrector().add(Epochs.of(ANCHORS, ranges, 0.05, HEIGHT))
    corrector = ComponentCorrector()
    parts = [corrector.add(Epochs.of(ANCHORS, row, 0.05, HEIGHT)) for row in ranges]
    assert np.concatenate([part.filtered for part in parts]) == pytest.approx(whole.filtered)
    assert np.concatenate([part.covariance for part in parts]) == pytest.approx(whole.covariance)


def test_corrector_filter_is_that_of_the_formulas():
    """T_R and T_F follow (12) to (15), with the previous radius under (13)."""
    ranges = measured(circle(30), np.random.default_rng(5))
    bias = np.array([0.1, -0.05])
    fix = ComponentCorrector(bias).add(Epochs.of(ANCHORS, ranges, 0.05, HEIGHT))
    matrix = np.column_stack([ROBOT, np.full(4, -0.5)])
    last = None
    for k, row in enumerate(ranges):
        x, y, square = np.linalg.lstsq(matrix, 0.5 * (np.sum(ROBOT**2, 1) - row**2), rcond=None)[0]
        r = np.sqrt(square)
        corrected = np.array([x, y]) - bias * r
        radial = r * corrected / np.linalg.norm(corrected)
        assert fix.radial[k] == pytest.approx(radial)
        if last is None:
            last = radial
        else:
            before = np.linalg.norm(last)
            z = (r * last + (before - r) * radial) / before
            alpha = np.mean(np.abs(np.linalg.norm(radial - ROBOT, axis=1) - row))
            beta = np.mean(np.abs(np.linalg.norm(z - ROBOT, axis=1) - row))
            last = (alpha * z + beta * radial) / (alpha + beta)
        assert fix.filtered[k] == pytest.approx(last)


@pytest.mark.parametrize('count', [2000, 40])
def test_corrector_covariance_fits_the_errors_without_bias(count):
    """Without bias, errors have about the claimed mean square, lag behind a fast tag included."""
    position = circle(count)
    step = 5 * np.pi / count
    mean = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        epochs = Epochs.of(ANCHORS, measured(position, rng, 0.0), 0.05, HEIGHT)
        fix = ComponentCorrector(tag_step=step).add(epochs)
        error = fix.filtered - position
        mean.append(np.einsum('mi,mij,mj->m', error, np.linalg.inv(fix.covariance), error).mean())
    assert 1.0 < np.mean(mean) < 2.6


def test_corrector_missing_epoch_leaves_the_filter_alone():
    """An epoch of two ranges is no position, and those after it are as if it had not been."""
    rng = np.random.default_rng(4)
    ranges = measured(circle(40)[:6], rng)
    holed = np.insert(ranges, 3, [1.0, 1.0, np.nan, np.nan], axis=0)
    plain = ComponentCorrector().add(Epochs.of(ANCHORS, ranges, 0.05, HEIGHT))
    fix = ComponentCorrector().add(Epochs.of(ANCHORS, holed, 0.05, HEIGHT))
    assert fix.state[3] == FixState.TOO_FEW
    assert np.isnan(fix.filtered[3]).all()
    assert np.delete(fix.filtered, 3, axis=0) == pytest.approx(plain.filtered)


@pytest.mark.parametrize(
    ('truth', 'found'),
    [(np.empty((0, 2)), np.empty((0, 2))), ([[1, 0]], [[0, 0]]), ([[1, 0]], [[1, 0], [0, 1]])],
)
def test_calibrate_bias_without_usable_points_raises(truth, found):
    """No points, points that do not match or an estimate at the origin are an error."""
    with pytest.raises(GeometryError):
        calibrate_bias(truth, found)


def test_corrector_bias_that_is_none_raises():
    """A bias of the wrong shape, or not finite, is refused."""
    with pytest.raises(GeometryError, match='two finite numbers'):
        ComponentCorrector([np.nan, 0.0])
