"""Run a long command: its output goes to a log file, its end is certain."""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

PATIENCE = 5.0


class CommandError(Exception):
    """A command ended with a non-zero code; `log` holds what it printed."""

    def __init__(self, log: Path) -> None:
        super().__init__(str(log))
        self.log = log


def run(
    command: Sequence[str],
    log: Path,
    folder: Path,
    environ: Mapping[str, str],
    on_line: Callable[[str], None] = lambda _: None,
    keep_open: Sequence[int] = (),
) -> None:
    """Run `command` in `folder`, append its output to `log`, pass each line to `on_line`.

    `on_line` also gets an empty string a few times a second, to keep a clock going. The command
    gets a session of its own, which is ended as a whole when this process is interrupted. File
    descriptors in `keep_open` stay open in it: a lock held there outlives a killed parent for as
    long as the command still writes.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open('ab') as sink:
        sink.write(f'$ {" ".join(command)}\n'.encode())
        sink.flush()
        process = subprocess.Popen(
            list(command),
            cwd=folder,
            env=dict(environ),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            pass_fds=list(keep_open),
        )
        try:
            _follow(process, sink.fileno(), on_line)
            code = process.wait()
        except BaseException:
            _end(process)
            raise
    if code != 0:
        raise CommandError(log)


def tail(log: Path, lines: int = 25) -> str:
    """Return the last lines of a log."""
    text = log.read_text(encoding='utf-8', errors='replace')
    return '\n'.join(text.rstrip().splitlines()[-lines:])


def _follow(process: subprocess.Popen[bytes], sink: int, on_line: Callable[[str], None]) -> None:
    pipe = process.stdout.fileno()  # type: ignore[union-attr]  # it is a pipe, see above
    rest = b''
    with selectors.DefaultSelector() as selector:
        selector.register(pipe, selectors.EVENT_READ)
        while True:
            if not selector.select(timeout=0.3):
                on_line('')
                continue
            chunk = os.read(pipe, 65536)
            if not chunk:
                return
            os.write(sink, chunk)
            *complete, rest = (rest + chunk).split(b'\n')
            for line in complete:
                on_line(line.decode('utf-8', 'replace').rstrip())


def _end(process: subprocess.Popen[bytes]) -> None:
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
        except ProcessLookupError:
            pass
        try:
            process.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            continue
