"""The trolley recording of LIAS, CUHK-Shenzhen: three tags, eight anchors, motion capture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tablerunner.errors import ConfigError

Array = NDArray[np.float64]

FOLDER = 'lias_trolley'
ANCHOR_FILE, TAG_FILE = 'anchors.csv', 'tags_body_frame.csv'
RANGE_FILE, TRUTH_FILE = 'fast_uwb_20Hz.csv', 'fast_gt_30Hz.csv'


@dataclass(frozen=True)
class LiasRecording:
    """What the files hold, the truth brought to the times of the ranges.

    Attributes
    ----------
    anchors : ndarray, shape (n, 3)
        [m].
    tags : ndarray, shape (k, 3)
        In the trolley's frame [m].
    times : ndarray, shape (m,)
        [s].
    ranges : ndarray, shape (m, n, k)
        As measured [m].
    position : ndarray, shape (m, 3)
        True place of the trolley's frame [m].
    heading : ndarray, shape (m,)
        True heading, not wrapped [rad].
    """

    anchors: Array
    tags: Array
    times: Array
    ranges: Array
    position: Array
    heading: Array

    def tag_positions(self) -> Array:
        """Return the true places of the tags, shape (m, k, 3) [m]."""
        cos, sin = np.cos(self.heading)[:, None], np.sin(self.heading)[:, None]
        x = self.position[:, 0, None] + cos * self.tags[:, 0] - sin * self.tags[:, 1]
        y = self.position[:, 1, None] + sin * self.tags[:, 0] + cos * self.tags[:, 1]
        return np.stack([x, y, self.position[:, 2, None] + self.tags[:, 2] + 0.0 * x], axis=-1)

    def true_ranges(self) -> Array:
        """Return the distances between all tags and anchors, shape (m, n, k) [m]."""
        tags = self.tag_positions()
        return np.asarray(np.linalg.norm(tags[:, None] - self.anchors[None, :, None], axis=3))


def read_lias(folder: Path) -> LiasRecording:
    """Read the recording.

    The trolley moves in the plane, so that two of the four columns of its quaternion are nearly
    zero. They are the first and the last, whatever the header (x, y, z, w) and the source's readme
    (w first) say: the second is the cosine and the third the sine of half the heading. Read so,
    ranges agree with the truth twice as well as by either of those orders, and all three tags of
    an anchor have the same bias.

    Raises
    ------
    ConfigError
        A file is missing or malformed.
    """
    anchors = _table(folder / ANCHOR_FILE, 4)[:, 1:]
    tags = _table(folder / TAG_FILE, 4)[:, 1:]
    uwb = _table(folder / RANGE_FILE, 1 + len(anchors) * len(tags))
    truth = _table(folder / TRUTH_FILE, 8)
    times = uwb[:, 0]
    heading = np.unwrap(2.0 * np.arctan2(truth[:, 6], truth[:, 5]))
    position = np.column_stack([np.interp(times, truth[:, 0], truth[:, 1 + i]) for i in range(3)])
    return LiasRecording(
        anchors,
        tags,
        times,
        uwb[:, 1:].reshape(-1, len(anchors), len(tags)),
        position,
        np.interp(times, truth[:, 0], heading),
    )


def _table(file: Path, columns: int) -> Array:
    """Return the numbers of a CSV file with one header line; empty fields are NaN."""
    try:
        table = np.genfromtxt(file, delimiter=',', skip_header=1, ndmin=2)
    except OSError as error:
        raise ConfigError('', str(file), 'a file of the recording') from error
    except ValueError as error:
        raise ConfigError('', str(error).split('\n')[0], 'a table', str(file)) from error
    if table.shape[1] != columns or not len(table):
        raise ConfigError('', table.shape, f'lines of {columns} numbers', str(file))
    return np.asarray(table)
