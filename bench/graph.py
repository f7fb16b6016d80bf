"""The whole graph on a delivery round, for watching its processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

NODES = ('uwb_driver', 'odom_node', 'fusion_node', 'safety_stop', 'nav_controller', 'sim_bridge')
_STOPS = ('table_1', 'table_3', 'table_9', 'table_4')


@contextmanager
def running(
    real_time_factor: float, stops: tuple[str, ...] = _STOPS
) -> Iterator[dict[str, psutil.Process]]:
    """Run `tablerunner launch` on a long round; yield its nodes by name once all are up."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, '-m', 'tablerunner.cli.main', 'launch', '-o', f'{folder}/run']
        command += ['--real-time-factor', str(real_time_factor)]
        for stop in stops:
            command += ['--deliver', stop]
        with (Path(folder) / 'log').open('w') as log:
            process = subprocess.Popen(command, stdout=log, stderr=log, env=dict(os.environ))
        try:
            yield _nodes(process.pid)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)


def _nodes(launcher: int) -> dict[str, psutil.Process]:
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        found = {}
        for child in psutil.Process(launcher).children(recursive=True):
            for part in child.cmdline():
                if Path(part).name in NODES:
                    found[Path(part).name] = child
        if len(found) == len(NODES):
            return found
        time.sleep(0.2)
    raise RuntimeError('the nodes did not come up')
