"""Estimation of the robot's pose from odometry, ranges and poses."""

from tablerunner.estimation.estimator import Estimator, EstimatorConfig, Start
from tablerunner.estimation.localizer import Localizer, Outcome
from tablerunner.estimation.localizer_config import LocalizerConfig
from tablerunner.estimation.registry import ESTIMATORS
from tablerunner.estimation.status import LocalizerState, LocalizerStatus

__all__ = [
    'ESTIMATORS',
    'Estimator',
    'EstimatorConfig',
    'Localizer',
    'LocalizerConfig',
    'LocalizerState',
    'LocalizerStatus',
    'Outcome',
    'Start',
]
