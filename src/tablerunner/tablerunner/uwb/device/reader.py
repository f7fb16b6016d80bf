"""A thread that reads a device, so that whoever takes its ranges never waits for it."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from tablerunner.uwb.device.session import Batch, DeviceSession

WAIT_S = 0.1
"""How soon the thread notices that it should end [s]."""

MOST_WAITING = 1000
"""Batches that wait to be taken; more, and the oldest are lost, and counted."""


class DeviceReader:
    """Steps a session in a thread.

    Parameters
    ----------
    session : DeviceSession
        Only the thread steps it.
    notify : callable
        Called from the thread when there is something to take.

    Attributes
    ----------
    dropped : int
        Batches that were not taken in time.
    """

    def __init__(self, session: DeviceSession, notify: Callable[[], None]) -> None:
        self._session = session
        self._notify = notify
        self._batches: deque[Batch] = deque()
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

    def take(self) -> list[Batch]:
        """Return what came since the last call; an error of the thread is raised here."""
        if self._error is not None:
            raise self._error
        taken: list[Batch] = []
        while True:
            try:
                taken.append(self._batches.popleft())
            except IndexError:
                return taken

    def _run(self) -> None:
        try:
            while not self._ending.is_set():
                batch = self._session.step(WAIT_S, self._ending.wait)
                if batch.ranges or batch.refusals:
                    if len(self._batches) >= MOST_WAITING:
                        self._batches.popleft()
                        self.dropped += 1
                    self._batches.append(batch)
                    self._notify()
        except Exception as error:  # noqa: BLE001 (raised again in take, in the other thread)
            self._error = error
            self._notify()
        finally:
            self._session.close()
