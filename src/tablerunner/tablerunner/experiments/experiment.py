"""What an experiment says: figures measured over seeds beside those of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tablerunner.errors import ConfigError

Progress = Callable[[int, int], None]
"""Called with the runs that are done and all runs."""


@dataclass(frozen=True)
class Spread:
    """One figure over many seeds.

    Attributes
    ----------
    mean, std, median, low, high : float
        Mean, standard deviation (with one degree of freedom taken off), median, least, largest.
    count : int
        Number of seeds.
    p5, p95 : float
        Below which 5 % and 95 % of the seeds lie.
    """

    mean: float
    std: float
    median: float
    low: float
    high: float
    count: int
    p5: float = float('nan')
    p95: float = float('nan')

    @classmethod
    def of(cls, values: ArrayLike) -> Spread:
        """Return the spread of values, shape (seeds,).

        Raises
        ------
        ConfigError
            There are none.
        """
        array = np.asarray(values, dtype=float).ravel()
        if not array.size:
            raise ConfigError('seeds', 0, 'at least one')
        return cls(
            float(array.mean()),
            float(array.std(ddof=1)) if array.size > 1 else 0.0,
            float(np.median(array)),
            float(array.min()),
            float(array.max()),
            array.size,
            float(np.percentile(array, 5.0)),
            float(np.percentile(array, 95.0)),
        )


@dataclass(frozen=True)
class Bound:
    """Between which limits a figure is asked to be.

    Attributes
    ----------
    low, high : float
        Limits, in the row's unit; infinite where there is none.
    of : str
        Which figure of the spread is judged: ``mean``, ``median``, ``low`` or ``high``.
    """

    low: float = float('-inf')
    high: float = float('inf')
    of: str = 'mean'

    @classmethod
    def within(cls, share: float, paper: float) -> Bound:
        """Return the bound that allows a share of the paper's figure to both sides."""
        return cls(paper * (1.0 - share), paper * (1.0 + share))

    def holds(self, measured: Spread) -> bool:
        """Whether the figure lies between the limits."""
        return bool(self.low <= getattr(measured, self.of) <= self.high)

    def __str__(self) -> str:
        """Return the limits in few characters."""
        name = {'mean': '', 'low': 'min ', 'high': 'max '}.get(self.of, f'{self.of} ')
        if np.isinf(self.low):
            return f'{name}<= {self.high:.3g}'
        if np.isinf(self.high):
            return f'{name}>= {self.low:.3g}'
        return f'{name}{self.low:.3g} .. {self.high:.3g}'


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    name : str
        What was measured, e.g. ``twice centroid, mean``.
    unit : str
    measured : Spread
    paper : float or None
        The published figure; None where the paper has none, as for what is ours.
    raw : bool
        Whether it is of the sensors alone: those rows are matched before any other is compared.
    bound : Bound or None
        What is asked of it.
    """

    name: str
    unit: str
    measured: Spread
    paper: float | None = None
    raw: bool = False
    bound: Bound | None = None

    @property
    def holds(self) -> bool:
        """Whether the bound holds; true where there is none."""
        return self.bound is None or self.bound.holds(self.measured)


@dataclass(frozen=True)
class Outcome:
    """What came out of an experiment.

    Attributes
    ----------
    name, title : str
    seeds : tuple of int
        The seeds that were run: they and the settings make the figures again.
    rows : tuple of Row
        Raw rows first.
    draw : callable
        Draws the figure into an empty `matplotlib.figure.Figure`.
    settings : mapping of str to anything that JSON knows
        What was chosen where the paper is silent, the noise above all.
    notes : tuple of str
        What a reader must know to judge the table: errata, deviations, what a method knows.
    """

    name: str
    title: str
    seeds: tuple[int, ...]
    rows: tuple[Row, ...]
    draw: Callable[[Any], None]
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every bound holds."""
        return all(row.holds for row in self.rows)

    def row(self, name: str) -> Row:
        """Return a row by its name.

        Raises
        ------
        KeyError
            There is none.
        """
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(name)

    def as_figures(self) -> dict[str, Any]:
        """Return the figures alone: of each row the median and where 90 % of the seeds lie."""
        return {
            'name': self.name,
            'seed': self.seeds[0] if self.seeds else None,
            'runs': len(self.seeds) or 1,
            'rows': [
                {
                    'row': row.name.rpartition(', ')[0] or row.name,
                    'metric': row.name.rpartition(', ')[2],
                    'unit': row.unit,
                    'paper': row.paper,
                    'measured': row.measured.median,
                    'low': row.measured.p5,
                    'high': row.measured.p95,
                }
                for row in self.rows
            ],
        }

    def as_json(self) -> dict[str, Any]:
        """Return everything but the picture as what JSON knows."""
        return {
            'experiment': self.name,
            'title': self.title,
            'seeds': list(self.seeds),
            'settings': dict(self.settings),
            'rows': [
                {
                    'name': row.name,
                    'unit': row.unit,
                    'raw': row.raw,
                    'paper': row.paper,
                    'mean': row.measured.mean,
                    'std': row.measured.std,
                    'median': row.measured.median,
                    'min': row.measured.low,
                    'max': row.measured.high,
                    'bound': None if row.bound is None else str(row.bound),
                    'holds': row.holds,
                }
                for row in self.rows
            ],
            'notes': list(self.notes),
            'holds': self.holds,
        }


Experiment = Callable[[Sequence[int], Progress], Outcome]
"""Runs all seeds and returns what came out."""
