"""The virtual environment .venv: ROS 2 wheels, Python packages and tools, as locked."""

from __future__ import annotations

import os
import platform
import re
import shutil
import sys
import sysconfig
from collections.abc import Callable, Mapping
from pathlib import Path

from bootstrap import process, stamps, wheels
from bootstrap.errors import SetupError
from bootstrap.progress import Progress

# What builds the few packages that are published as source only. They are installed first, from
# the same lock, and pip is told to use them: by itself it would fetch the newest ones, unpinned.
BUILDERS = ('setuptools', 'wheel', 'packaging')
SOURCE_ONLY = 'empy'

# Change it when the way an environment is made changes: existing ones are then made anew.
RECIPE = '1'

_NO_NETWORK = re.compile(
    r'NewConnectionError|Failed to establish a new connection|name resolution|ProxyError|'
    r'ConnectTimeout|Read timed out|ConnectionResetError|Connection refused|getaddrinfo|'
    r'Network is unreachable|from versions: none'
)


class Environment:
    """The virtual environment of a checkout."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.folder = root / '.venv'
        self.lock = root / 'requirements' / 'lock.txt'
        self.log = root / 'log' / 'setup' / 'pip.log'
        self._stamp = self.folder / '.complete'
        # Inside another virtual environment, build on the Python that one was made from.
        self._base = getattr(sys, '_base_executable', sys.executable)

    @property
    def python(self) -> Path:
        """The environment's Python."""
        return self.folder / 'bin' / 'python3'

    def wanted(self) -> str:
        """Return the stamp that the environment should have."""
        words = [RECIPE, str(self.root), os.path.realpath(self._base), platform.python_version()]
        return stamps.digest(words, [self.lock])

    def is_current(self) -> bool:
        """Say whether the environment is there, whole, and what the lock file says."""
        return stamps.read(self._stamp) == self.wanted() and self.python.exists()

    def build(self, progress: Progress, environ: Mapping[str, str], lock_fd: int) -> None:
        """Make the environment from nothing: half of an interrupted one is never trusted."""
        progress.start(f'virtual environment .venv of Python {platform.python_version()}')
        shutil.rmtree(self.folder, ignore_errors=True)
        self.log.unlink(missing_ok=True)
        command = [self._base, '-m', 'venv', str(self.folder)]
        self._run(command, environ, lock_fd, progress)
        progress.done()

        names = _locked_names(self.lock.read_text(encoding='utf-8'))
        progress.start(f'ROS 2 Jazzy and Python packages from {self._shown(self.lock)}')
        self._install(progress, environ, lock_fd, len(names))
        headers = Path(sysconfig.get_config_var('INCLUDEPY'))
        wheels.repair(self.folder / 'share', self._site_packages(), headers)
        stamps.write(self._stamp, self.wanted())
        progress.done()

    def _install(
        self, progress: Progress, environ: Mapping[str, str], lock_fd: int, total: int
    ) -> None:
        pip = [str(self.python), '-m', 'pip', '--disable-pip-version-check', 'install']
        pip += ['--no-input', '--require-hashes', '--no-deps', '--no-compile']
        text = self.lock.read_text(encoding='utf-8')
        builders = self.log.with_name('builders.txt')
        builders.write_text(_entries(text, BUILDERS), encoding='utf-8')
        count = 0

        def on_line(line: str) -> None:
            nonlocal count
            if line.startswith('Collecting '):
                count += 1
                progress.tell(f'fetching {count} of about {total}: {line.split()[1]}')
            elif line.startswith('Installing collected'):
                progress.tell('unpacking')
            else:
                progress.tell()

        only = ['--only-binary', ':all:']
        self._run([*pip, *only, '-r', str(builders)], environ, lock_fd, progress)
        count = 0
        command = [*pip, '--no-build-isolation', *only, '--no-binary', SOURCE_ONLY]
        self._run([*command, '-r', str(self.lock)], environ, lock_fd, progress, on_line)
        # pip compiles on one core only, and a node that has to do it starts seconds late.
        folder = str(self._site_packages())
        command = [str(self.python), '-m', 'compileall', '-q', '-j', '0', folder]
        progress.tell('compiling')
        try:
            process.run(command, self.log, self.root, environ, keep_open=[lock_fd])
        except process.CommandError:
            pass  # Some packages carry templates that are no Python; nothing imports them.

    def _site_packages(self) -> Path:
        return next(self.folder.glob('lib/python3*/site-packages'))

    def _run(
        self,
        command: list[str],
        environ: Mapping[str, str],
        lock_fd: int,
        progress: Progress,
        on_line: Callable[[str], None] | None = None,
    ) -> None:
        follow = on_line or (lambda _: progress.tell())
        try:
            process.run(command, self.log, self.root, environ, follow, [lock_fd])
        except process.CommandError as error:
            raise SetupError(self._explain(process.tail(error.log, 60))) from None

    def _explain(self, text: str) -> str:
        shown = self._shown(self.log)
        if 'No space left on device' in text:
            return 'The disk is full: free some space, then run the command again.'
        if 'DO NOT MATCH THE HASHES' in text:
            return (
                'A downloaded package is not the one that requirements/lock.txt pins: check the '
                f'package index or mirror in use (details in {shown}).'
            )
        if _NO_NETWORK.search(text):
            return (
                'The Python packages could not be downloaded: check the network (or the proxy, or '
                'the mirror in PIP_INDEX_URL), then run the command again; it starts where it is '
                f'needed (details in {shown}).'
            )
        return f'Installing the Python packages failed, {shown} ends with:\n{_indented(text)}'

    def _shown(self, path: Path) -> str:
        return str(path.relative_to(self.root))


def _locked_names(text: str) -> list[str]:
    return re.findall(r'^([a-z0-9][a-z0-9._-]*)==', text, flags=re.MULTILINE)


def _entries(text: str, names: tuple[str, ...]) -> str:
    """Return the lock's entries (line and hashes) of the named packages only."""
    entries = re.findall(r'^[a-z0-9][^\n]*(?:\n[ \t]+[^\n]*)*', text, flags=re.MULTILINE)
    return '\n'.join(e for e in entries if e.split('==')[0] in names) + '\n'


def _indented(text: str, lines: int = 25) -> str:
    return '\n'.join('    ' + line for line in text.splitlines()[-lines:])
