"""Whole runs over DDS: a meal arrives."""

from __future__ import annotations

import json
import sys

import pytest
import yaml

from tablerunner.bags.reader import BagReader
from tablerunner.scenario import Scenario
from tablerunner_bringup.nodes import nodes_of
from tablerunner_bringup.run_options import RunOptions

pytestmark = pytest.mark.slow

LIMIT_S = 280.0
"""Ends a hang; a run takes half a minute, several times that on a busy machine."""

DELIVER = ('--deliver', 'table_1', '--wait', '0.5')
BUSY = """\
name: busy room
walls:
  - {name: hull, closed: true, points: [[0, 0], [9.4, 0], [9.4, 5], [0, 5]]}
boxes:
  - {name: crates, x: 3.4, y: 2.05, length: 0.4, width: 0.5, unmapped: true}
kitchen: {stop: [1.2, 2.5, 0.0]}
tables:
  - {name: table_1, x: 4.8, y: 4.5, length: 0.8, width: 0.6, stop: [4.8, 2.5, 0.0]}
  - {name: table_2, x: 9.0, y: 2.5, length: 0.4, width: 0.6, stop: [8.3, 2.5, 0.0]}
people:
  - {name: guest, route: [[6.9, 2.1]]}
anchors:
  - {id: A0, position: [0.2, 0.2, 2.25]}
  - {id: A1, position: [9.2, 0.2, 2.25]}
  - {id: A2, position: [9.2, 4.8, 2.25]}
  - {id: A3, position: [0.2, 4.8, 2.25]}
"""
RECORDED = ('/odometry/filtered', '/ground_truth', '/uwb/exchanges', '/tf_static', '/uwb/anchors')


def test_launch_delivery_reaches_table_and_home(start, room, domain):
    """The meal arrives, the robot comes home, everything is recorded, nothing is left running."""
    run = start(
        *('--scenario', str(room), *DELIVER, '--record', '--domain', str(domain)), domain=domain
    )
    assert run.wait_end(LIMIT_S) == 0, run.process.output
    assert '2 of 2 stops reached' in run.process.output
    with BagReader(run.folder / 'bag') as bag:
        assert not bag.damage
        counts = {topic.name: topic.count for topic in bag.topics}
        assert all(counts[name] > 0 for name in RECORDED)
        duration_s = (bag.end - bag.start) * 1e-9
        assert counts['/ground_truth'] == pytest.approx(50 * duration_s, rel=0.1)
    for spec in nodes_of(RunOptions(), Scenario(name='room')):
        assert (run.folder / 'logs' / f'{spec.name}.log').exists()
        text = (run.folder / 'params' / f'{spec.name}.yaml').read_text(encoding='utf-8')
        assert yaml.safe_load(text)[f'/**/{spec.name}']['ros__parameters']


def test_launch_two_at_once_do_not_disturb_each_other(start, room):
    """Two runs without a word on domains take one each, and both deliver."""
    arguments = ('--scenario', str(room), *DELIVER, '--stay')
    runs = [start(*arguments, '--seed', str(seed), name=f'run_{seed}') for seed in (1, 2)]
    assert [run.wait_end(LIMIT_S) for run in runs] == [0, 0]
    domains = {run.process.output.partition('ROS domain ')[2].split()[0] for run in runs}
    assert len(domains) == 2


def test_launch_unknown_start_finds_itself_and_delivers(start, room, domain):
    """Without a known pose the robot finds its heading by driving, then delivers."""
    run = start(
        *('--scenario', str(room), *DELIVER, '--stay', '--unknown-start', '--domain', str(domain)),
        domain=domain,
    )
    assert run.wait_end(LIMIT_S) == 0, run.process.output
    assert 'finding its heading' in run.process.output


def test_launch_namespace_delivers(start, room, domain):
    """All names are relative: in a namespace the robot works the same."""
    run = start(
        *(
            '--scenario',
            str(room),
            *DELIVER,
            '--stay',
            '--namespace',
            'robot2',
            '--domain',
            str(domain),
        ),
        domain=domain,
    )
    assert run.wait_end(LIMIT_S) == 0, run.process.output


def demo(processes, room, folder, *arguments):
    """Run the demo to its end; return exit code, output and errors.json."""
    process = processes.start(
        *(sys.executable, '-m', 'tablerunner.cli.main', 'demo', '--scenario', room),
        *('-o', folder, '--domain', str(processes.domain), *arguments),
    )
    code = process.wait(150.0)
    return code, process.output, json.loads((folder / 'errors.json').read_text(encoding='utf-8'))


def test_demo_passes_what_is_in_the_way_and_writes_its_results(processes, tmp_path):
    """Two tables, crates that the map does not know, a guest who stands, an emergency stop."""
    folder, room = tmp_path / 'demo', tmp_path / 'busy.yaml'
    room.write_text(BUSY, encoding='utf-8')
    code, said, errors = demo(processes, room, folder)
    assert code == 0, said
    assert errors['delivered'] is True
    assert errors['failures'] == []
    assert errors['reached'] == ['table_1', 'table_2', 'kitchen']
    assert set(errors['checks']) == {
        'way blocked by crates',
        'guest in the way',
        'emergency stop',
    }
    assert all(check['passed'] for check in errors['checks'].values())
    assert 'emergency stop asked for at' in said
    assert any(halt['emergency'] and halt['duration'] > 2.5 for halt in errors['halts'])
    assert errors['position_error']['compared'] > 500
    assert errors['position_error']['rmse'] < 0.25
    assert (folder / 'trip.png').read_bytes().startswith(b'\x89PNG')
    with BagReader(folder / 'bag') as bag:
        assert not bag.damage


def test_demo_out_of_time_fails_and_says_so(processes, room, tmp_path):
    """A meal that is late is not delivered."""
    code, said, errors = demo(
        processes, room, tmp_path / 'demo', '--table', 'table_1', '--time-limit', '4'
    )
    assert code == 1
    assert 'took too long' in said
    assert errors['delivered'] is False
