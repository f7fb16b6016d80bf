"""Facts of this machine: what is installed, how ROS is set, which serial ports there are."""

from __future__ import annotations

import datetime as dt
import grp
import importlib
import os
import stat
import sys
from collections.abc import Iterable
from pathlib import Path

import psutil

from tablerunner.doctor import EnvironmentFacts, SerialFacts
from tablerunner_bringup.executables import ExecutableError, find_executable
from tablerunner_bringup.nodes import NODES

PACKAGES = (
    'rclpy',
    'numpy',
    'scipy',
    'yaml',
    'rosbags',
    'psutil',
    'sensor_msgs.msg',
    'nav_msgs.msg',
    'geometry_msgs.msg',
    'diagnostic_msgs.msg',
    'tf2_msgs.msg',
    'tablerunner_interfaces.msg',
)
"""What nodes import."""

VARIABLES = (
    'ROS_DOMAIN_ID',
    'ROS_AUTOMATIC_DISCOVERY_RANGE',
    'ROS_STATIC_PEERS',
    'ROS_LOCALHOST_ONLY',
    'RMW_IMPLEMENTATION',
    'FASTDDS_DEFAULT_PROFILES_FILE',
)

PORTS = ('ttyUSB*', 'ttyACM*')


def environment_facts() -> EnvironmentFacts:
    """Return what is installed and set."""
    missing = []
    for name in PACKAGES:
        try:
            importlib.import_module(name)
        except ImportError:
            missing.append(name.removesuffix('.msg'))
    return EnvironmentFacts(
        python=sys.version_info[:3],
        missing_packages=tuple(missing),
        missing_programs=tuple(_missing_programs()),
        middleware=_middleware(),
        variables={name: os.environ[name] for name in VARIABLES if name in os.environ},
        year=dt.datetime.now().astimezone().year,
    )


def _missing_programs() -> Iterable[str]:
    for spec in NODES:
        try:
            find_executable(spec.package, spec.executable)
        except ExecutableError:
            yield spec.executable


def _middleware() -> str:
    try:
        from rclpy.utilities import get_rmw_implementation_identifier

        return str(get_rmw_implementation_identifier())
    except Exception:  # noqa: BLE001 (a library that cannot be loaded raises what it likes)
        return ''


def serial_facts(wanted: Iterable[str] = ()) -> tuple[SerialFacts, ...]:
    """Return the USB serial ports of this machine, and those that somebody is told to use."""
    asked = [path for path in wanted if path]
    found = sorted(str(path) for pattern in PORTS for path in Path('/dev').glob(pattern))
    others = [path for path in found if not any(_same(path, one) for one in asked)]
    return tuple(_serial(path, path in asked) for path in [*asked, *others])


def _same(one: str, other: str) -> bool:
    return Path(one).resolve() == Path(other).resolve()


def _serial(path: str, wanted: bool) -> SerialFacts:
    try:
        status = Path(path).stat()
    except OSError:
        return SerialFacts(path, exists=False, accessible=False, wanted=wanted)
    try:
        group = grp.getgrgid(status.st_gid).gr_name
    except KeyError:
        group = str(status.st_gid)
    return SerialFacts(
        path,
        is_device=stat.S_ISCHR(status.st_mode),
        accessible=os.access(path, os.R_OK | os.W_OK),
        group=group,
        holders=_holders(path),
        wanted=wanted,
    )


def _holders(path: str) -> tuple[str, ...]:
    """Return the programs that have a device open, as far as this user may see it."""
    target = Path(path).resolve()
    found = []
    for process in psutil.process_iter(['name']):
        try:
            opened = [entry.resolve() for entry in Path(f'/proc/{process.pid}/fd').iterdir()]
        except OSError:  # another user's, or ended meanwhile
            continue
        if target in opened:
            found.append(f'{process.info["name"]} ({process.pid})')
    return tuple(found)
