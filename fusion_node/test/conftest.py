"""Fixtures for tests over DDS."""

import pytest

from fusion_node.testing import Fusion
from tablerunner_ros.testing.fixtures import domain, probe, processes, quick_diagnostics
from tablerunner_ros.testing.probe import Probe

__all__ = ['domain', 'probe', 'processes', 'quick_diagnostics']


@pytest.fixture(autouse=True)
def _quick(quick_diagnostics: None) -> None:
    """Report often, in every test of this node."""


@pytest.fixture
def fusion(probe: Probe) -> Fusion:
    """Return a robot at a known start."""
    item = Fusion(probe)
    item.send_odometry()
    item.settled()
    return item
