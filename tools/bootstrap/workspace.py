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

    def wanted(self, ground: str, packages: list[Path]) -> dict[str, str]:
        """Return the stamps that the build should have, by package, and what it stands on."""
        return {'ground': f'{RECIPE} {ground}', **{p.name: self._stamp_of(p) for p in packages}}

    def _stamp_of(self, package: Path) -> str:
        files = [package / name for name in _RECIPES if (package / name).is_file()]
        if package / 'CMakeLists.txt' in files:
            files.append(self.root / 'colcon.meta')
        for pattern in _INTERFACES:
            files += package.glob(pattern)
        words = [str(package.relative_to(self.root))]
        for pattern in _SHARED:
            words += sorted(str(path.relative_to(self.root)) for path in package.glob(pattern))
        return stamps.digest(words, files, self.root)

    def is_current(self, wanted: dict[str, str]) -> bool:
        """Say whether everything was built from what is there now."""
        return self._built() == wanted

    def _built(self) -> dict[str, str]:
        lines = stamps.read(self._stamp).splitlines()
        return dict(line.split(' ', 1) for line in lines if ' ' in line)

    def _write(self, built: dict[str, str]) -> None:
        stamps.write(self._stamp, '\n'.join(f'{name} {built[name]}' for name in sorted(built)))

    def build(
        self,
        wanted: dict[str, str],
        packages: list[Path],
        colcon: list[str],
        environ: Mapping[str, str],
        progress: Progress,
        lock_fd: int,
    ) -> None:
        """Build what changed; everything, from nothing, if the last build was cut off."""
        built = self._built()
        if built.get('ground') != wanted['ground'] or self._unfinished.exists():
            built = {}
            for folder in (self._build, self.install):
                shutil.rmtree(folder, ignore_errors=True)
        kept = {name: stamp for name, stamp in built.items() if wanted.get(name) == stamp}
        changed = [package for package in packages if package.name not in kept]
        # colcon leaves what a package no longer installs, and stumbles over links to files that
        # are gone. Packages of messages take long and have no links: they are built as they are.
        messages = {package.name for package in packages if (package / 'CMakeLists.txt').exists()}
        self._drop_all_but(messages | set(kept))
        count = 'one package' if len(changed) == 1 else f'{len(changed)} packages'
        progress.start(f'colcon build of {count}')
        self._write(kept)
        # env.sh reads which of the two ways this is: on ROS as installed, or on its wheels.
        stamps.write(self.install / '.way', wanted['ground'].split()[1])
        stamps.write(self._unfinished, 'removed when colcon has ended')
        self.log.unlink(missing_ok=True)
        standins = [package for package in packages if 'standins' in package.parts]
        command = [*colcon, '--log-base', 'log', 'build', '--symlink-install']
        command += ['--event-handlers', 'console_direct-', 'console_cohesion-']
        command += ['--base-paths', '.', *(str(p.relative_to(self.root)) for p in standins)]
        if kept:
            command += ['--packages-select', *(package.name for package in changed)]
        done = 0

        def on_line(line: str) -> None:
            nonlocal done
            match = re.match(r'Finished <<< (\S+)', line)
            done += match is not None
            progress.tell(f'{done} of {len(changed)}')

        try:
            if changed:
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
        self._write(wanted)
        progress.done()

    def _drop_all_but(self, names: set[str]) -> None:
        """Remove what was built and installed from other packages."""
        for prefix in self.install.glob('*/'):
            if prefix.is_dir() and prefix.name not in names:
                shutil.rmtree(prefix, ignore_errors=True)
                shutil.rmtree(self._build / prefix.name, ignore_errors=True)
