"""A ROS domain for one test, held by no other test of this machine."""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

DOMAINS = range(1, 20)
"""For tests; `tablerunner launch` takes its domains above these, and 0 is everybody's default."""


class NoDomainError(RuntimeError):
    """Every domain of the range is in use by another test run."""


@contextlib.contextmanager
def lease_domain() -> Iterator[int]:
    """Hold a domain id; the kernel frees its lock however the process ends."""
    folder = Path(tempfile.gettempdir()) / f'tablerunner-test-domains-{os.getuid()}'
    folder.mkdir(exist_ok=True)
    # Runs side by side start at different numbers, and a domain is not taken again at once: its
    # last participants may still be saying goodbye.
    start = (os.getpid() + next(_TURN)) % len(DOMAINS)
    for number in [*DOMAINS[start:], *DOMAINS[:start]]:
        with (folder / str(number)).open('w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield number
            return
    raise NoDomainError(f'domains {DOMAINS[0]} to {DOMAINS[-1]} are all in use')


def _turns() -> Iterator[int]:
    number = 0
    while True:
        yield number
        number += 1


_TURN = _turns()
