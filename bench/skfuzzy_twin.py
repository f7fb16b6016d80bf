"""Rule bases of ours rebuilt in scikit-fuzzy, as its documentation shows."""

from __future__ import annotations

from typing import Any

import skfuzzy
from numpy import linspace
from numpy.typing import NDArray
from skfuzzy import control

from tablerunner.control.fuzzy import RuleBase, Variable


def twin(base: RuleBase, points: int) -> control.ControlSystemSimulation:
    """Return the same variables and rules in scikit-fuzzy, defuzzified by the centroid.

    Parameters
    ----------
    base : RuleBase
    points : int
        Of each variable's universe; exact where the sets' corners are among them.
    """
    inputs = [_variable(item, control.Antecedent, points) for item in base.inputs]
    output = _variable(base.output, control.Consequent, points)
    output.defuzzify_method = 'centroid'
    rules = []
    for rule in base.rules:
        terms = [inputs[i][base.inputs[i].sets[k].name] for i, k in rule.when]
        condition = terms[0]
        for term in terms[1:]:
            condition = condition & term
        rules.append(control.Rule(condition, output[base.output.sets[rule.then].name]))
    return control.ControlSystemSimulation(control.ControlSystem(rules))


def compute(simulation: control.ControlSystemSimulation, base: RuleBase, row: NDArray) -> float:
    """Return the twin's output for one row of inputs."""
    for name, value in zip(base.input_names, row, strict=True):
        simulation.input[name] = value
    simulation.compute()
    return float(simulation.output[base.output.name])


class ByHand:
    """A rule base by hand: the fastest that a user of scikit-fuzzy would write for one input.

    Memberships by `skfuzzy.interp_membership`, then plain Python: min, and the weighted average.
    """

    def __init__(self, base: RuleBase, points: int) -> None:
        self._base = base
        self._universes = [linspace(item.low, item.high, points) for item in base.inputs]
        self._shapes = [
            list(item.degrees(universe))
            for item, universe in zip(base.inputs, self._universes, strict=True)
        ]
        self._centres = [float(value) for value in base.output.centres()]

    def compute(self, row: NDArray) -> float:
        """Return the output for one row of inputs."""
        degrees = [
            [skfuzzy.interp_membership(universe, shape, value) for shape in shapes]
            for universe, shapes, value in zip(self._universes, self._shapes, row, strict=True)
        ]
        strengths = [min(degrees[i][k] for i, k in rule.when) for rule in self._base.rules]
        centres = (self._centres[rule.then] for rule in self._base.rules)
        weighted = sum(s * c for s, c in zip(strengths, centres, strict=True))
        return float(weighted / sum(strengths))


def _variable(variable: Variable, kind: type, points: int) -> Any:
    twin_of = kind(linspace(variable.low, variable.high, points), variable.name)
    for item in variable.sets:
        twin_of[item.name] = item.membership.degrees(twin_of.universe)
    return twin_of
