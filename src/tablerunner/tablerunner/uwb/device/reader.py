"""A thread that reads a device, so that nobody else waits for it."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from tablerunner.uwb.device.session import Batch, DeviceSession

T = TypeVar('T')

WAIT_S = 0.1
"""How soon the thread notices that it should end [s]."""

PAUSE_S = 0.003
"""What follows a batch begins this much later: on a busy machine it would keep a processor from
those that take the ranges [s]."""

MOST_WAITING = 1000
"""What waits to be taken; more, and the oldest is lost, and counted."""


class DeviceReader(Generic[T]):
    """Steps a session in a thread.

    Parameters
    ----------
    session : DeviceSession
        Only the thread steps it.
    handle : callable
        Called in the thread with each batch: what cannot wait. What it returns is kept.
    notify : callable
        Called in the thread when there is something to take, `PAUSE_S` after it came.

    Attributes
    ----------
    dropped : int
        What was kept and not taken in time.
    """

    def __init__(
        self, session: DeviceSession, handle: Callable[[Batch], T], notify: Callable[[], None]
    ) -> None:
        self._session = session
        self._handle = handle
        self._notify = notify
        self._kept: deque[T] = deque()
        self._error: BaseException | None = None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name='uwb device', daemon=True)
        self.dropped = 0

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the source."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join()

    def take(self) -> list[T]:
        """Return what was kept since the last call; an error of the thread is raised here."""
        if self._error is not None:
            raise self._error
        taken: list[T] = []
        while True:
            try:
                taken.append(self._kept.popleft())
            except IndexError:
                return taken

    def _run(self) -> None:
        try:
            told_at = math.inf
            while not self._ending.is_set():
                now = time.monotonic()
                if now >= told_at:
                    told_at = math.inf
                    self._notify()
                batch = self._session.step(min(WAIT_S, told_at - now), self._ending.wait)
                if batch.ranges or batch.refusals:
                    self._keep(self._handle(batch))
                    told_at = min(told_at, time.monotonic() + PAUSE_S)
        except Exception as error:  # noqa: BLE001 (raised again in take, in the other thread)
            self._error = error
            self._notify()
        finally:
            self._session.close()

    def _keep(self, kept: T) -> None:
        if len(self._kept) >= MOST_WAITING:
            self._kept.popleft()
            self.dropped += 1
        self._kept.append(kept)
