"""spin_node in a process of its own: how it ends, with which code and which words."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from tablerunner_ros.testing.fixtures import domain, probe, processes  # noqa: F401
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Process, Processes

PROGRAM = """
import sys, time
from dataclasses import dataclass
from std_msgs.msg import Int32
from rclpy.node import Node
from tablerunner.config import Config, parameter
from tablerunner_ros.clocks import steady_timer
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.spin import spin_node

@dataclass(frozen=True)
class Settings(Config):
    rate: float = parameter(1.0, description='A rate', unit='Hz', above=0.0)
    fault: str = parameter('', description='Which fault to show')

class Sample(Node):
    def __init__(self):
        super().__init__('sample')
        self.config = declare_config(self, Settings)
        self.publisher = self.create_publisher(Int32, 'said', 10)
        if self.config.fault == 'quiet':
            self.create_subscription(Int32, 'heard', lambda message: None, 10)
            self.publisher.publish(Int32(data=1))
            return
        steady_timer(self, 0.05, self.tick)
        if self.config.fault == 'make':
            raise RuntimeError('cannot be made')

    def tick(self):
        if self.config.fault == 'call':
            raise RuntimeError('went wrong')
        if self.config.fault == 'busy':
            time.sleep(0.5)
        self.publisher.publish(Int32(data=1))

    def on_end(self):
        self.publisher.publish(Int32(data=99))

sys.exit(spin_node(Sample))
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    path = tmp_path / 'program.py'
    path.write_text(PROGRAM)
    return path


def run(processes: Processes, program: Path, *arguments: str | Path) -> Process:  # noqa: F811
    return processes.start(sys.executable, program, *arguments)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('fault', ['none', 'busy'])
def test_spin_node_signalled_ends_cleanly_after_a_last_word(
    probe: Probe,  # noqa: F811
    processes: Processes,  # noqa: F811
    program: Path,
    number: int,
    fault: str,
) -> None:
    """Exit code 0, nothing on stderr, and what on_end publishes still arrives."""
    from std_msgs.msg import Int32

    said: list[Int32] = []
    probe.node.create_subscription(Int32, 'said', said.append, 10)
    process = run(processes, program, '--ros-args', '-p', f'fault:={fault}')
    probe.wait_for(lambda: said, 'the node to speak')
    process.send(number)
    probe.wait_for(lambda: not process.running, 'the node to end', 5.0)
    probe.spin(0.1)
    assert process.wait() == 0
    assert process.output == ''
    assert said[-1].data == 99


def test_spin_node_signalled_while_nothing_happens_ends(
    probe: Probe,  # noqa: F811
    processes: Processes,  # noqa: F811
    program: Path,
) -> None:
    """A node that waits for a message that never comes is woken by the signal."""
    process = run(processes, program, '--ros-args', '-p', 'fault:=quiet')
    probe.wait_for(lambda: probe.node.count_subscribers('heard') > 0, 'the node')
    probe.spin(0.2)
    process.send(signal.SIGTERM)
    assert process.wait(5.0) == 0


def test_spin_node_bad_parameter_exits_2_with_one_line(
    processes: Processes,  # noqa: F811
    program: Path,
) -> None:
    """The line names node, parameter, value and what was expected."""
    process = run(processes, program, '--ros-args', '-p', 'rate:=-1.0')
    assert process.wait() == 2
    assert process.output == (
        'parameters of /sample: rate: got -1.0, expected a number above 0 [Hz]\n'
    )


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('sample:\n  ros__parameters:\n    rate: [1.0, 2]\n', 'Sequence should be of same type'),
        ('sample:\n  ros__parameters:\n    rate: [\n', 'Error parsing'),
        (None, 'Error opening YAML file'),
    ],
)
def test_spin_node_broken_parameter_file_exits_2_with_one_line(
    processes: Processes,  # noqa: F811
    program: Path,
    tmp_path: Path,
    text: str | None,
    words: str,
) -> None:
    """A file that cannot be read or parsed is named, in one line."""
    path = tmp_path / 'broken.yaml'
    if text is not None:
        path.write_text(text)
    process = run(processes, program, '--ros-args', '--params-file', path)
    assert process.wait() == 2
    assert len(process.output.splitlines()) == 1
    assert words in process.output
    assert 'broken.yaml' in process.output


def test_spin_node_unknown_option_exits_2(processes: Processes, program: Path) -> None:  # noqa: F811
    """A wrong option is bad input, too."""
    process = run(processes, program, '--ros-args', '--nonsense')
    assert process.wait() == 2
    assert '--nonsense' in process.output


def test_spin_node_unknown_parameter_is_warned_of(
    probe: Probe,  # noqa: F811
    processes: Processes,  # noqa: F811
    program: Path,
) -> None:
    """A slip in a parameter's name is said and does not stop the node."""
    process = run(processes, program, '--ros-args', '-p', 'rte:=1.0')
    probe.wait_for(lambda: 'parameter rte is not known' in process.output, 'the warning')
    assert process.end() == 0


@pytest.mark.parametrize(('fault', 'words'), [('make', 'cannot be made'), ('call', 'went wrong')])
def test_spin_node_exception_exits_1_with_traceback(
    processes: Processes,  # noqa: F811
    program: Path,
    fault: str,
    words: str,
) -> None:
    """An error that nobody foresaw is shown in full."""
    process = run(processes, program, '--ros-args', '-p', f'fault:={fault}')
    assert process.wait() == 1
    assert 'Traceback' in process.output
    assert words in process.output
