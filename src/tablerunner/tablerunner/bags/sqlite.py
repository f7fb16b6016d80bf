"""sqlite3 storage of rosbag2, read row by row, past pages that are damaged or cut off."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

from tablerunner.bags.storage import Channel, Damage, Entry
from tablerunner.errors import BagError

_TOPICS = 'SELECT id, name, type, serialization_format, offered_qos_profiles FROM topics'
_TOPICS_WITHOUT_QOS = "SELECT id, name, type, serialization_format, '' FROM topics"
_ROWS = (
    'SELECT id, topic_id, timestamp, typeof(data) FROM messages '
    'WHERE id > ? AND id <= ? ORDER BY id LIMIT ?'
)
_DISORDER = 'rows are out of order'
_HEAD, _LEAST_PAGE = 100, 512  # bytes
_SUFFIXES = ('-journal', '-wal')

Row: TypeAlias = tuple[int, int, int, str]
"""Number, topic, time of reception and kind of data of one row."""


class SqliteStorage:
    """One .db3 file; see `tablerunner.bags.storage.Storage`."""

    def __init__(self, path: Path, number: int = 0) -> None:
        self.path = path
        self._number = number
        self.channels: dict[int, Channel] = {}
        self.entries: list[Entry] = []
        self.damage: list[Damage] = []
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        self._connection: sqlite3.Connection | None = None
        if path.stat().st_size == 0:
            self._note('', 'the file is empty')
            return
        try:
            self._connection = self._open()
            self._topics()
        except (sqlite3.Error, UnicodeDecodeError) as error:
            self._note(
                '',
                f'the table of topics cannot be read ({error})',
                'nothing of this file can be read',
            )
            return
        self._rows()

    def close(self) -> None:
        """Let go of the file."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._copy is not None:
            self._copy.cleanup()
            self._copy = None

    def load(self, entry: Entry) -> bytes:
        """Return the serialised message of a row; BagError when one of its pages is damaged."""
        try:
            query = 'SELECT data FROM messages WHERE id = ?'
            return bytes(self._query(query, (entry[4],)).fetchone()[0])
        except (sqlite3.Error, TypeError) as error:
            raise BagError(f'row {entry[4]} cannot be read ({error})') from error

    def _query(self, text: str, values: tuple[int, ...] = ()) -> sqlite3.Cursor:
        if self._connection is None:
            raise BagError(f'{self.path} is closed')
        return self._connection.execute(text, values)

    # -- opening ----------------------------------------------------------------------------

    def _open(self) -> sqlite3.Connection:
        size = self.path.stat().st_size
        with self.path.open('rb') as head:
            begin = head.read(_HEAD)
        # As the format says, 1 stands for 65536.
        page = {1: 65536}.get(value := int.from_bytes(begin[16:18], 'big'), value)
        stated = int.from_bytes(begin[28:32], 'big')
        journals = [self.path.with_name(self.path.name + end) for end in _SUFFIXES]
        journals = [file for file in journals if file.exists() and file.stat().st_size]
        if journals:
            # A recorder died while writing. SQLite repairs that, but only in a file that it may
            # write to; the bag itself stays as it is.
            self._note('', 'the recorder did not close it', 'read as of its last whole commit')
            connection = sqlite3.connect(self._working_copy(journals, size))
        elif page >= _LEAST_PAGE and size % page:
            # SQLite would fill the page that is cut with zeros, and messages on it as well.
            connection = sqlite3.connect(self._working_copy([], size - size % page))
        else:
            address = f'{self.path.resolve().as_uri()}?mode=ro&immutable=1'
            connection = sqlite3.connect(address, uri=True)
        if not journals and page >= _LEAST_PAGE and size < stated * page:
            lost = f'{stated - size // page} of {stated} pages are missing'
            self._note(f'byte {size}', 'the file is cut off', lost)
        # Otherwise SQLite refuses a file that is shorter than its head says, as a whole.
        connection.execute('PRAGMA writable_schema = ON')
        connection.execute('PRAGMA query_only = ON')
        return connection

    def _working_copy(self, journals: list[Path], size: int) -> Path:
        """Return a copy of the first bytes of the file, with journals beside it."""
        self._copy = tempfile.TemporaryDirectory(prefix='tablerunner-bag-')
        folder = Path(self._copy.name)
        for file in (self.path, *journals):
            shutil.copyfile(file, folder / file.name)
        with (folder / self.path.name).open('r+b') as stream:
            stream.truncate(size)
        return folder / self.path.name

    def _topics(self) -> None:
        columns = {row[1] for row in self._query('PRAGMA table_info(topics)')}
        if not columns:
            raise sqlite3.DatabaseError('there is none')
        query = _TOPICS if 'offered_qos_profiles' in columns else _TOPICS_WITHOUT_QOS
        definitions = self._definitions()
        for key, name, msgtype, serialization, profiles in self._query(query):
            if not all(isinstance(word, str) for word in (name, msgtype, serialization, profiles)):
                self._note(f'topic {key}', 'its row is damaged', 'its messages are left out')
                continue
            encoding, text = definitions.get(msgtype, ('', ''))
            self.channels[key] = Channel(name, msgtype, encoding, text, serialization, profiles)

    def _definitions(self) -> dict[str, tuple[str, str]]:
        try:
            if not self._query('PRAGMA table_info(message_definitions)').fetchall():
                return {}
            rows = self._query(
                'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
            )
            return {row[0]: (row[1], row[2]) for row in rows}
        except sqlite3.Error as error:
            self._note(
                'message definitions', str(error), 'definitions known to this program are used'
            )
            return {}

    # -- rows -------------------------------------------------------------------------------

    def _rows(self) -> None:
        strangers = empty = 0
        for key, topic, stamp, kind in self._walk():
            if kind != 'blob' or not isinstance(topic, int) or not isinstance(stamp, int):
                empty += 1
            elif topic not in self.channels:
                strangers += 1
            else:
                self.entries.append((stamp, self._number, len(self.entries), topic, key, 0, 0))
        if empty:
            self._note('', f'{empty} rows hold no message', 'left out')
        if strangers:
            self._note('', f'{strangers} messages belong to no topic', 'left out')

    def _walk(self) -> Iterator[Row]:
        """Yield rows in the order of their numbers; pass over what cannot be read and note it.

        A damaged page may hold any number: each row must have a greater one than that before it,
        or this would never end.
        """
        last, end = 0, self._greatest()
        while last < end:
            reason = _DISORDER
            try:
                for row in self._rows_after(last, end):
                    if not last < row[0] <= end:
                        break
                    yield row
                    last = row[0]
            except sqlite3.Error as error:
                reason = str(error)
            if last < end:
                following = self._readable_from(last + 1, end)
                through = end if following is None else following[0] - 1
                if through > last:
                    self._note(f'messages {last + 1} to {through}', reason, 'missing')
                last = through
                if following is not None:
                    # Python steps one row ahead: this one was lost to what comes behind it.
                    yield following
                    last = following[0]

    def _greatest(self) -> int:
        """Return the greatest row number, or one that it cannot exceed."""
        most = self.path.stat().st_size  # a row takes several bytes
        try:
            found = self._query('SELECT max(id) FROM messages').fetchone()[0]
        except sqlite3.Error:
            return most
        if found is None:
            return 0
        return min(found, most) if isinstance(found, int) else most

    def _rows_after(self, last: int, end: int, limit: int = -1) -> Iterator[Row]:
        yield from self._query(_ROWS, (last, end, limit))

    def _readable_from(self, first: int, end: int) -> Row | None:
        """Return the first row that can be read at or after `first`.

        Found by ever larger steps and then by halving: a row that can be read between two that
        cannot may be passed over.
        """
        step = 1
        while self._row_from(first + step - 1, end) is None:
            if first + step - 1 >= end:
                return None
            step = min(2 * step, end - first + 1)
        low, high = first + step // 2 - 1, first + step - 1
        while high - low > 1:
            middle = (low + high) // 2
            if self._row_from(middle, end) is None:
                low = middle
            else:
                high = middle
        return self._row_from(high, end)

    def _row_from(self, first: int, end: int) -> Row | None:
        try:
            row = next(self._rows_after(first - 1, end, 1), None)
        except sqlite3.Error:
            return None
        return row if row is not None and first <= row[0] <= end else None

    def _note(self, place: str, reason: str, lost: str = '') -> None:
        self.damage.append(Damage(self.path.name, place, reason, lost))
