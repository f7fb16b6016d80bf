"""One run of the whole robot: start every node, watch, and end all of them in a safe order."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from rclpy.node import Node

from tablerunner.cli.console import Progress
from tablerunner.errors import TablerunnerError
from tablerunner.scenario import Scenario
from tablerunner.types import NANOSECONDS
from tablerunner_bringup import domains, parameters
from tablerunner_bringup.child import Command, Ending
from tablerunner_bringup.executables import find_executable
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.large_messages import allow_large_messages
from tablerunner_bringup.monitor import Monitor
from tablerunner_bringup.nodes import COMMANDING, NodeSpec, nodes_of
from tablerunner_bringup.polling import bare_node
from tablerunner_bringup.run_folder import RunFolder
from tablerunner_bringup.run_options import RunOptions
from tablerunner_bringup.supervisor import StopLimits, Supervisor

RECORDER = 'recorder'
_TICK_S = 0.02
_UP_LIMIT_S = 60.0
_STAND_LIMIT_S = 3.0
_LIMITS = StopLimits(interrupt_s=5.0, terminate_s=2.0)


class NodeEndedError(TablerunnerError):
    """A node ended by itself; `ending` says how."""

    def __init__(self, ending: Ending) -> None:
        self.ending = ending
        super().__init__(f'{ending.name} {ending.how}')


class NotUpError(TablerunnerError):
    """Nodes did not come up in time."""


class InterruptedRunError(TablerunnerError):
    """The run was asked to end."""


@dataclass(frozen=True)
class SessionSettings:
    """What of a run does not reach the nodes."""

    record: bool = False
    record_topics: tuple[str, ...] = ()
    domain: int | None = None
    parameter_files: tuple[Path, ...] = ()
    remap: tuple[str, ...] = ()  # rules of ROS, OLD:=NEW, for every node
    up_limit_s: float = _UP_LIMIT_S


class Session:
    """A context manager: entered, all nodes are up; left, no process is.

    Raises
    ------
    ExecutableError, DomainError, OSError
        Something to start with is missing.
    NodeEndedError
        A node ended by itself, at the start or later (from `tick`).
    NotUpError, InterruptedRunError
        While starting.
    """

    def __init__(
        self,
        scenario: Scenario,
        options: RunOptions,
        folder: RunFolder,
        progress: Progress,
        interrupts: Interrupts,
        settings: SessionSettings | None = None,
    ) -> None:
        self.folder = folder
        self.monitor: Monitor
        self._scenario = scenario
        self._options = options
        self._settings = settings or SessionSettings()
        self._progress = progress
        self._interrupts = interrupts
        self._supervisor = Supervisor(_LIMITS)
        self._specs = nodes_of(options, scenario)
        self._stack = contextlib.ExitStack()
        self._domain: int | None = None
        self._up_at = time.monotonic()
        self._up_stamp: int | None = None

    # -- start --------------------------------------------------------------------------------

    def __enter__(self) -> Session:
        try:
            self._start()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def _start(self) -> None:
        programs = {
            spec.name: find_executable(spec.package, spec.executable) for spec in self._specs
        }
        if self._options.simulated:
            # For this process too: its own nodes must hear no more and no less than the others.
            os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        if self._scenario.camera is not None:
            allow_large_messages(os.environ)
        self._domain = self._choose_domain()
        self._progress.say(f'run in {self.folder.path}, ROS domain {self._domain_words}')
        self.monitor = Monitor(
            self.node('tablerunner_launcher'), self._options.odom_topic or 'odom'
        )
        if self._settings.record:
            self._supervisor.start(self._recorder_command())
        for spec in self._specs:
            self._supervisor.start(self._command(spec, programs[spec.name]))
        self._wait_until_up()
        self._up_at = time.monotonic()
        base = self.monitor.base
        self._up_stamp = None if base is None else base.stamp

    def seconds_since_up(self, stamp: int | None) -> float:
        """Return how long after the start of the run a measurement stamp [ns] is [s].

        The wall clock stands in where no stamp is known.
        """
        if stamp is None or self._up_stamp is None:
            return time.monotonic() - self._up_at
        return (stamp - self._up_stamp) / NANOSECONDS

    def node(self, name: str) -> Node:
        """Return a new node in the domain and namespace of the run; it ends with the run."""
        return self._stack.enter_context(bare_node(name, self._domain, self._options.namespace))

    @property
    def _domain_words(self) -> str:
        return os.environ.get('ROS_DOMAIN_ID', '0') if self._domain is None else str(self._domain)

    def _choose_domain(self) -> int | None:
        asked = self._settings.domain
        if asked is None and not self._options.simulated:
            return None  # a real robot is where its operator looks for it: ROS_DOMAIN_ID
        domain = domains.acquire() if asked is None else domains.claim(asked)
        return self._stack.enter_context(domain).number

    def _environment(self) -> dict[str, str]:
        environment = {**os.environ, 'PYTHONUNBUFFERED': '1', 'RCUTILS_COLORIZED_OUTPUT': '0'}
        if self._domain is not None:
            environment['ROS_DOMAIN_ID'] = str(self._domain)
        environment['ROS_LOG_DIR'] = str((self.folder.logs / 'ros').resolve())
        # The matrices are small: threads of a linear algebra library only get in each other's way.
        environment.setdefault('OPENBLAS_NUM_THREADS', '1')
        environment.setdefault('OMP_NUM_THREADS', '1')
        return environment

    def _command(self, spec: NodeSpec, program: Path) -> Command:
        file = self.folder.parameters / f'{spec.name}.yaml'
        parameters.write(file, spec.name, spec.parameters(self._scenario, self._options))
        arguments = [str(program), '--ros-args', '-r', f'__node:={spec.name}']
        if self._options.namespace:
            arguments += ['-r', f'__ns:=/{self._options.namespace.strip("/")}']
        for old, new in spec.remap:
            arguments += ['-r', f'{old}:={new}']
        for rule in self._settings.remap:
            arguments += ['-r', rule]
        for path in (file, *self._settings.parameter_files):
            arguments += ['--params-file', str(path.resolve())]
        return Command(
            spec.name, tuple(arguments), self.folder.log(spec.name), self._environment()
        )

    def _recorder_command(self) -> Command:
        arguments = [sys.executable, '-m', 'tablerunner.cli.main', 'record']
        arguments += ['-o', str(self.folder.bag)]
        if self._options.simulated:
            arguments.append('--use-sim-time')
        for topic in self._settings.record_topics:
            arguments += ['--topics', topic]
        # When the launcher is killed the recorder still closes its bag.
        return Command(
            RECORDER,
            tuple(arguments),
            self.folder.log(RECORDER),
            self._environment(),
            orphan_signal=signal.SIGTERM,
        )

    def _wait_until_up(self) -> None:
        waiting = {spec.name for spec in self._specs}
        deadline = time.monotonic() + self._settings.up_limit_s
        while waiting:
            self.tick()
            self._raise_when_interrupted()
            for name in [name for name in waiting if self.monitor.is_up(name)]:
                waiting.discard(name)
                self._progress.say(f'  {name} is up')
            self._progress.show('waiting for ' + ', '.join(sorted(waiting)))
            if waiting and time.monotonic() > deadline:
                logs = ', '.join(str(self.folder.log(name)) for name in sorted(waiting))
                raise NotUpError(
                    f'{", ".join(sorted(waiting))} not up after {self._settings.up_limit_s:g} s; '
                    f'see {logs}'
                )
            time.sleep(_TICK_S)

    def _raise_when_interrupted(self) -> None:
        if self._interrupts.asked:
            raise InterruptedRunError(f'ended by {self._interrupts.name}')

    # -- watch --------------------------------------------------------------------------------

    def tick(self) -> None:
        """Take the news; call it many times a second.

        Raises
        ------
        NodeEndedError
            After the robot has been brought to a stand.
        """
        self.monitor.poll()
        endings = self._supervisor.ended()
        if endings:
            self._stand_still()
            raise NodeEndedError(endings[0])

    def wait(self, done: Callable[[], bool], show: Callable[[], str]) -> bool:
        """Tick until `done` (True) or until the run is asked to end (False)."""
        while not self._interrupts.asked:
            self.tick()
            if done():
                return True
            self._progress.show(show())
            time.sleep(_TICK_S)
        return False

    # -- end ----------------------------------------------------------------------------------

    def _stand_still(self) -> None:
        """Take the command away and wait until the robot stands, for a bounded time.

        The safety stop is told to brake, which is quickest; should it not hear that, it goes to
        zero without commands, and without the safety stop the base does. Those two therefore
        keep running until the robot stands.
        """
        deadline = time.monotonic() + _STAND_LIMIT_S
        self.monitor.stop_robot()
        if COMMANDING in self._supervisor.running:
            self._supervisor.interrupt(COMMANDING)
        if 'sim_bridge' not in self._supervisor.running and self._options.simulated:
            return  # no base left that could move
        while time.monotonic() < deadline:
            self.monitor.poll()
            base = self.monitor.base
            if base is None or base.stands:
                return
            time.sleep(_TICK_S)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._progress.show('ending')
            if self._supervisor.running:
                if hasattr(self, 'monitor'):
                    self._stand_still()
                others = [name for name in self._supervisor.running if name != RECORDER]
                self._supervisor.stop(others, lambda: self._interrupts.insisted)
                # Last, so that the bag holds the end.
                self._supervisor.stop(None, lambda: self._interrupts.insisted)
        finally:
            self._supervisor.stop(None, lambda: True)
            self._stack.close()
