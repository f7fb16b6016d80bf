"""What a machine must have before the set-up starts; each check says what is missing.

Every check takes what it looks at as arguments, so that tests can show it a machine that lacks it.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
import sys
import sysconfig
from collections.abc import Callable, Mapping
from pathlib import Path

from bootstrap.errors import SetupError

GIGABYTE = 1024**3
# The environment takes 0.7 GB, the build 0.1 GB, and pip keeps the downloads for a while.
NEEDED_SPACE = 2 * GIGABYTE
OLDEST_GLIBC = (2, 28)

# Imported by Tablerunner on a machine with ROS: module -> how a user gets it there.
ROS_MACHINE_MODULES = {
    'numpy': 'python3-numpy',
    'scipy': 'python3-scipy',
    'yaml': 'python3-yaml',
    'matplotlib': 'python3-matplotlib',
    'rich': 'python3-rich',
    'psutil': 'python3-psutil',
    'typer': 'python3-typer',
    'filterpy': 'filterpy (pip)',
    'serial': 'python3-serial',
    'rosbags': 'rosbags (pip)',
}


def check_system(
    system: str = sys.platform,
    machine: str = platform.machine(),
    libc: tuple[str, str] | None = None,
) -> None:
    """Refuse what the ROS 2 wheels are not made for: another system, processor or C library."""
    if system != 'linux':
        raise SetupError(
            f'The ROS 2 packages of the set-up are for Linux, this is {system}: use a Linux '
            'machine or container, or install ROS 2 Jazzy and source it first.'
        )
    if machine not in ('x86_64', 'AMD64'):
        raise SetupError(
            f'The ROS 2 packages of the set-up are for x86-64 processors, this is {machine}: '
            'install ROS 2 Jazzy, source it, and run the command again.'
        )
    name, version = platform.libc_ver() if libc is None else libc
    numbers = tuple(int(part) for part in version.split('.')[:2] if part.isdigit())
    if name != 'glibc' or numbers < OLDEST_GLIBC:
        found = f'{name} {version}'.strip() or 'another C library'
        raise SetupError(
            f'The ROS 2 packages of the set-up need glibc 2.28 or newer, this machine has '
            f'{found}: use a newer distribution (Debian 10, Ubuntu 20.04, RHEL 8 or later).'
        )


def check_python(
    implementation: str = platform.python_implementation(),
    free_threaded: bool = bool(sysconfig.get_config_var('Py_GIL_DISABLED')),
    bits: int = 64 if sys.maxsize > 2**32 else 32,
) -> None:
    """Refuse a Python that the ROS 2 wheels do not load into (its version is checked earlier)."""
    if implementation != 'CPython' or free_threaded or bits != 64:
        kind = 'free-threaded CPython' if free_threaded else f'{bits}-bit {implementation}'
        raise SetupError(
            f'The ROS 2 packages of the set-up need an ordinary 64-bit CPython, this is {kind}: '
            'name another one, for example `make PYTHON=/usr/bin/python3 demo`.'
        )


def check_venv(find_spec: Callable[[str], object] = importlib.util.find_spec) -> None:
    """Refuse a Python that cannot make virtual environments (Debian splits that off)."""
    if find_spec('venv') is None or find_spec('ensurepip') is None:
        raise SetupError(
            'This Python cannot make virtual environments: install its venv package '
            f'(on Debian and Ubuntu: sudo apt install python{_version()}-venv), then run the '
            'command again.'
        )


def check_compilers(
    which: Callable[[str], str | None] = shutil.which,
    environ: Mapping[str, str] = os.environ,
    header: Path | None = None,
) -> None:
    """Refuse a machine on which messages cannot be built."""

    def found(*names: str | None) -> bool:
        return any(which(name.split()[0]) for name in names if name)

    header = header or Path(sysconfig.get_config_var('INCLUDEPY') or '') / 'Python.h'
    missing = []
    packages = []
    if not found(environ.get('CC'), 'cc', 'gcc', 'clang'):
        missing.append('a C compiler')
        packages.append('build-essential')
    if not found(environ.get('CXX'), 'c++', 'g++', 'clang++'):
        missing.append('a C++ compiler')
        packages.append('build-essential')
    if not found('cmake'):
        missing.append('cmake')
        packages.append('cmake')
    if not found('make', 'gmake'):
        missing.append('make')
        packages.append('build-essential')
    if not header.is_file():
        missing.append(f'the header files of Python {_version()}')
        packages.append(f'python{_version()}-dev')
    if missing:
        names = ' '.join(dict.fromkeys(packages))
        raise SetupError(
            f'Building the messages needs {_listed(missing)}, not found here: install what is '
            f'missing (on Debian and Ubuntu: sudo apt install {names}), then run the command '
            'again.'
        )


def check_space(folder: Path, free: int | None = None) -> None:
    """Refuse a disk that the environment does not fit on."""
    free = shutil.disk_usage(folder).free if free is None else free
    if free < NEEDED_SPACE:
        raise SetupError(
            f'The set-up needs {NEEDED_SPACE / GIGABYTE:.0f} GB of disk and {folder} has '
            f'{free / GIGABYTE:.1f} GB free: free some space, then run the command again.'
        )


def check_ros_machine(
    find_spec: Callable[[str], object] = importlib.util.find_spec,
    which: Callable[[str], str | None] = shutil.which,
) -> None:
    """Refuse a machine with ROS on which something that Tablerunner imports is missing."""
    if which('colcon') is None:
        raise SetupError(
            'colcon is missing: install it (sudo apt install python3-colcon-common-extensions), '
            'then run the command again.'
        )
    missing = [how for module, how in ROS_MACHINE_MODULES.items() if find_spec(module) is None]
    if missing:
        raise SetupError(
            f'Python packages are missing ({", ".join(missing)}): install them as docs/install.md '
            'says (rosdep install --from-paths . --ignore-src -y, and pip for the rest), then run '
            'the command again.'
        )


def is_ros_machine(
    environ: Mapping[str, str] = os.environ,
    find_spec: Callable[[str], object] = importlib.util.find_spec,
) -> bool:
    """Say whether ROS 2 Jazzy is sourced; refuse what is neither that nor no ROS at all."""
    distribution = environ.get('ROS_DISTRO', '')
    if not distribution:
        return False
    if distribution != 'jazzy':
        raise SetupError(
            f'ROS {distribution} is sourced in this shell, Tablerunner is for Jazzy: source '
            '/opt/ros/jazzy/setup.bash in a new shell, or use a shell without any ROS.'
        )
    if find_spec('rclpy') is None:
        raise SetupError(
            f'ROS 2 Jazzy is sourced, but {sys.executable} cannot import rclpy: name the Python '
            'that ROS was installed for, for example `make PYTHON=/usr/bin/python3 demo`.'
        )
    return True


def _version() -> str:
    return f'{sys.version_info[0]}.{sys.version_info[1]}'


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else ', '.join(words[:-1]) + ' and ' + words[-1]
