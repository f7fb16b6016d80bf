"""One child process: its own session, its own log file, and an end that cannot be missed."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True, slots=True)
class Command:
    """What to start.

    Attributes
    ----------
    name : str
        Unique among the children; names the log in messages.
    arguments : tuple of str
        Program and arguments.
    log : Path
        File that takes stdout and stderr; its folder must exist.
    environment : mapping or None
        Complete environment of the child; None: that of this process.
    orphan_signal : int
        What the kernel sends the child when this process dies without saying good-bye. SIGKILL
        leaves nothing to chance; a process that must close a file takes SIGTERM.
    """

    name: str
    arguments: tuple[str, ...]
    log: Path
    environment: Mapping[str, str] | None = None
    orphan_signal: int = signal.SIGKILL


@dataclass(frozen=True, slots=True)
class Ending:
    """How a child ended: `code` is its exit code, or minus the signal that killed it."""

    name: str
    code: int
    log: Path

    @property
    def how(self) -> str:
        """The end in words: ``exited with code 3``, ``was killed by SIGKILL``."""
        if self.code >= 0:
            return f'exited with code {self.code}'
        with contextlib.suppress(ValueError):
            return f'was killed by {signal.Signals(-self.code).name}'
        return f'was killed by signal {-self.code}'

    def last_lines(self, count: int = 12) -> list[str]:
        """Return the last lines of the log; empty when there is none."""
        try:
            with self.log.open('rb') as file:
                file.seek(0, os.SEEK_END)
                size = file.tell()
                file.seek(max(0, size - 65536))
                text = file.read().decode('utf-8', 'replace')
        except OSError:
            return []
        return text.splitlines()[-count:]


class Child:
    """A started process.

    It must be started from a thread that lives as long as this process (the main thread): the
    kernel sends `Command.orphan_signal` when the *thread* that started the child ends.

    Raises
    ------
    OSError
        The program cannot be started or the log cannot be written.
    """

    def __init__(self, command: Command) -> None:
        self.command = command
        environment = None if command.environment is None else dict(command.environment)
        with command.log.open('ab') as log:
            self._process = subprocess.Popen(
                command.arguments,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,  # a Ctrl-C in the terminal reaches only the launcher
                preexec_fn=_preparation(command.orphan_signal),
            )
        self._ending: Ending | None = None

    @property
    def name(self) -> str:
        """The name of its command."""
        return self.command.name

    @property
    def pid(self) -> int:
        """Its process id, which is also that of its session and process group."""
        return self._process.pid

    def poll(self) -> Ending | None:
        """Return how it ended, or None while it runs; what it started itself ends with it."""
        if self._ending is None and self._has_ended():
            # Not reaped yet, so nobody else can have got this number as a process group.
            self._signal_group(signal.SIGKILL)
            code = self._process.wait()
            self._ending = Ending(self.name, code, self.command.log)
        return self._ending

    def send(self, number: int) -> None:
        """Send it a signal; nothing happens when it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it and its whole process group at once."""
        if self.poll() is None:
            self._signal_group(signal.SIGKILL)

    def _has_ended(self) -> bool:
        try:
            status = os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        except ChildProcessError:  # somebody reaped it for us
            return True
        return status is not None

    def _signal_group(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)


def _preparation(orphan_signal: int) -> Callable[[], None]:
    """Return what the child does between fork and exec; everything it needs is loaded before."""
    parent = os.getpid()
    libc = ctypes.CDLL(None, use_errno=True)
    prctl = libc.prctl

    def prepare() -> None:
        prctl(_PR_SET_PDEATHSIG, orphan_signal, 0, 0, 0)
        if os.getppid() != parent:  # the launcher died before the line above
            os._exit(1)
        # A launcher started in the background by a shell ignores SIGINT; its nodes must not.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, [])

    return prepare
