"""A ROS domain for one test, held by no other test of this machine."""

from __future__ import annotations

import contextlib
import fcntl
import gc
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

DOMAINS = range(1, 20)
"""For tests; `tablerunner launch` takes its domains above these, and 0 is everybody's default."""


_PORTS = Path('/proc/net/udp')
_PORT_BASE, _PORTS_PER_DOMAIN = 7400, 250  # of DDS over UDP
_QUIET_S = 5.0


class NoDomainError(RuntimeError):
    """Every domain of the range is in use by another test run."""


class DomainLeftError(AssertionError):
    """A test has ended, and somebody still speaks in its domain."""


@contextlib.contextmanager
def lease_domain() -> Iterator[int]:
    """Hold a domain id; the kernel frees its lock however the process ends.

    Raises
    ------
    NoDomainError
        All are taken.
    DomainLeftError
        A participant is left at the end: the next test in this domain would hear it.
    """
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
            number = int(path.name)
            if is_spoken_in(number):
                continue
            try:
                yield number
            finally:
                os.utime(path)
            _check_left(number)
            return
    raise NoDomainError(f'domains {DOMAINS[0]} to {DOMAINS[-1]} are all in use')


def is_spoken_in(domain: int) -> bool:
    """Return whether a DDS participant of this machine has ports of a domain."""
    first = _PORT_BASE + _PORTS_PER_DOMAIN * domain
    return any(first <= port < first + _PORTS_PER_DOMAIN for port in _bound_ports())


def _bound_ports() -> Iterator[int]:
    """Yield the UDP ports that are bound on this machine; none where Linux' list is not.

    Each of its lines has a number, then local address and port in hexadecimal.
    """
    if _PORTS.exists():
        for line in _PORTS.read_text(encoding='ascii').splitlines()[1:]:
            yield int(line.split()[1].rpartition(':')[2], 16)


def _check_left(domain: int) -> None:
    """Raise `DomainLeftError` if somebody stays in a domain."""
    end = time.monotonic() + _QUIET_S
    while is_spoken_in(domain):
        gc.collect()  # a node whose making failed is in a cycle with the error
        if time.monotonic() > end:
            raise DomainLeftError(f'a participant is left in domain {domain}')
        time.sleep(0.05)


def _last_used(path: Path) -> int:
    """Return when a lock was touched last [ns]; 0 for one that is new."""
    return path.stat().st_mtime_ns if path.exists() else 0
