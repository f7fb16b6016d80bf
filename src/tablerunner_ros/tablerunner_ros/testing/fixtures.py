"""pytest fixtures: a domain, a probe in it, and processes in it; all end with the test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes


@pytest.fixture
def domain() -> Iterator[int]:
    """Return a ROS domain id that no other test uses meanwhile."""
    with lease_domain() as number:
        yield number


@pytest.fixture
def probe(domain: int) -> Iterator[Probe]:
    """Return a node of the test's own in the domain."""
    item = Probe(domain)
    yield item
    item.close()


@pytest.fixture
def processes(domain: int, tmp_path: Path) -> Iterator[Processes]:
    """Return a starter of processes in the domain; what runs at the end is ended."""
    item = Processes(domain, tmp_path)
    yield item
    item.close()


@pytest.fixture
def quick_diagnostics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nodes in this process report ten times a second, so that tests wait less."""
    monkeypatch.setattr('tablerunner_ros.diagnostics.PERIOD_S', 0.1)
