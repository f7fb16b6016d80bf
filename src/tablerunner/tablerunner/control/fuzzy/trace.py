"""Why a rule base decided as it did: memberships, rules that fired, and what came out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class TracedInput:
    """One input of a decision.

    Attributes
    ----------
    name, unit : str
    given : float
        As it came.
    used : float
        Within the variable's domain.
    degrees : tuple of (str, float)
        Degree of membership in each set.
    """

    name: str
    unit: str
    given: float
    used: float
    degrees: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class Fired:
    """One rule that fired.

    Attributes
    ----------
    rule : str
        Where it stands: table, row and column.
    when : tuple of (str, str)
        Variable and set of each condition.
    then : str
        Set of the output.
    strength : float
        How far its conditions hold, 0..1.
    share : float
        Its part in the sum of all strengths.
    centre : float
        Centre of the output's set.
    """

    rule: str
    when: tuple[tuple[str, str], ...]
    then: str
    strength: float
    share: float
    centre: float


@dataclass(frozen=True, slots=True)
class Trace:
    """One decision of a rule base.

    Attributes
    ----------
    base : str
        Name of the rule base.
    inputs : tuple of TracedInput
    fired : tuple of Fired
        The strongest first.
    output : float
        In the output variable's unit.
    name, unit : str
        Of the output variable.
    """

    base: str
    inputs: tuple[TracedInput, ...]
    fired: tuple[Fired, ...]
    output: float
    name: str
    unit: str

    def as_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            'base': self.base,
            'inputs': {
                item.name: {
                    'given': item.given,
                    'used': item.used,
                    'unit': item.unit,
                    'degrees': dict(item.degrees),
                }
                for item in self.inputs
            },
            'fired': [
                {
                    'rule': item.rule,
                    'when': dict(item.when),
                    'then': item.then,
                    'strength': item.strength,
                    'share': item.share,
                    'centre': item.centre,
                }
                for item in self.fired
            ],
            'output': {'name': self.name, 'value': self.output, 'unit': self.unit},
        }
