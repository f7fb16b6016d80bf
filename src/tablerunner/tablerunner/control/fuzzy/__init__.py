"""Fuzzy control: Mamdani inference on rule bases from YAML, and the controllers that use it."""

from tablerunner.control.fuzzy.base_file import base_names, base_path, load_base, read_base
from tablerunner.control.fuzzy.membership import (
    Gaussian,
    Membership,
    Trapezoid,
    left_shoulder,
    right_shoulder,
    triangle,
)
from tablerunner.control.fuzzy.models import corner_model, speed_model
from tablerunner.control.fuzzy.reactive import ReactiveConfig, ReactiveController, ReactiveStep
from tablerunner.control.fuzzy.readings import SENSORS, Readings, UltrasonicRing
from tablerunner.control.fuzzy.rule_base import Rule, RuleBase
from tablerunner.control.fuzzy.trace import Fired, Trace, TracedInput
from tablerunner.control.fuzzy.track_keeper import TrackConfig, TrackKeeper, TrackStep
from tablerunner.control.fuzzy.variable import FuzzySet, Variable

__all__ = [
    'SENSORS',
    'Fired',
    'FuzzySet',
    'Gaussian',
    'Membership',
    'ReactiveConfig',
    'ReactiveController',
    'ReactiveStep',
    'Readings',
    'Rule',
    'RuleBase',
    'Trace',
    'TracedInput',
    'TrackConfig',
    'TrackKeeper',
    'TrackStep',
    'Trapezoid',
    'UltrasonicRing',
    'Variable',
    'base_names',
    'base_path',
    'corner_model',
    'left_shoulder',
    'load_base',
    'read_base',
    'right_shoulder',
    'speed_model',
    'triangle',
]
