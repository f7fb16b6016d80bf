"""Find node executables where `ros2 run` finds them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from tablerunner.errors import TablerunnerError


class ExecutableError(TablerunnerError):
    """A package or its executable is not in the environment."""


def prefixes() -> tuple[Path, ...]:
    """Return the folders of AMENT_PREFIX_PATH, in order."""
    listed = os.environ.get('AMENT_PREFIX_PATH', '')
    return tuple(Path(entry) for entry in listed.split(os.pathsep) if entry)


def find_executable(package: str, executable: str, among: Sequence[Path] | None = None) -> Path:
    """Return the path of ``lib/<package>/<executable>`` under the first prefix that has it.

    Raises
    ------
    ExecutableError
        The environment is not open, or holds no such executable; says which, and what to do.
    """
    folders = prefixes() if among is None else tuple(among)
    if not folders:
        raise ExecutableError(
            'AMENT_PREFIX_PATH is empty: open the environment first (source ./env.sh, or '
            'source install/setup.bash where ROS 2 is installed)'
        )
    for prefix in folders:
        path = prefix / 'lib' / package / executable
        if path.is_file() and os.access(path, os.X_OK):
            return path
    known = next((p for p in folders if (p / 'share' / package / 'package.xml').is_file()), None)
    if known is None:
        raise ExecutableError(f'package {package} is not built: run make build (or colcon build)')
    raise ExecutableError(f'package {package} in {known} has no executable {executable}')


def find_share(package: str, among: Sequence[Path] | None = None) -> Path:
    """Return the folder ``share/<package>`` of the first prefix that has the package.

    Raises
    ------
    ExecutableError
        No prefix has it.
    """
    for prefix in prefixes() if among is None else among:
        path = prefix / 'share' / package
        if path.is_dir():
            return path
    raise ExecutableError(f'package {package} is not in AMENT_PREFIX_PATH')
