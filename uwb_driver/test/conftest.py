"""Fixtures for tests over DDS."""

import sys
from pathlib import Path

import pytest

from tablerunner_ros.testing.fixtures import domain, probe, processes, quick_diagnostics

# The emulated devices of the core's tests.
CORE = Path(__file__).parents[2] / 'src' / 'tablerunner' / 'test' / 'uwb'
sys.path += [str(CORE / 'device'), str(CORE / 'protocol')]

__all__ = ['domain', 'probe', 'processes', 'quick_diagnostics']


@pytest.fixture(autouse=True)
def _quick(quick_diagnostics: None) -> None:
    """Report often, in every test of this node."""
