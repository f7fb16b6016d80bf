"""Fixtures for tests over DDS."""

import pytest

from tablerunner_ros.testing.fixtures import domain, probe, processes, quick_diagnostics

__all__ = ['domain', 'probe', 'processes', 'quick_diagnostics']


@pytest.fixture(autouse=True)
def _quick(quick_diagnostics: None) -> None:
    """Report often, in every test of this node."""
