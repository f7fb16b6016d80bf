"""Node executables as processes of a test: found as `ros2 run` finds them, and always ended."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

import yaml
from ament_index_python.packages import get_package_prefix

from tablerunner_ros.testing.waiting import LIMIT_S


def executable(package: str, name: str) -> Path:
    """Return the path of a node executable, as `ros2 run` would find it."""
    path = Path(get_package_prefix(package)) / 'lib' / package / name
    if not path.is_file():
        raise FileNotFoundError(f'{package} has no executable {name}: looked for {path}')
    return path


def environment(domain: int) -> dict[str, str]:
    """Return this process's environment with a ROS domain of its own on this machine only."""
    return {
        **os.environ,
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'PYTHONUNBUFFERED': '1',
    }


class Process:
    """A running program whose output is kept and which does not outlive its test."""

    def __init__(self, command: Sequence[str | Path], domain: int) -> None:
        self._output = tempfile.TemporaryFile('w+', encoding='utf-8')  # noqa: SIM115 (closed with it)
        self.command = [str(part) for part in command]
        self._process = subprocess.Popen(
            self.command,
            env=environment(domain),
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # Ctrl-C on the test run must not reach it before us
        )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def output(self) -> str:
        """All that it has written so far to stdout and stderr."""
        self._output.flush()
        return os.pread(self._output.fileno(), 1 << 20, 0).decode('utf-8', 'replace')

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    def wait(self, limit_s: float = LIMIT_S) -> int:
        """Return its exit code; an AssertionError shows its output if it does not end."""
        try:
            return self._process.wait(limit_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(
                f'{self.command[0]} did not end within {limit_s:g} s:\n{self.output}'
            ) from None

    def send(self, number: int) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def end(self, limit_s: float = LIMIT_S) -> int:
        """Ask it to end, wait, and return the exit code; kill it when it does not listen."""
        if self.running:
            self.send(signal.SIGINT)
        try:
            return self.wait(limit_s)
        finally:
            self.kill()

    def kill(self) -> None:
        """End it at once, if it runs."""
        if self.running:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Process:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.kill()
        self._output.close()


class Processes:
    """Starts programs in one domain and ends them all."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.domain = domain
        self._folder = folder
        self._running: list[Process] = []

    def start(self, *command: str | Path) -> Process:
        """Start any program."""
        process = Process(command, self.domain)
        self._running.append(process)
        return process

    def node(
        self,
        package: str,
        name: str,
        parameters: Mapping[str, object] | None = None,
        arguments: Sequence[str] = (),
    ) -> Process:
        """Start a node executable with parameters, given to it by a file as users do."""
        command: list[str | Path] = [executable(package, name)]
        extra = list(arguments)
        if parameters is not None:
            path = self._folder / f'{name}-{len(self._running)}.yaml'
            path.write_text(yaml.safe_dump({'/**': {'ros__parameters': dict(parameters)}}))
            extra += ['--params-file', str(path)]
        if extra:
            command += ['--ros-args', *extra]
        return self.start(*command)

    def close(self) -> None:
        """End what still runs: all are asked first, then waited for."""
        for process in self._running:
            if process.running:
                process.send(signal.SIGINT)
        for process in self._running:
            try:
                process.wait(5.0)
            except AssertionError:
                process.kill()
            process.__exit__(None, None, None)
        self._running.clear()
