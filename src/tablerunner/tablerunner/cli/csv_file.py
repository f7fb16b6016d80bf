"""CSV files that a command writes."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tablerunner.errors import ConfigError


def write_csv(file: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows that all have the same names; parent folders are made.

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    lines = list(rows)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open('w', newline='', encoding='utf-8') as target:
            writer = csv.DictWriter(target, list(lines[0]) if lines else [])
            writer.writeheader()
            writer.writerows(lines)
    except OSError as error:
        raise ConfigError(
            '', str(file), f'a file that can be written ({error.strerror})'
        ) from error
