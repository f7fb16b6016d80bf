"""JSON files that a command writes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from tablerunner.errors import ConfigError


def write_json(file: Path, content: Any) -> None:
    """Write JSON with NaN and infinities as null; parent folders are made.

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(_strict(content), indent=2) + '\n', encoding='utf-8')
    except OSError as error:
        raise ConfigError(
            '', str(file), f'a file that can be written ({error.strerror})'
        ) from error


def _strict(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _strict(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_strict(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
