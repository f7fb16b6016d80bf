"""The command: exit codes, messages, files, and commands of other packages."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from tablerunner.bags import messages
from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.writer import BagWriter
from tablerunner.cli import main as cli
from tablerunner.cli.replay_options import parse_start
from tablerunner.errors import ConfigError, PlanningError
from tablerunner.types import RangeSample, WheelSample

INPUT = """\
range2 0.1 1.5 0.01 0.0 0.0 105 0
range2 0.2 2.5 0.01 2.0 0.0 107 0
range2 0.3 1.4 0.01 0.0 2.0 108 0
odom2diff 0.1 0.2 0.4 0 0.08 0.0001 0.0001 0.0001
odom2diff 0.3 0.4 0.4 0 0.08 0.0001 0.0001 0.0001
"""


@pytest.fixture(autouse=True)
def only_own_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the commands of other packages away."""
    monkeypatch.setattr(cli, 'entry_points', lambda group: [])


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """Return a folder with a tiny labyrinth recording."""
    folder = tmp_path / 'source'
    folder.mkdir()
    (folder / 'Indoor_UWB_Input.txt').write_text(INPUT)
    (folder / 'Indoor_UWB_GT.txt').write_text('point2 0.1 1.0 2.0 0 0 0 0\n')
    return folder


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Return a bag of a robot that drives a circle between three anchors, with its scenario."""
    import math

    path = tmp_path / 'bag'
    places = {'A0': (0.0, 0.0), 'A1': (8.0, 0.0), 'A2': (0.0, 8.0), 'A3': (8.0, 8.0)}
    with BagWriter(path) as writer:
        for topic in ('joint_states', 'uwb/ranges'):
            writer.add_topic(topic, CONTRACT[topic].msgtype)
        for step in range(1, 1500):
            stamp = step * 20_000_000
            turn = 0.004 * step
            left, right = (0.012 - 0.004 * 0.17) * step, (0.012 + 0.004 * 0.17) * step
            wheels = WheelSample(stamp, left / 0.06, right / 0.06)
            writer.write(
                'joint_states',
                stamp,
                messages.wheels_message(wheels, 'left_wheel_joint', 'right_wheel_joint'),
            )
            if step % 2 == 0:
                name = f'A{step // 2 % 4}'
                x, y = 4.0 + 3.0 * math.sin(turn), 1.0 + 3.0 * (1.0 - math.cos(turn))
                distance = math.hypot(x - places[name][0], y - places[name][1])
                sample = RangeSample(stamp, name, 'tag', step, distance, 0.01)
                writer.write('uwb/ranges', stamp, messages.range_message(sample, 'uwb_tag'))
    (path / 'scenario.yaml').write_text(
        'name: flat\nrobot: {tag_position: [0.0, 0.0, 0.0], ultrasonics: []}\nanchors:\n'
        + ''.join(
            f'- {{id: {name}, position: [{x}, {y}, 0.0]}}\n' for name, (x, y) in places.items()
        )
    )
    return path


def test_help_names_every_command_and_starts_fast() -> None:
    """Without numpy, scipy or matplotlib: a shell completes and helps at once."""
    code = (
        'import sys\n'
        'from tablerunner.cli.main import main\n'
        "main(['--help'])\n"
        "heavy = [name for name in ('numpy', 'scipy', 'matplotlib', 'rosbags') "
        'if name in sys.modules]\n'
        'sys.exit(len(heavy))\n'
    )
    begun = time.perf_counter()
    path = os.pathsep.join([str(Path(cli.__file__).parents[2]), os.environ.get('PYTHONPATH', '')])
    done = subprocess.run(
        [sys.executable, '-c', code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, 'PYTHONPATH': path},
    )
    took = time.perf_counter() - begun
    assert done.returncode == 0, done.stderr
    for name in ('replay', 'info', 'plot', 'convert', 'tune'):
        assert name in done.stdout
    assert took < 10.0  # half a second alone; other tests run beside it


@pytest.mark.parametrize('command', ['replay', 'info', 'plot', 'convert labyrinth', 'tune'])
def test_every_command_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*command.split(), '--help']) == 0
    assert f'Example: tablerunner {command}' in capsys.readouterr().out


def test_convert_then_info_then_replay(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / 'out' / 'bag'
    assert cli.main(['convert', 'labyrinth', str(source), str(target), '--format', 'sqlite3']) == 0
    assert '3 ranges of 3 anchors' in capsys.readouterr().out
    assert cli.main(['info', str(target), '--deep', '--json', str(tmp_path / 'info.json')]) == 0
    assert '/uwb/ranges' in capsys.readouterr().out
    content = json.loads((tmp_path / 'info.json').read_text())
    assert content['topics']['/joint_states'] == {
        'type': 'sensor_msgs/msg/JointState',
        'messages': 2,
    }
    # Three ranges do not tell where the robot is: the job was tried and failed.
    assert cli.main(['replay', str(target)]) == 1
    assert 'never initialised' in capsys.readouterr().out


def test_replay_writes_the_promised_figures(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, picture = tmp_path / 'replay.json', tmp_path / 'trip.png'
    code = cli.main(['replay', str(bag), '--json', str(file), '--plot', str(picture)])
    captured = capsys.readouterr()
    assert code == 0
    assert 'uwb/ranges' in captured.out
    assert 'times real time' in captured.out
    content = json.loads(file.read_text())
    assert {'rmse', 'mean', 'max', 'final', 'accepted', 'nis', 'data_seconds', 'seconds'} <= set(
        content
    )
    assert content['estimator'] == 'ekf'
    assert content['rmse'] is None  # no truth in this bag
    assert content['accepted']['uwb/ranges'] > 0.9
    assert content['data_seconds'] == pytest.approx(29.96)
    assert picture.stat().st_size > 10_000


def test_replay_start_is_used(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / 'replay.json'
    arguments = ['replay', str(bag), '--start', '4.0,1.0,0.0', '--json', str(file)]
    assert cli.main(arguments) == 0
    assert json.loads(file.read_text())['initialised_after'] == pytest.approx(0.0)


def test_plot_writes_a_picture(bag: Path, tmp_path: Path) -> None:
    assert cli.main(['plot', str(bag), '-o', str(tmp_path / 'a' / 'trip.png')]) == 0
    assert (tmp_path / 'a' / 'trip.png').stat().st_size > 10_000


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['replay', '{tmp}/missing'], 'there is no bag at'),
        (['info', '{tmp}/missing'], 'there is no bag at'),
        (['plot', '{tmp}/missing'], 'there is no bag at'),
        (['replay', '{bag}', '--estimator', 'magic'], "estimator: got 'magic', expected one of"),
        (['replay', '{bag}', '--estimator', 'ekf,magic'], 'pf_iekf, pf_uiekf, all'),
        (['replay', '{bag}', '--estimator', 'kf', '--smooth'], "--smooth: got 'kf', expected one"),
        (['replay', '{bag}', '--estimator', 'all', '--plot', '{tmp}/x.png'], 'one estimator'),
        (['tune', '{tmp}/missing'], 'there is no bag at'),
        (['tune', '{bag}', '--estimator', 'kf'], "--estimator: got 'kf', expected ekf or ukf"),
        (['tune', '{bag}', '--out', '{bag}/scenario.yaml'], 'a file that does not exist yet'),
        (['tune', '{bag}', '--out', '{tmp}/x.json'], 'a name that ends with .yaml'),
        (['replay', '{bag}', '--start', '1,2'], "--start: got '1,2', expected X,Y,YAW"),
        (['replay', '{bag}', '--scenario', '{tmp}/no.yaml'], 'a readable file'),
        (['replay', '{bag}', '--namespace', 'robot2'], 'in namespace robot2'),
        (['replay', '{bag}', '--json', '{bag}/metadata.yaml/x'], 'a file that can be written'),
        (['convert', 'labyrinth', '{tmp}', '{tmp}/x'], 'Indoor_UWB_Input.txt'),
        (['convert', 'labyrinth', '{source}', '{bag}'], 'exists already'),
        (['convert', 'labyrinth', '{source}', '{tmp}/y', '--format', 'z'], "storage 'z'"),
    ],
)
def test_bad_input_is_one_sentence_on_stderr_and_exit_code_2(
    arguments: list[str],
    message: str,
    bag: Path,
    source: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = {'tmp': tmp_path, 'bag': bag, 'source': source}
    assert cli.main([argument.format(**names) for argument in arguments]) == 2
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if line.startswith('tablerunner: ')]
    assert len(lines) == 1
    assert message in lines[0]
    assert 'Traceback' not in captured.err


def test_unknown_command_is_bad_input() -> None:
    assert cli.main(['fly']) == 2
    assert cli.main(['replay']) == 2


def test_commands_of_other_packages_join(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One works, one cannot be imported: the others are not hurt by it."""

    def hello() -> None:
        """Say hello."""
        raise PlanningError('the door is shut')

    good = EntryPoint('hello', 'x:y', cli.GROUP)
    monkeypatch.setattr(EntryPoint, 'load', lambda self: _load(self, hello))
    bad = EntryPoint('launch', 'no_such_package:launch', cli.GROUP)
    monkeypatch.setattr(cli, 'entry_points', lambda group: [good, bad])
    assert cli.main(['--help']) == 0
    assert 'hello' in capsys.readouterr().out
    assert cli.main(['hello']) == 1
    assert capsys.readouterr().err == 'tablerunner: the door is shut\n'
    assert cli.main(['launch']) == 2
    assert 'source ./env.sh' in capsys.readouterr().err


def _load(entry: EntryPoint, command: object) -> object:
    if entry.name == 'hello':
        return command
    raise ModuleNotFoundError("No module named 'rclpy'")


@pytest.mark.parametrize('text', ['1,2', '1,2,x', '1,2,nan', 'a', '1,2,3,4', '1;2;3'])
def test_parse_start_malformed_raises(text: str) -> None:
    with pytest.raises(ConfigError, match='three numbers'):
        parse_start(text)


def test_parse_start_reads_three_numbers() -> None:
    assert parse_start('1, -2.5,3e-1') == (1.0, -2.5, 0.3)
    assert parse_start('') == ()
