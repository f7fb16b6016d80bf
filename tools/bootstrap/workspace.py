"""The colcon build of every package in the checkout."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from bootstrap import process, stamps
from bootstrap.errors import SetupError
from bootstrap.progress import Progress

# What a package is built from. Python modules are not in it: --symlink-install makes a change of
# them effective at once.
_RECIPES = ('package.xml', 'setup.py', 'setup.cfg', 'CMakeLists.txt')
_INTERFACES = ('msg/*.msg', 'srv/*.srv', 'action/*.action')
# Installed one link per file, so that a new or removed name has to be built, a changed text not.
_SHARED = ('launch/*', 'params/*', 'scenarios/*', 'rviz/*', 'resource/*')

# Change it when the way packages are built changes: they are then built again.
RECIPE = '1'


class Workspace:
    """The colcon workspace that a checkout is."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.install = root / 'install'
        self.log = root / 'log' / 'setup' / 'colcon.log'
        self._build = root / 'build'
        self._stamp = self.install / '.complete'
        self._ground_stamp = self._build / '.ground'
        self._unfinished = self._build / '.unfinished'

    def packages(self, prefixes: str) -> list[Path]:
        """Return the folders of the packages to build.

        Parameters
        ----------
        prefixes : str
            AMENT_PREFIX_PATH without this workspace. A stand-in is built only if the real package
            is in none of them.
        """
        found = [*self.root.glob('*/package.xml'), *self.root.glob('src/*/package.xml')]
        for standin in self.root.glob('tools/standins/*/package.xml'):
            name = standin.parent.name
            if not any(
                (Path(prefix) / 'share' / name / 'package.xml').is_file()
                for prefix in prefixes.split(os.pathsep)
                if prefix
            ):
                found.append(standin)
        return sorted(path.parent for path in found)

    def wanted(self, ground: str, packages: list[Path]) -> str:
        """Return the stamp that the build should have; `ground` is what it stands on."""
        files = [self.root / 'colcon.meta']
        words = [RECIPE, ground]
        for package in packages:
            words.append(str(package.relative_to(self.root)))
            files += [package / name for name in _RECIPES if (package / name).is_file()]
            for pattern in _INTERFACES:
                files += package.glob(pattern)
            for pattern in _SHARED:
                words += sorted(str(path.relative_to(self.root)) for path in package.glob(pattern))
        return stamps.digest(words, files, self.root)

    def is_current(self, wanted: str) -> bool:
        """Say whether the last finished build was made from what is there now."""
        return stamps.read(self._stamp) == wanted

    def build(
        self,
        wanted: str,
        ground: str,
        packages: list[Path],
        colcon: list[str],
        environ: Mapping[str, str],
        progress: Progress,
        lock_fd: int,
    ) -> None:
        """Build all packages, from nothing if the last build was cut off or on other ground."""
        progress.start(f'colcon build of {len(packages)} packages')
        if stamps.read(self._ground_stamp) != ground or self._unfinished.exists():
            for folder in (self._build, self.install):
                shutil.rmtree(folder, ignore_errors=True)
        self._stamp.unlink(missing_ok=True)
        self._drop_stale({package.name for package in packages})
        stamps.write(self._ground_stamp, ground)
        self._unfinished.touch()
        self.log.unlink(missing_ok=True)
        standins = [package for package in packages if 'standins' in package.parts]
        command = [*colcon, '--log-base', 'log', 'build', '--symlink-install']
        command += ['--event-handlers', 'console_direct-', 'console_cohesion-']
        command += ['--base-paths', '.', *(str(p.relative_to(self.root)) for p in standins)]
        done = 0

        def on_line(line: str) -> None:
            nonlocal done
            match = re.match(r'Finished <<< (\S+)', line)
            done += match is not None
            progress.tell(f'{done} of {len(packages)}')

        try:
            process.run(command, self.log, self.root, environ, on_line, [lock_fd])
        except process.CommandError as error:
            self._unfinished.unlink(missing_ok=True)
            text = '\n'.join('    ' + line for line in process.tail(error.log).splitlines())
            shown = self.log.relative_to(self.root)
            if 'No space left on device' in text:
                text = 'The disk is full: free some space, then run the command again.'
                raise SetupError(text) from None
            raise SetupError(f'Building the packages failed, {shown} ends with:\n{text}') from None
        self._unfinished.unlink(missing_ok=True)
        # env.sh reads which of the two ways this is: on ROS as installed, or on its wheels.
        stamps.write(self.install / '.way', ground.split()[0])
        stamps.write(self._stamp, wanted)
        progress.done()

    def _drop_stale(self, names: set[str]) -> None:
        """Remove what was installed from a package that is no longer there."""
        for prefix in self.install.glob('*/'):
            if prefix.is_dir() and prefix.name not in names:
                shutil.rmtree(prefix, ignore_errors=True)
                shutil.rmtree(self._build / prefix.name, ignore_errors=True)
