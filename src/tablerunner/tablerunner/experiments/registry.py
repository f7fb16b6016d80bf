"""Every experiment by the name that chooses it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from tablerunner.errors import ConfigError
from tablerunner.experiments.bae2022 import run_bae2022
from tablerunner.experiments.experiment import Experiment
from tablerunner.experiments.lv import run_lv

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {
        'lv': run_lv,
        'bae2022': run_bae2022,
    }
)


def experiment_named(name: str) -> Experiment:
    """Return an experiment by its name.

    Raises
    ------
    ConfigError
        There is none of that name.
    """
    try:
        return EXPERIMENTS[name]
    except KeyError:
        raise ConfigError('NAME', name, 'one of ' + ', '.join(EXPERIMENTS)) from None
