"""True positions from a text file, as a surveyor or a motion capture gives them."""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation
from pathlib import Path

from tablerunner.errors import ConfigError
from tablerunner.evaluation.truth import Truth
from tablerunner.geometry.pose import Pose2

COLUMNS = ('t', 'x', 'y', 'heading')
"""Time [s, on the clock of the bag's stamps], base_link in map [m, m, rad]."""


def read_truth(file: Path) -> Truth:
    """Read true positions: one line ``t,x,y`` or ``t,x,y,heading`` each, after one header line.

    Raises
    ------
    ConfigError
        Not readable, a line that is no such numbers, a time that does not advance, fewer than two
        lines; with the file and the line.
    """
    try:
        lines = file.read_text(encoding='utf-8').splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError('', str(file), f'a readable text file ({error})') from error
    poses: list[tuple[int, Pose2, bool]] = []
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        words = [word.strip() for word in line.split(',')]
        try:
            # Seconds of today with nine decimals do not fit into a double.
            stamp = int(Decimal(words[0]).scaleb(9))
            numbers = [float(word) for word in words[1:]] if 0 <= stamp < 2**63 else []
        except (InvalidOperation, ValueError, OverflowError):
            numbers = []
        if len(numbers) not in (2, 3) or not all(math.isfinite(item) for item in numbers):
            expected = f'{",".join(COLUMNS[:3])}[,{COLUMNS[3]}]: numbers in s, m, m, rad'
            raise ConfigError('', line, expected, str(file), number)
        if poses and stamp <= poses[-1][0]:
            raise ConfigError('t', words[0], 'a later time than before', str(file), number)
        heading = numbers[2] if len(numbers) == 3 else 0.0
        poses.append((stamp, Pose2(numbers[0], numbers[1], heading), len(numbers) == 3))
    if len(poses) < 2:
        raise ConfigError('', f'{len(poses)} positions', 'two or more after a header', str(file))
    return Truth.from_poses(poses)
