"""Commands of the set-up: their output, their failure, their end."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from bootstrap import lock, process


def run(code: str, tmp_path: Path, lines: list[str]) -> None:
    command = [sys.executable, '-S', '-c', code]
    process.run(command, tmp_path / 'log', tmp_path, os.environ, lines.append)


def test_run_logs_and_passes_every_line(tmp_path: Path) -> None:
    lines: list[str] = []
    run('print("one"); print("two")', tmp_path, lines)
    assert [line for line in lines if line] == ['one', 'two']
    assert process.tail(tmp_path / 'log', 2) == 'one\ntwo'


def test_run_of_failing_command_names_the_log(tmp_path: Path) -> None:
    with pytest.raises(process.CommandError) as caught:
        run('import sys; sys.exit("broken")', tmp_path, [])
    assert 'broken' in process.tail(caught.value.log)


def test_run_interrupted_ends_the_command_and_its_children(tmp_path: Path) -> None:
    """A Ctrl-C leaves no pip or compiler running."""
    code = (
        'import subprocess, sys, time\n'
        'child = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(60)"])\n'
        'print(child.pid, flush=True); time.sleep(60)\n'
    )
    pids: list[int] = []

    def on_line(line: str) -> None:
        if line:
            pids.append(int(line))
            raise KeyboardInterrupt

    command = [sys.executable, '-S', '-c', code]
    with pytest.raises(KeyboardInterrupt):
        process.run(command, tmp_path / 'log', tmp_path, os.environ, on_line)
    deadline = time.monotonic() + 5
    while _is_running(pids[0]):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_lock_makes_the_second_wait(tmp_path: Path) -> None:
    waited = threading.Event()
    order = []

    def second() -> None:
        with lock.held(tmp_path, waited.set):
            order.append('second')

    with lock.held(tmp_path, lambda: None):
        thread = threading.Thread(target=second)
        thread.start()
        assert waited.wait(5)
        order.append('first')
    thread.join(5)
    assert order == ['first', 'second']


def test_lock_is_released_when_its_holder_is_killed(tmp_path: Path) -> None:
    code = (
        'import fcntl, os, sys, time\n'
        f'fcntl.flock(os.open({str(tmp_path)!r}, os.O_RDONLY), fcntl.LOCK_EX)\n'
        'print("held", flush=True); time.sleep(60)\n'
    )
    command = [sys.executable, '-S', '-c', code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == 'held\n'
        holder.send_signal(signal.SIGKILL)
        with lock.held(tmp_path, lambda: None):
            pass


def _is_running(pid: int) -> bool:
    try:
        return Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()[0] != 'Z'
    except (FileNotFoundError, ProcessLookupError):
        return False
