"""What the picture of a rule base shows, read back from the figure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tablerunner.config import Document
from tablerunner.control.fuzzy import load_base, read_base
from tablerunner.evaluation.plots.rule_base import draw_memberships, draw_rule_base, draw_surface

VALUES = {
    'left_front': 3.0,
    'front': 0.8,
    'right_front': 1.1,
    'side_difference': 5.0,
    'target_angle': -20.0,
}


@pytest.fixture
def figure() -> Iterator[Any]:
    """Return an empty figure that is closed afterwards."""
    import matplotlib as mpl

    mpl.use('Agg')
    from matplotlib import pyplot as plt

    drawn = plt.figure()
    yield drawn
    plt.close(drawn)


def test_every_set_of_every_variable_is_drawn_with_its_name(figure: Any) -> None:
    base = load_base('lv_corner')
    draw_memberships(figure, base, VALUES)
    shown = [axes for axes in figure.axes if axes.axison]
    variables = (*base.inputs, base.output)
    assert len(shown) == len(variables)
    for axes, variable in zip(shown, variables, strict=True):
        assert [text.get_text() for text in axes.texts] == list(variable.words)
        for line, item in zip(axes.lines, variable.sets, strict=False):
            x, y = line.get_data()
            np.testing.assert_allclose(y, item.membership.degrees(np.asarray(x)))
            assert set(item.membership.corners) & set(x)  # no corner is cut
    # Where it was given, the value too: within the domain.
    assert [axes.lines[-1].get_xdata()[0] for axes in shown[:-1]] == [3.0, 0.8, 1.1, 1.0, -20.0]
    assert len(shown[-1].lines) == len(base.output.sets)


def test_surface_holds_the_other_inputs_and_marks_the_place(figure: Any) -> None:
    base = load_base('lv_corner')
    axes = figure.subplots()
    draw_surface(axes, base, ('front', 'target_angle'), VALUES, True)
    assert (axes.get_xlim(), axes.get_ylim()) == ((0.0, 3.0), (-180.0, 180.0))
    assert axes.get_xlabel() == 'front [m]'
    assert tuple(np.ravel(axes.lines[0].get_data())) == (0.8, -20.0)
    assert axes.get_title(loc='left') == 'left_front 3 m, right_front 1.1 m\nside_difference 5 m'
    colours = axes.collections[0]
    for front, angle in ((0.8, -20.0), (2.5, 130.0), (0.3, 0.0), (1.0, -120.0)):
        output = base.infer_one(3.0, front, 1.1, 1.0, angle)
        bands = [
            number
            for number, path in enumerate(colours.get_paths())
            if path.contains_point((front, angle))
        ]
        # Beside the band's own, only the neighbour whose edge is near may hold the point.
        edges = [(colours.levels[band], colours.levels[band + 1]) for band in bands]
        assert any(low - 0.02 <= output <= high + 0.02 for low, high in edges), (front, angle)


def test_base_of_one_input_is_drawn_as_a_line(figure: Any) -> None:
    text = (
        'inputs: {a: {domain: [0, 1], sets: {no: {left_shoulder: [0, 1]},'
        ' yes: {right_shoulder: [0, 1]}}}}\n'
        'output: {c: {domain: [0, 1], sets: {small: {left_shoulder: [0, 1]},'
        ' big: {right_shoulder: [0, 1]}}}}\n'
        "rules: [{when: {a: 'no'}, then: big}, {when: {a: 'yes'}, then: small}]\n"
    )
    base = read_base(Document.parse(text), 'not')
    draw_rule_base(figure, base, ('a', 'a'), {'a': 0.3}, True)
    assert [axes.get_xlabel() for axes in figure.subfigs[0].axes] == ['a', 'c']
    assert figure.subfigs[0].axes[0].lines[-1].get_xdata()[0] == 0.3
    line = figure.subfigs[1].axes[0].lines[0]
    np.testing.assert_allclose(line.get_ydata(), 1.0 - line.get_xdata(), atol=1e-12)
