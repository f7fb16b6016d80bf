"""A family of child processes that is started, watched and ended together."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType

from tablerunner_bringup.child import Child, Command, Ending

_POLL_S = 0.01


@dataclass(frozen=True, slots=True)
class StopLimits:
    """How long a child may take to obey [s]: to SIGINT, then to SIGTERM; then it is killed."""

    interrupt_s: float = 5.0
    terminate_s: float = 2.0
    kill_s: float = 5.0


class Supervisor:
    """Starts children, tells when one ended, and leaves none behind.

    A context manager: on leaving, whatever still runs is ended. Not for several threads.
    """

    def __init__(self, limits: StopLimits | None = None) -> None:
        self._limits = limits or StopLimits()
        self._children: dict[str, Child] = {}
        self._seen: set[str] = set()

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    @property
    def running(self) -> tuple[str, ...]:
        """Names of the children that run, in the order of their start."""
        return tuple(name for name, child in self._children.items() if child.poll() is None)

    def pid(self, name: str) -> int:
        """Return the process id of a child."""
        return self._children[name].pid

    def start(self, command: Command) -> Child:
        """Start a child.

        Raises
        ------
        ValueError
            A child of this name was started before.
        OSError
            The program cannot be started.
        """
        if command.name in self._children:
            raise ValueError(f'a process named {command.name} was started before')
        child = Child(command)
        self._children[command.name] = child
        return child

    def ended(self) -> tuple[Ending, ...]:
        """Return the children that ended by themselves since the last call."""
        endings = []
        for name, child in self._children.items():
            ending = child.poll()
            if ending is not None and name not in self._seen:
                self._seen.add(name)
                endings.append(ending)
        return tuple(endings)

    def interrupt(self, name: str) -> None:
        """Ask a child to end, and do not wait; its end is not news then."""
        self._seen.add(name)
        self._children[name].send(signal.SIGINT)

    def stop(
        self,
        names: Iterable[str] | None = None,
        hurry: Callable[[], bool] = lambda: False,
    ) -> tuple[Ending, ...]:
        """End children side by side: SIGINT, then SIGTERM, then SIGKILL to the whole group.

        Parameters
        ----------
        names : iterable of str or None
            Which; None: all. Names that are not known are passed over.
        hurry : callable
            Asked again and again; once it returns True the rest is killed at once.

        Returns
        -------
        tuple of Ending
            How those that still ran ended.
        """
        wanted = set(self._children if names is None else names)
        children = [
            child
            for name, child in self._children.items()
            if name in wanted and child.poll() is None
        ]
        self._seen.update(child.name for child in children)
        steps = (
            (signal.SIGINT, self._limits.interrupt_s),
            (signal.SIGTERM, self._limits.terminate_s),
        )
        for number, limit_s in steps:
            for child in children:
                child.send(number)
            self._wait(children, limit_s, hurry)
        for child in children:
            child.kill()
        self._wait(children, self._limits.kill_s, lambda: False)
        endings = (child.poll() for child in children)
        return tuple(ending for ending in endings if ending is not None)

    @staticmethod
    def _wait(children: list[Child], limit_s: float, hurry: Callable[[], bool]) -> None:
        deadline = time.monotonic() + limit_s
        while any(child.poll() is None for child in children):
            if hurry() or time.monotonic() > deadline:
                return
            time.sleep(_POLL_S)
