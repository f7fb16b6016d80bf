"""From the last byte of a frame on a port to its last range: uwb_driver against a pass-through."""

from __future__ import annotations

import os
import sys
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import rclpy
from protocols import node_frame
from rclpy.context import Context
from rclpy.node import Node
from result import Result, latencies

from tablerunner_interfaces.msg import UwbRange
from tablerunner_ros.executor import make_executor
from tablerunner_ros.qos import qos_for
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.process import Processes

FRAMES = 500
PERIOD_S = 0.02  # a LinkTrack at 50 Hz
NODES = 4
ANCHORS = [(0.0, 0.0, 2.2), (15.0, 0.0, 2.2), (15.0, 15.0, 2.2), (0.0, 15.0, 2.2)]


class Harness:
    """Writes frames to a pseudo-terminal and notes when the last range of each has come."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = Node('bench', context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self._node.create_subscription(
            UwbRange, 'uwb/ranges', self._on_range, qos_for('uwb/ranges', subscriber=True)
        )
        self._master, self._slave = os.openpty()
        tty.setraw(self._master)
        self.path = os.ttyname(self._slave)
        self._begun = time.monotonic()
        self._heard: list[float] = []

    def _on_range(self, _: Any) -> None:
        self._heard.append(time.perf_counter())

    def latency(self) -> float | None:
        """Return how long one frame took [s]; None where not all of its ranges came."""
        self._spin(PERIOD_S)
        self._heard.clear()
        now_ms = round(1000.0 * (time.monotonic() - self._begun))
        frame = node_frame(5, NODES, now_ms)
        begun = time.perf_counter()
        os.write(self._master, frame)
        while time.perf_counter() - begun < 0.5:
            self._executor.spin_once(timeout_sec=0.1)
            if len(self._heard) >= NODES:
                return self._heard[NODES - 1] - begun
        return None

    def _spin(self, duration_s: float) -> None:
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """Leave the domain, and pull the wire."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        os.close(self._slave)
        os.close(self._master)


def run(start: Callable[[Processes, str], Any], frames: int = FRAMES) -> list[float]:
    """Return the latencies [s] through what `start` starts."""
    with tempfile.TemporaryDirectory() as folder, lease_domain() as domain:
        processes = Processes(domain, Path(folder))
        harness = Harness(domain)
        try:
            start(processes, harness.path)
            taken: list[float] = []
            until = time.monotonic() + 90.0
            while len(taken) < 20 + frames:  # the first twenty: discovery, caches
                found = harness.latency()
                if found is not None:
                    taken.append(found)
                if time.monotonic() > until:
                    raise RuntimeError(f'only {len(taken)} frames')
            return taken[20:]
        finally:
            processes.close()
            harness.close()


def ours(frames: int = FRAMES) -> list[float]:
    """Return the latencies of uwb_driver."""

    def start(processes: Processes, path: str) -> None:
        parameters = {
            'device': 'linktrack',
            'serial': {'port': path},
            'anchor_ids': [f'A{k}' for k in range(NODES)],
            'device_ids': [f'anchor{k}' for k in range(NODES)],
            'anchor_positions': [number for place in ANCHORS for number in place],
        }
        processes.node('uwb_driver', 'uwb_driver', parameters)

    return run(start, frames)


def relay(frames: int = FRAMES) -> list[float]:
    """Return the latencies of a node that publishes as many ranges for each read."""

    def start(processes: Processes, path: str) -> None:
        script = str(Path(__file__).with_name('device_relay.py'))
        processes.start(sys.executable, script, path, str(NODES))

    return run(start, frames)


def measure() -> Iterator[Result]:
    """Measure both, in turn, twice: the machine may be busier at one time than at another."""
    own, passed = ours(), relay()
    own += ours()
    passed += relay()
    yield from latencies(
        'device latency',
        own,
        passed,
        f'last byte of a frame to the last of its {NODES} uwb/ranges; reference: a node that '
        'publishes as many for each read',
    )
