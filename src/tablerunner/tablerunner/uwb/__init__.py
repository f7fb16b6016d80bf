"""UWB: from radio timestamps to calibrated ranges and to positions."""

from tablerunner.uwb.multilateration import PositionFix, gdop, solve_positions
from tablerunner.uwb.positioner import Positioner, PositionerConfig
from tablerunner.uwb.ranger import Ranger, RangerConfig

__all__ = [
    'PositionFix',
    'Positioner',
    'PositionerConfig',
    'Ranger',
    'RangerConfig',
    'gdop',
    'solve_positions',
]
