"""One set-up at a time in a folder."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path


@contextlib.contextmanager
def held(folder: Path, on_wait: Callable[[], None]) -> Iterator[int]:
    """Hold the folder's lock; yield its file descriptor. Call `on_wait` if another has it first.

    The lock is on the folder itself: there is no lock file to clean up, and the system releases it
    however its holder ends.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            on_wait()
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)
