"""Epochs check what solvers take, and carry ranges down to the tag's plane."""

import numpy as np
import pytest

from tablerunner.errors import GeometryError
from tablerunner.uwb import Epochs
from tablerunner.uwb.epochs import flatness

ROOM = np.array([[0, 0, 2.0], [10, 0, 2.0], [10, 10, 4.0]])


def test_epochs_one_row_becomes_one_epoch():
    """Ranges of shape (n,) are one epoch; std and NLOS probability are spread over all."""
    epochs = Epochs.of(ROOM, [3.0, 4.0, np.nan], 0.1, 1.0)
    assert len(epochs) == 1
    assert epochs.std.shape == epochs.nlos.shape == (1, 3)
    assert epochs.usable.tolist() == [[True, True, False]]


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'ranges': [[1.0, 2.0]]}, r'\(m, 3\) is needed'),
        ({'ranges': np.ones((1, 1, 3))}, r'\(m, 3\) is needed'),
        ({'std': [0.1, 0.2]}, 'do not fit'),
        ({'nlos': [0.1, 0.2]}, 'do not fit'),
        ({'tag_height': np.nan}, 'height of the tag'),
    ],
)
def test_epochs_of_wrong_shape_is_refused(change, words):
    """What does not fit together is refused in words."""
    good = {'anchors': ROOM, 'ranges': np.ones((2, 3)), 'std': 0.1, 'tag_height': 1.0}
    with pytest.raises(GeometryError, match=words):
        Epochs.of(**{**good, **change})


def test_epochs_missing_range_needs_no_deviation():
    """A standard deviation that is not known does not matter where the range is missing."""
    epochs = Epochs.of(ROOM, [3.0, 4.0, np.nan], [0.1, 0.1, np.nan], 1.0)
    assert epochs.usable.sum() == 2


def test_plane_ranges_bridge_each_height():
    """A range loses its anchor's height by Pythagoras; what noise may explain becomes 0."""
    epochs = Epochs.of(ROOM, [[5.0, 0.9, 2.0]], 0.1, 1.0)
    plane = epochs.plane_ranges()[0]
    assert plane[0] == pytest.approx(np.sqrt(24.0))
    assert plane[1] == 0.0  # a decimetre short of the height
    assert np.isnan(plane[2])  # a metre short


def test_flatness_is_one_for_a_square_and_zero_in_line():
    """The ratio is that of the singular values; the direction that of the line."""
    rng = np.random.default_rng(1)
    anchors = np.column_stack([rng.uniform(0, 9, (5, 2)), np.full(5, 2.0)])
    used = rng.random((40, 5)) < 0.8
    used[:, :3] = True
    ratio, centre, direction = flatness(anchors, used)
    for k in range(40):
        plan = anchors[used[k], :2]
        _, values, vectors = np.linalg.svd(plan - plan.mean(axis=0))
        assert ratio[k] == pytest.approx(values[1] / values[0], abs=1e-9)
        assert centre[k] == pytest.approx(plan.mean(axis=0))
        assert abs(direction[k] @ vectors[0]) == pytest.approx(1.0)
    line = np.array([[0, 0, 2], [1, 2, 2], [2, 4, 2.0]])
    assert flatness(line, np.ones((1, 3), bool))[0][0] < 1e-9
