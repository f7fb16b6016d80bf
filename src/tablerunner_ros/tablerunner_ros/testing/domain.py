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
    # The one that has been free for longest: the last participants of others may still be saying
    # goodbye. Other test runs and workers of this machine count, too.
    locks = [folder / str(number) for number in DOMAINS]
    for path in sorted(locks, key=_last_used):
        with path.open('w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            try:
                yield int(path.name)
            finally:
                os.utime(path)
            return
    raise NoDomainError(f'domains {DOMAINS[0]} to {DOMAINS[-1]} are all in use')


def _last_used(path: Path) -> int:
    """Return when a lock was touched last [ns]; 0 for one that is new."""
    return path.stat().st_mtime_ns if path.exists() else 0
