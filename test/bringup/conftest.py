"""A small quiet room and a launcher in it, for tests of whole runs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from nav_msgs.msg import Odometry

from tablerunner_bringup.nodes import NODES
from tablerunner_ros.testing.fixtures import domain, probe, processes
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Process
from tablerunner_ros.testing.waiting import wait_for

__all__ = ['domain', 'probe', 'processes']

ROOM = """\
name: room
walls:
  - {name: hull, closed: true, points: [[0, 0], [8, 0], [8, 5], [0, 5]]}
kitchen: {stop: [1.5, 2.5, 0.0]}
tables:
  - {name: table_1, x: 5.0, y: 3.9, stop: [5.0, 2.7, 0.0]}
anchors:
  - {id: A0, position: [0.2, 0.2, 2.25]}
  - {id: A1, position: [7.8, 0.2, 2.25]}
  - {id: A2, position: [7.8, 4.8, 2.25]}
  - {id: A3, position: [0.2, 4.8, 2.25]}
"""
UP_LIMIT_S = 60.0
DRIVING_M_S = 0.57


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """Return the scenario file of a room in which nobody walks."""
    path = tmp_path / 'room.yaml'
    path.write_text(ROOM, encoding='utf-8')
    return path


class Run:
    """A launcher started by a test."""

    def __init__(self, process: Process, folder: Path) -> None:
        self.process = process
        self.folder = folder

    def family(self) -> dict[str, psutil.Process]:
        """Return the processes of the run by name, the recorder's included."""
        found = {}
        for child in psutil.Process(self.process.pid).children(recursive=True):
            try:
                words = child.cmdline()
            except psutil.Error:  # ended meanwhile
                continue
            for spec in NODES:
                if any(word.endswith(f'/{spec.package}/{spec.executable}') for word in words):
                    found[spec.name] = child
            if 'record' in words:
                found['recorder'] = child
        return found

    def wait_end(self, limit_s: float = 60.0) -> int:
        """Wait for the end; no process of the run may be left then."""
        family = self.family() if self.process.running else {}
        code = self.process.wait(limit_s)
        self.wait_gone(family, 2.0)
        return code

    def wait_gone(self, family: dict[str, psutil.Process], limit_s: float) -> None:
        """Wait until none of some processes runs."""
        wait_for(lambda: not any(map(is_alive, family.values())), 'the end of all', limit_s)


def is_alive(process: psutil.Process) -> bool:
    """Return whether a process runs; one that only waits to be reaped does not."""
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """Return a starter of `tablerunner launch`; what runs at the end of the test is killed."""
    runs: list[Run] = []

    def launch(*arguments: str, domain: int = 0, name: str = 'run') -> Run:
        folder = tmp_path / name
        command = [sys.executable, '-m', 'tablerunner.cli.main', 'launch', '-o', str(folder)]
        run = Run(Process([*command, *arguments], domain), folder)
        runs.append(run)
        return run

    yield launch
    for run in runs:
        family = list(run.family().values()) if run.process.running else []
        run.process.__exit__(None, None, None)
        for process in family:
            if is_alive(process):
                process.kill()


@pytest.fixture
def driving(
    start: Callable[..., Run],
    room: Path,
    domain: int,
    probe: Probe,
) -> tuple[Run, list[Odometry]]:
    """Return a run whose robot is on its way at speed, and the list of its true movements."""
    truth = probe.listen(Odometry, 'ground_truth')
    run = start(
        *('--scenario', str(room), '--deliver', 'table_1', '--record', '--domain', str(domain)),
        domain=domain,
    )
    probe.wait_for(
        lambda: truth and truth[-1].twist.twist.linear.x > DRIVING_M_S,
        f'the robot to drive; the launcher says:\n{run.process.output}',
        UP_LIMIT_S,
    )
    return run, truth
