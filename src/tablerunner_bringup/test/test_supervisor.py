"""The supervisor against processes that behave badly."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tablerunner_bringup.child import Command
from tablerunner_bringup.supervisor import StopLimits, Supervisor

LIMITS = StopLimits(interrupt_s=0.5, terminate_s=0.3, kill_s=5.0)


def wait_until(condition: Callable[[], object], limit_s: float = 10.0) -> None:
    """Wait for a condition; fail when it does not come."""
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, 'the condition did not come true in time'
        time.sleep(0.01)


def alive(pid: int) -> bool:
    """Return whether a process runs (a zombie does not)."""
    try:
        state = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()[0]
    except OSError:
        return False
    return state != 'Z'


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., Command]:
    """Return a maker of commands that run a piece of Python."""

    def make(name: str, code: str, **more: object) -> Command:
        script = tmp_path / f'{name}.py'
        script.write_text(textwrap.dedent(code), encoding='utf-8')
        arguments = (sys.executable, '-S', '-u', str(script))
        return Command(name, arguments, tmp_path / f'{name}.log', **more)  # type: ignore[arg-type]

    return make


@pytest.fixture
def supervisor() -> Iterator[Supervisor]:
    """Return a supervisor with short limits that is cleaned up."""
    with Supervisor(LIMITS) as family:
        yield family


READY = "print('ready', flush=True)\n"
SLEEP = READY + 'import time\ntime.sleep(60)\n'


def started(family: Supervisor, command: Command) -> int:
    """Start a command, wait until it says ready, return its pid."""
    child = family.start(command)
    wait_until(lambda: b'ready' in command.log.read_bytes())
    return child.pid


def test_supervisor_child_exits_reports_code_and_last_lines(supervisor, command):
    """A child that ends by itself is reported once, with its code and the end of its log."""
    supervisor.start(
        command('short', "import sys\nfor i in range(50): print('line', i)\nsys.exit(3)")
    )
    found: list = []
    wait_until(lambda: found.extend(supervisor.ended()) or found)
    assert found[0].name == 'short'
    assert found[0].how == 'exited with code 3'
    assert found[0].last_lines(2) == ['line 48', 'line 49']
    assert supervisor.ended() == ()


def test_supervisor_child_killed_names_signal(supervisor, command):
    """A child that is killed from outside is reported with the name of the signal."""
    pid = started(supervisor, command('victim', SLEEP))
    os.kill(pid, signal.SIGKILL)
    found: list = []
    wait_until(lambda: found.extend(supervisor.ended()) or found)
    assert found[0].how == 'was killed by SIGKILL'


def test_supervisor_stop_obedient_child_ends_by_interrupt(supervisor, command):
    """SIGINT alone ends a child that obeys, and such an end is not reported as a failure."""
    started(supervisor, command('good', SLEEP))
    (ending,) = supervisor.stop()
    assert ending.code == -signal.SIGINT or ending.code == 1
    assert supervisor.ended() == ()
    assert supervisor.running == ()


@pytest.mark.parametrize(
    ('ignored', 'expected'),
    [((signal.SIGINT,), -signal.SIGTERM), ((signal.SIGINT, signal.SIGTERM), -signal.SIGKILL)],
)
def test_supervisor_stop_stubborn_child_is_forced(supervisor, command, ignored, expected):
    """A child that hangs on SIGINT gets SIGTERM, and one that ignores that too is killed."""
    deaf = ''.join(
        f'import signal\nsignal.signal({int(number)}, signal.SIG_IGN)\n' for number in ignored
    )
    pid = started(supervisor, command('stubborn', deaf + SLEEP))
    begun = time.monotonic()
    (ending,) = supervisor.stop()
    assert ending.code == expected
    assert time.monotonic() - begun < LIMITS.interrupt_s + LIMITS.terminate_s + 1.0
    assert not alive(pid)


def test_supervisor_stop_hurried_kills_at_once(supervisor, command):
    """A second Ctrl-C does not wait for the limits."""
    family = Supervisor(StopLimits(30.0, 30.0))
    code = f'import signal\nsignal.signal({int(signal.SIGINT)}, signal.SIG_IGN)\n' + SLEEP
    started(family, command('slow', code))
    begun = time.monotonic()
    family.stop(hurry=lambda: True)
    assert time.monotonic() - begun < 5.0
    assert family.running == ()


def test_supervisor_stop_named_leaves_others_running(supervisor, command):
    """Only the children that were named are ended."""
    started(supervisor, command('first', SLEEP))
    started(supervisor, command('second', SLEEP))
    supervisor.stop(['first', 'unknown'])
    assert supervisor.running == ('second',)


def test_supervisor_chatty_child_does_not_block(supervisor, command):
    """Much output goes to the log without anybody reading it."""
    chatty = command('chatty', "for _ in range(40): print('x' * 100_000)\n")
    supervisor.start(chatty)
    found: list = []
    wait_until(lambda: found.extend(supervisor.ended()) or found)
    assert found[0].code == 0
    assert chatty.log.stat().st_size > 4_000_000
    assert found[0].last_lines(1)[0].startswith('xxx')


GRANDCHILD = """
    import subprocess, sys, time
    inner = subprocess.Popen([sys.executable, '-S', '-c', 'import time; time.sleep(60)'])
    print('pid', inner.pid, flush=True)
    print('ready', flush=True)
    {rest}
"""


@pytest.mark.parametrize('rest', ['sys.exit(0)', 'time.sleep(60)'])
def test_supervisor_grandchild_ends_with_its_parent(supervisor, command, rest):
    """What a child started itself does not outlive it, whether it ended or was ended."""
    parent = command('parent', GRANDCHILD.format(rest=rest))
    started(supervisor, parent)
    inner = int(parent.log.read_text(encoding='utf-8').split()[1])
    if 'sleep' in rest:
        assert alive(inner)
        supervisor.stop()
    wait_until(lambda: supervisor.running == ())
    wait_until(lambda: not alive(inner))


def test_supervisor_same_name_twice_is_refused(supervisor, command):
    """Two children of one name would share a log: refused."""
    supervisor.start(command('twin', SLEEP))
    with pytest.raises(ValueError, match='twin'):
        supervisor.start(command('twin', SLEEP))


def test_child_ignored_interrupt_is_not_inherited(supervisor, command):
    """A launcher in the background ignores SIGINT; its children still obey it."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        started(supervisor, command('child', SLEEP))
        (ending,) = supervisor.stop()
    finally:
        signal.signal(signal.SIGINT, before)
    assert ending.code in {1, -signal.SIGINT}


LAUNCHER = """
    import sys, time
    from pathlib import Path
    from tablerunner_bringup.child import Command
    from tablerunner_bringup.supervisor import Supervisor

    family = Supervisor()
    code = ('import signal, time\\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\\n'
            'signal.signal(signal.SIGTERM, signal.SIG_IGN)\\ntime.sleep(60)')
    for name in ('a', 'b'):
        arguments = (sys.executable, '-S', '-c', code)
        child = family.start(Command(name, arguments, Path(name + '.log')))
        print(child.pid, flush=True)
    time.sleep(60)
"""


def test_supervisor_killed_itself_takes_children_along(tmp_path):
    """When the launcher is killed without warning, even deaf children end."""
    launcher = subprocess.Popen(
        [sys.executable, '-c', textwrap.dedent(LAUNCHER)],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert launcher.stdout is not None
        pids = [int(launcher.stdout.readline()) for _ in range(2)]
        assert all(alive(pid) for pid in pids)
    finally:
        launcher.kill()
        launcher.communicate()
    wait_until(lambda: not any(alive(pid) for pid in pids))
