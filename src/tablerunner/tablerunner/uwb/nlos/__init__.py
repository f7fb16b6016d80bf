"""Tests for ranges that are not line of sight: each gives a probability and a decision."""

from tablerunner.uwb.nlos.range_variance import (
    RangeVariance,
    judge_variance,
    variance_threshold,
)
from tablerunner.uwb.nlos.residual_test import NlosModel, judge_innovation, judge_residuals
from tablerunner.uwb.nlos.signal_quality import judge_signal
from tablerunner.uwb.nlos.verdict import NlosVerdict

__all__ = [
    'NlosModel',
    'NlosVerdict',
    'RangeVariance',
    'judge_innovation',
    'judge_residuals',
    'judge_signal',
    'judge_variance',
    'variance_threshold',
]
