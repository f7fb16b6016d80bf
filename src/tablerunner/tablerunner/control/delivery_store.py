"""The delivery queue on disk: never half-written, and never believed when it is damaged.

A JSON file with schema, version and checksum. It is written beside its place, brought to the disk
and then renamed: whenever the process or the machine stops, either the old queue stands there or
the new one.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from pathlib import Path
from typing import Any

from tablerunner.control.delivery_json import PlaceError, queue_from_json, queue_to_json
from tablerunner.control.delivery_queue import DeliveryQueue
from tablerunner.errors import ConfigError, MissionError

SCHEMA, VERSION = 'tablerunner delivery queue', 1
_GO_ON = 'It is left as it is; move it away to begin with an empty queue'


class DeliveryStore:
    """One file, used by one process at a time.

    Parameters
    ----------
    path : Path
        Its folder is made.

    Raises
    ------
    ConfigError
        The folder cannot be used, or another process uses the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._new = path.with_name(f'.{path.name}.new')
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = path.with_name(f'.{path.name}.lock').open('w')
        except OSError as error:
            raise ConfigError(
                'queue_file', str(path), f'a place that can be written ({error.strerror})'
            ) from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise ConfigError(
                'queue_file', str(path), 'a file that no other process uses'
            ) from None

    def close(self) -> None:
        """Let others use the file; the end of the process does so too."""
        self._lock.close()

    def save(self, queue: DeliveryQueue) -> None:
        """Keep a queue; it is on the disk when this returns.

        Raises
        ------
        MissionError
            The file cannot be written; the one before still stands.
        """
        text = encode(queue)
        try:
            with self._new.open('w', encoding='utf-8') as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            self._new.replace(self.path)
            folder = os.open(self.path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
        except OSError as error:
            raise MissionError(
                f'the queue cannot be kept in {self.path}: {error.strerror}'
            ) from error

    def load(self) -> DeliveryQueue:
        """Return the queue that was kept; an empty one where there is no file.

        Raises
        ------
        ConfigError
            The file is damaged or of another version; it names the place in it.
        """
        try:
            text = self.path.read_bytes().decode('utf-8')
        except FileNotFoundError:
            return DeliveryQueue()
        except OSError as error:
            raise ConfigError(
                '', str(self.path), f'a file that can be read ({error.strerror})'
            ) from None
        except UnicodeDecodeError as error:
            raise self._damaged('', f'byte {error.start}', 'UTF-8 text') from None
        try:
            return decode(text)
        except json.JSONDecodeError as error:
            raise self._damaged('', error.msg, 'JSON', error.lineno) from None
        except PlaceError as error:
            raise self._damaged(error.place, error.value, error.expected) from None

    def _damaged(
        self, place: str, value: Any, expected: str, line: int | None = None
    ) -> ConfigError:
        return ConfigError(place, value, f'{expected}. {_GO_ON}', str(self.path), line)


def encode(queue: DeliveryQueue) -> str:
    """Return the text of a queue's file."""
    deliveries = queue_to_json(queue)
    content = {
        'schema': SCHEMA,
        'version': VERSION,
        'checksum': _checksum(deliveries),
        'deliveries': deliveries,
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + '\n'


def decode(text: str) -> DeliveryQueue:
    """Return the queue of a file's text.

    Raises
    ------
    json.JSONDecodeError
    PlaceError
    """
    content = json.loads(text)
    if not isinstance(content, dict):
        raise PlaceError('', type(content).__name__, 'an object')
    if content.get('schema') != SCHEMA:
        raise PlaceError('schema', content.get('schema'), repr(SCHEMA))
    if content.get('version') != VERSION or isinstance(content['version'], bool):
        raise PlaceError('version', content.get('version'), str(VERSION))
    queue = queue_from_json(content.get('deliveries'), 'deliveries')
    wanted = _checksum(content['deliveries'])
    if content.get('checksum') != wanted:
        raise PlaceError('checksum', content.get('checksum'), f'{wanted}, that of the deliveries')
    return queue


def _checksum(deliveries: Any) -> str:
    text = json.dumps(deliveries, sort_keys=True, separators=(',', ':'))
    return 'sha256:' + hashlib.sha256(text.encode('utf-8')).hexdigest()
