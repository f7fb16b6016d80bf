"""Every experiment by the name that chooses it: simulated ones, and those on recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from tablerunner.errors import ConfigError
from tablerunner.experiments.bae2022 import run_bae2022
from tablerunner.experiments.camera_limits import run_limits
from tablerunner.experiments.camera_run import run_camera
from tablerunner.experiments.camera_start import run_camera_start
from tablerunner.experiments.crossings import run_crossings
from tablerunner.experiments.experiment import Experiment, Outcome, Progress
from tablerunner.experiments.global_start import run_global_start
from tablerunner.experiments.lias import run_lias
from tablerunner.experiments.liu2023 import run_liu2023
from tablerunner.experiments.lv import run_lv
from tablerunner.experiments.nlos import run_nlos
from tablerunner.experiments.pf_uiekf import run_pf_uiekf
from tablerunner.experiments.sun2019 import run_sun2019
from tablerunner.experiments.sun2019_track import run_sun2019_track
from tablerunner.experiments.survey import run_survey

EXPERIMENTS: Mapping[str, Experiment] = MappingProxyType(
    {
        'lv': run_lv,
        'bae2022': run_bae2022,
        'sun2019': run_sun2019,
        'sun2019_track': run_sun2019_track,
        'pf_uiekf': run_pf_uiekf,
        'global_start': run_global_start,
        'camera_start': run_camera_start,
        'liu2023': run_liu2023,
        'nlos': run_nlos,
        'ceiling_camera': run_camera,
        'camera_limits': run_limits,
        'survey': run_survey,
        'crossings': run_crossings,
    }
)

USUAL_SEEDS = 20
OTHER_SEEDS: Mapping[str, int] = MappingProxyType(
    {'pf_uiekf': 100, 'camera_start': 100, 'crossings': 4}
)
"""Where a seed is a short run: as many as the paper has, or as are asked. Where it is three
minutes of work: few."""

RECORDED: Mapping[str, Callable[[Path, Progress], Outcome]] = MappingProxyType({'lias': run_lias})
"""Those that need recordings of others, from the folder that they are given."""


def require_experiment(name: str) -> None:
    """Raise unless there is an experiment of that name.

    Raises
    ------
    ConfigError
        There is none.
    """
    names = (*EXPERIMENTS, *RECORDED)
    if name not in names:
        raise ConfigError('NAME', name, 'one of ' + ', '.join(names))
