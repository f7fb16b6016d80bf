"""UWB: from radio timestamps to calibrated ranges and to positions."""

from tablerunner.uwb.anchor_health import AnchorHealth, AnchorHealthConfig, AnchorWatch
from tablerunner.uwb.epochs import Epochs
from tablerunner.uwb.fix import FixState, PositionFix
from tablerunner.uwb.positioner import Positioner, PositionerConfig
from tablerunner.uwb.ranger import DEVICE_SOURCE, Ranger, RangerConfig
from tablerunner.uwb.solvers.judge import gdop
from tablerunner.uwb.solvers.nonlinear import solve_positions
from tablerunner.uwb.solvers.registry import SOLVERS, Solver, solve

__all__ = [
    'DEVICE_SOURCE',
    'SOLVERS',
    'AnchorHealth',
    'AnchorHealthConfig',
    'AnchorWatch',
    'Epochs',
    'FixState',
    'PositionFix',
    'Positioner',
    'PositionerConfig',
    'Ranger',
    'RangerConfig',
    'Solver',
    'gdop',
    'solve',
    'solve_positions',
]
