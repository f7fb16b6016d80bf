"""The set-up as a whole: what has to be done, in which order, and the words when it fails."""

from __future__ import annotations

import os
import platform
import signal
import sys
from pathlib import Path

from bootstrap import checks, lock, stamps
from bootstrap.environment import Environment
from bootstrap.errors import SetupError
from bootstrap.progress import Progress
from bootstrap.workspace import Workspace

_SEARCH_PATHS = (
    'AMENT_PREFIX_PATH',
    'CMAKE_PREFIX_PATH',
    'COLCON_PREFIX_PATH',
    'LD_LIBRARY_PATH',
    'PYTHONPATH',
    'PATH',
)


def main(arguments: list[str]) -> int:
    """Set up the checkout this file is in; return the exit code."""
    if arguments:
        print('usage: python3 tools/bootstrap', file=sys.stderr)
        return 2
    root = Path(__file__).resolve().parents[2]
    # A kill by make or by a session's end must end pip and colcon too.
    signal.signal(signal.SIGTERM, _interrupt)
    signal.signal(signal.SIGHUP, _interrupt)
    try:
        set_up(root)
    except SetupError as error:
        print(f'error: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('\ninterrupted: the next run starts over where it is needed.', file=sys.stderr)
        return 130
    return 0


def set_up(root: Path) -> None:
    """Bring the environment and the build up to date; return at once when they are."""
    environ = outside_environment(os.environ, root)
    ros = checks.is_ros_machine(environ)
    environment = None if ros else Environment(root)
    workspace = Workspace(root)

    def ground() -> str:
        if environment is not None:
            return 'wheels ' + environment.wanted()
        prefixes = environ.get('AMENT_PREFIX_PATH', '')
        return 'ros ' + stamps.digest([str(root), prefixes, platform.python_version()])

    prefixes = '' if environment else environ.get('AMENT_PREFIX_PATH', '')
    packages = workspace.packages(prefixes)

    def is_current() -> bool:
        built = workspace.is_current(workspace.wanted(ground(), packages))
        return built and (environment is None or environment.is_current())

    if is_current():
        return
    with lock.held(root, _say_waiting) as lock_fd:
        if is_current():
            return
        if environment is None:
            checks.check_ros_machine()
            checks.check_compilers()
            progress = Progress(1)
            colcon = ['colcon']
        else:
            checks.check_system()
            checks.check_python()
            checks.check_venv()
            checks.check_compilers()
            progress = Progress(1 if environment.is_current() else 3)
            colcon = [str(environment.python), '-m', 'colcon']
        try:
            if environment is not None:
                if not environment.is_current():
                    checks.check_space(root)
                    environment.build(progress, environ, lock_fd)
                environ.update(wheels_environment(environment.folder, environ))
            workspace.build(
                workspace.wanted(ground(), packages),
                packages,
                colcon,
                environ,
                progress,
                lock_fd,
            )
        except BaseException:
            progress.failed()
            raise


def outside_environment(environ: os._Environ[str] | dict[str, str], root: Path) -> dict[str, str]:
    """Return the environment as it was before env.sh of this checkout was sourced."""
    outside = dict(environ)
    for name in _SEARCH_PATHS:
        if name in outside:
            parts = outside[name].split(os.pathsep)
            kept = [part for part in parts if part and not Path(part).is_relative_to(root)]
            outside[name] = os.pathsep.join(kept)
            if not kept:
                del outside[name]
    if Path(outside.get('VIRTUAL_ENV', '/')).is_relative_to(root):
        del outside['VIRTUAL_ENV']
    # The wheels' Python starts itself again to set its library path, unless this says it has.
    outside.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)
    outside['COLCON_DEFAULTS_FILE'] = os.devnull
    return outside


def wheels_environment(folder: Path, environ: dict[str, str]) -> dict[str, str]:
    """Return what makes colcon and CMake find ROS in the virtual environment, and nowhere else."""
    path = environ.get('PATH', os.defpath)
    return {
        'VIRTUAL_ENV': str(folder),
        'PATH': f'{folder / "bin"}{os.pathsep}{path}',
        'AMENT_PREFIX_PATH': str(folder),
        'CMAKE_PREFIX_PATH': str(folder),
        'PYTHONPATH': '',
    }


def _say_waiting() -> None:
    print('another set-up is running in this folder: waiting for it ...', file=sys.stderr)


def _interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt
