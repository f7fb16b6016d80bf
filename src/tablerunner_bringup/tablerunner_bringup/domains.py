"""A ROS domain of one's own for each simulated run, so that two runs never hear each other."""

from __future__ import annotations

import contextlib
import fcntl
import os
import socket
import stat
import tempfile
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

from tablerunner.errors import TablerunnerError

DOMAINS = range(20, 100)
"""Candidates: domain 0 is everybody's default, and above 101 the ports are the system's."""

LAST_DOMAIN = 232
"""The last domain for which DDS has ports."""

_PORT_BASE = 7400
_PORTS_PER_DOMAIN = 250
_FIRST_PARTICIPANT = 10  # its unicast discovery port, counted from the domain's first


class DomainError(TablerunnerError):
    """No domain is free, or the one asked for is not a domain."""


def runtime_folder() -> Path:
    """Return the folder of the lock files, made when absent; private to this user.

    Raises
    ------
    DomainError
        The folder cannot be made or belongs to somebody else.
    """
    base = os.environ.get('XDG_RUNTIME_DIR', '')
    if base and os.access(base, os.W_OK):
        folder = Path(base) / 'tablerunner'
    else:
        folder = Path(tempfile.gettempdir()) / f'tablerunner-{os.getuid()}'
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat(follow_symlinks=False)
    except OSError as error:
        raise DomainError(f'no folder for the domain locks: {error}') from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise DomainError(f'{folder} is not a folder of this user')
    return folder


class Domain:
    """One domain id, held for this process until `release` or its death.

    The lock is an flock on a file: the kernel frees it when the process ends, however it ends.
    """

    def __init__(self, number: int, descriptor: int) -> None:
        self.number = number
        self._descriptor: int | None = descriptor

    def __enter__(self) -> Domain:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()

    def release(self) -> None:
        """Give the domain back; a second call does nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def acquire(candidates: Iterable[int] = DOMAINS, folder: Path | None = None) -> Domain:
    """Take the first domain that no other run holds and in which nobody speaks.

    Raises
    ------
    DomainError
        All are taken.
    """
    where = runtime_folder() if folder is None else folder
    candidates = list(candidates)
    # Runs started together would all queue for the same first number.
    start = os.getpid() % len(candidates) if candidates else 0
    for number in candidates[start:] + candidates[:start]:
        descriptor = _lock(where / f'domain_{number}.lock')
        if descriptor is None:
            continue
        if is_silent(number):
            return Domain(number, descriptor)
        os.close(descriptor)
    raise DomainError(f'none of the {len(candidates)} ROS domains is free; give one by --domain')


def claim(number: int, folder: Path | None = None) -> Domain:
    """Take the domain that a user names; others may speak in it, but no second simulated robot.

    Raises
    ------
    DomainError
        It is outside 0..232, what the ports of DDS allow, or another run holds it.
    """
    if not 0 <= number <= LAST_DOMAIN:
        raise DomainError(f'ROS domain {number}: expected 0 to {LAST_DOMAIN}')
    where = runtime_folder() if folder is None else folder
    descriptor = _lock(where / f'domain_{number}.lock')
    if descriptor is None:
        raise DomainError(f'ROS domain {number} is held by another run: leave --domain out')
    return Domain(number, descriptor)


def is_silent(domain: int) -> bool:
    """Return whether no DDS participant of this machine holds the domain's discovery ports."""
    first = _PORT_BASE + _PORTS_PER_DOMAIN * domain
    return all(_is_free(port) for port in (first, first + _FIRST_PARTICIPANT))


def _lock(path: Path) -> int | None:
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise DomainError(f'the domain lock {path} cannot be opened: {error}') from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def _is_free(port: int) -> bool:
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True
