"""A run whose processes are killed: the robot stands, the run ends and says why."""

from __future__ import annotations

import signal
from pathlib import Path

import psutil
import pytest
from nav_msgs.msg import Odometry

from tablerunner.bags.reader import BagReader
from tablerunner.scenario import Scenario
from tablerunner.types import NANOSECONDS
from tablerunner_bringup.nodes import nodes_of
from tablerunner_bringup.run_options import RunOptions

pytestmark = pytest.mark.slow

RUNNING = nodes_of(RunOptions(), Scenario(name='room'))
"""The nodes of a run in a room without a camera or a person with a tag."""

STANDING = 0.02
"""Below this [m/s] the robot stands."""


def stamp(message: Odometry) -> int:
    """Return the stamp of a message [ns]."""
    return message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec


@pytest.mark.parametrize('name', [spec.name for spec in RUNNING])
def test_run_node_killed_robot_stands_and_run_says_why(driving, probe, name):
    """Within a second of measurement time the robot stands; the run fails and names the node."""
    run, truth = driving
    victim = run.family()[name]
    probe.spin(0.1)
    killed_at = stamp(truth[-1])
    victim.send_signal(signal.SIGKILL)
    if name != 'sim_bridge':  # whose end is the end of the robot
        probe.wait_for(
            lambda: abs(truth[-1].twist.twist.linear.x) < STANDING, 'the robot to stand', 5.0
        )
        moving = [stamp(m) for m in truth if abs(m.twist.twist.linear.x) >= STANDING]
        took_s = (moving[-1] - killed_at) / NANOSECONDS
        print(f'stood {took_s:.2f} s after {name} was killed')
        assert took_s < 1.0
    assert run.wait_end() == 1
    said = run.process.output
    assert f'{name} was killed by SIGKILL' in said
    assert str(run.folder / 'logs' / f'{name}.log') in said
    with BagReader(run.folder / 'bag') as bag:
        assert not bag.damage


def test_run_interrupted_leaves_no_process(driving):
    """Ctrl-C ends every process; the delivery is not done, which the exit code says."""
    run, _ = driving
    assert len(run.family()) == len(RUNNING) + 1
    run.process.send(signal.SIGINT)
    assert run.wait_end(30.0) == 1
    assert 'SIGINT' in run.process.output
    with BagReader(run.folder / 'bag') as bag:
        assert not bag.damage


def test_run_launcher_killed_leaves_no_process(driving):
    """Also when the launcher itself is killed, all ends, and the bag can be read."""
    run, _ = driving
    family = run.family()
    run.process.kill()
    run.wait_gone(family, 15.0)
    with BagReader(run.folder / 'bag') as bag:
        assert bag.message_count > 500


def test_run_node_cannot_start_is_named(start, room, domain):
    """A parameter that a node refuses ends the run before it is up, with the node's own words."""
    bad = Path(room).with_name('bad.yaml')
    bad.write_text('/**/fusion_node:\n  ros__parameters: {history: -1.0}\n', encoding='utf-8')
    run = start('--scenario', str(room), '--params', str(bad), domain=domain)
    assert run.wait_end() == 1
    said = run.process.output
    assert 'fusion_node exited with code 2' in said
    assert 'history' in said


def test_run_bad_scenario_starts_nothing(start, room, domain):
    """A table that does not exist is refused before a process is started."""
    run = start('--scenario', str(room), '--deliver', 'table_99', domain=domain)
    assert run.process.wait(30.0) == 2
    assert 'table_99' in run.process.output
    assert 'table_1' in run.process.output
    assert not run.folder.exists()
    assert not psutil.pid_exists(run.process.pid)
