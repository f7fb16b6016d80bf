"""The exceptions that the core raises: one tree, so that a caller can catch all or one."""

from __future__ import annotations

from typing import Any


class TablerunnerError(Exception):
    """Base of every error that Tablerunner raises on purpose."""


class ConfigError(TablerunnerError):
    """A parameter, scenario or calibration file holds something that cannot be used.

    Parameters
    ----------
    field : str
        Dotted path of the field, e.g. ``anchors[2].position``; empty for the file itself.
    value : Any
        What was found there.
    expected : str
        What would have been accepted, in words.
    source : str
        File name or node name; empty while it is not known yet.
    line : int or None
        Line in the file, counted from 1.
    """

    def __init__(
        self,
        field: str,
        value: Any,
        expected: str,
        source: str = '',
        line: int | None = None,
    ) -> None:
        self.field = field
        self.value = value
        self.expected = expected
        self.source = source
        self.line = line
        super().__init__(self._text())

    def _text(self) -> str:
        place = self.source
        if self.line is not None:
            place = f'{place or "input"}:{self.line}'
        parts = [part for part in (place, self.field) if part]
        shown = repr(self.value)
        if len(shown) > 120:
            shown = shown[:117] + '...'
        return ': '.join([*parts, f'got {shown}, expected {self.expected}'])

    def located(self, source: str = '', line: int | None = None, prefix: str = '') -> ConfigError:
        """Return the same error with its place filled in where it was not known."""
        if prefix and self.field and not self.field.startswith('['):
            field = f'{prefix}.{self.field}'
        else:
            field = prefix + self.field
        return ConfigError(
            field,
            self.value,
            self.expected,
            self.source or source,
            self.line if self.line is not None else line,
        )


class GeometryError(TablerunnerError):
    """A geometric problem has no answer: coincident anchors, tag on an anchor, no room left."""


class CovarianceError(TablerunnerError):
    """A covariance is not symmetric, not finite or not positive semi-definite."""


class TuningError(TablerunnerError):
    """What was recorded is too little to find noise from."""


class BagError(TablerunnerError):
    """A recording cannot be read or lacks what was asked of it."""


class PlanningError(TablerunnerError):
    """No way leads to the goal, or the goal is not a place where the robot can stand."""


class NoWayError(PlanningError):
    """Start and goal are good places, but what stands between them leaves no way."""


class MissionError(TablerunnerError):
    """A mission cannot be taken on: the robot is busy, or there is nothing to do."""
