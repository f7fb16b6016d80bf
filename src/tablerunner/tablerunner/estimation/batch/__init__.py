"""Estimators over arrays: many robots or seeds in one call, for Monte Carlo.

Each gives every run what the single estimator of that name gives it. Means have shape (runs, n),
covariances (runs, n, n); in memory the runs lie side by side, so that an operation on one state
of all runs is one sweep.
"""

from tablerunner.estimation.batch.ekf import BatchEkf
from tablerunner.estimation.batch.ekf_cv import BatchEkfCv
from tablerunner.estimation.batch.estimate import BatchEstimate, BatchInnovation
from tablerunner.estimation.batch.follow import BatchFilter, follow
from tablerunner.estimation.batch.kf import follow_kf

__all__ = [
    'BatchEkf',
    'BatchEkfCv',
    'BatchEstimate',
    'BatchFilter',
    'BatchInnovation',
    'follow',
    'follow_kf',
]
