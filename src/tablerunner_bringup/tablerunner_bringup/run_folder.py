"""The folder of one run: parameter files, logs, the bag."""

from __future__ import annotations

import datetime as dt
import shutil
from dataclasses import dataclass
from pathlib import Path

from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class RunFolder:
    """Where a run puts what it writes."""

    path: Path

    @classmethod
    def new(cls, parent: Path, name: str) -> RunFolder:
        """Make a folder that no other run has, named by the time and, if need be, a number.

        Raises
        ------
        ConfigError
            It cannot be made.
        """
        stamp = dt.datetime.now().astimezone().strftime('%Y-%m-%d_%H-%M-%S')
        number = 1
        while True:
            path = parent / (f'{stamp}_{name}' if number == 1 else f'{stamp}_{name}_{number}')
            try:
                path.mkdir(parents=True)
            except FileExistsError:
                number += 1
                continue
            except OSError as error:
                raise _unusable(path, error) from error
            return cls(path)

    def prepare(self, scenario: Path) -> RunFolder:
        """Make the folders inside and copy the scenario into it, for whoever reads the bag.

        Raises
        ------
        ConfigError
            The folder cannot be written.
        """
        try:
            self.logs.mkdir(parents=True, exist_ok=True)
            self.parameters.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(scenario, self.scenario)
        except OSError as error:
            raise _unusable(self.path, error) from error
        return self

    def clear(self) -> None:
        """Delete what an earlier run wrote here, and nothing else: a user chose the folder.

        Raises
        ------
        ConfigError
            Something of it cannot be deleted.
        """
        try:
            for folder in (self.logs, self.parameters, self.bag):
                if folder.is_dir():
                    shutil.rmtree(folder)
            for file in (self.scenario, self.errors, self.picture):
                file.unlink(missing_ok=True)
        except OSError as error:
            raise _unusable(self.path, error) from error

    @property
    def scenario(self) -> Path:
        """Copy of the scenario."""
        return self.path / 'scenario.yaml'

    @property
    def errors(self) -> Path:
        """Errors of the demo's trip."""
        return self.path / 'errors.json'

    @property
    def picture(self) -> Path:
        """Picture of the demo's trip."""
        return self.path / 'trip.png'

    @property
    def logs(self) -> Path:
        """Folder of the logs, one for each process."""
        return self.path / 'logs'

    @property
    def parameters(self) -> Path:
        """Folder of the ROS parameter files, one for each node."""
        return self.path / 'params'

    @property
    def bag(self) -> Path:
        """Folder of the bag; made by the recorder."""
        return self.path / 'bag'

    def log(self, name: str) -> Path:
        """Return the log of a process."""
        return self.logs / f'{_flat(name)}.log'

    def parameter_file(self, name: str) -> Path:
        """Return the ROS parameter file of a node."""
        return self.parameters / f'{_flat(name)}.yaml'


def _flat(name: str) -> str:
    """Return the name of a file for a node of one of several robots."""
    return name.replace('/', '.')


def _unusable(path: Path, error: OSError) -> ConfigError:
    reason = error.strerror or error
    return ConfigError('output', str(path), f'a folder that can be written ({reason})')
