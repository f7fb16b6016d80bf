"""A node that is killed and comes back: its deliveries go on; a damaged file ends it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tablerunner_interfaces.msg import Stop
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes


def test_deliveries_survive_a_killed_node(
    probe: Probe, processes: Processes, room: Path, robot: Any, make_customer: Any, tmp_path: Path
) -> None:
    """Killed on the way to its second stop it goes on there, then serves what waited."""
    customer = make_customer(probe)
    parameters = {'scenario': str(room), 'queue_file': str(tmp_path / 'queue.json')}
    first = processes.node('nav_controller', 'nav_controller', parameters)
    probe.wait_for(customer.client.server_is_ready, 'the deliver action')
    # An answer is lost while the server has not found its client: this one comes after it.
    probe.get_parameter('nav_controller', 'scenario')
    customer.send(Stop(table='table_1'), Stop(table='table_2'), queue=True)
    customer.send(Stop(table='table_2'), queue=True)
    probe.wait_for(lambda: any(item.stop == 'table_2' for item in customer.feedback), 'stop 2')
    first.kill()
    second = processes.node('nav_controller', 'nav_controller', parameters)
    probe.wait_for(lambda: 'done: 1 of 1' in second.output, 'both deliveries', 60.0)
    assert '2 deliveries were left over: going on' in second.output
    assert 'done: 2 of 2 stops reached' in second.output
    assert 'reached table_1' not in second.output
    assert second.end() == 0


def test_damaged_queue_file_ends_the_node_and_is_left_alone(
    processes: Processes, room: Path, tmp_path: Path
) -> None:
    path = tmp_path / 'queue.json'
    path.write_text('{"schema": "tablerunner delivery queue", "ver', encoding='utf-8')
    node = processes.node(
        'nav_controller', 'nav_controller', {'scenario': str(room), 'queue_file': str(path)}
    )
    assert node.wait() == 2
    assert f'{path}:1: got' in node.output
    assert 'move it away to begin with an empty queue' in node.output
    assert path.read_text(encoding='utf-8').endswith('"ver')
