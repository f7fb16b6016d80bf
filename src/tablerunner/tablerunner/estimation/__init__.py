"""Estimation of the robot's pose from odometry, ranges and poses."""

from tablerunner.estimation.estimator import Estimator, EstimatorConfig, Start
from tablerunner.estimation.localizer import Localizer
from tablerunner.estimation.localizer_config import LocalizerConfig
from tablerunner.estimation.outcome import Outcome
from tablerunner.estimation.registry import ESTIMATORS
from tablerunner.estimation.status import Cause, LocalizerState, LocalizerStatus
from tablerunner.estimation.transform_smoother import SmootherConfig, TransformSmoother

__all__ = [
    'ESTIMATORS',
    'Cause',
    'Estimator',
    'EstimatorConfig',
    'Localizer',
    'LocalizerConfig',
    'LocalizerState',
    'LocalizerStatus',
    'Outcome',
    'SmootherConfig',
    'Start',
    'TransformSmoother',
]
