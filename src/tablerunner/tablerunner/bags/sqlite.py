"""sqlite3 storage of rosbag2, read row by row, past pages that are damaged or cut off."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tablerunner.bags.storage import Channel, Damage, Entry
from tablerunner.errors import BagError

_SUFFIXES = ('-journal', '-wal')


class SqliteStorage:
    """One .db3 file; see `tablerunner.bags.storage.Storage`."""

    def __init__(self, path: Path, number: int = 0) -> None:
        self.path = path
        self._number = number
        self.channels: dict[int, Channel] = {}
        self.entries: list[Entry] = []
        self.damage: list[Damage] = []
        self.metadata = ''
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        self._connection: sqlite3.Connection | None = None
        if path.stat().st_size == 0:
            self._note('', 'the file is empty')
            return
        try:
            self._connection = self._open()
            self._topics()
        except (sqlite3.Error, UnicodeDecodeError) as error:
            self._note('', f'the table of topics cannot be read ({error})', 'nothing of this '
                       'file can be read')
            return
        self._rows()
        self._inner_metadata()

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
        assert self._connection is not None
        try:
            query = 'SELECT data FROM messages WHERE id = ?'
            return bytes(self._connection.execute(query, (entry[4],)).fetchone()[0])
        except (sqlite3.Error, TypeError) as error:
            raise BagError(f'row {entry[4]} cannot be read ({error})') from error

    # -- opening ----------------------------------------------------------------------------

    def _open(self) -> sqlite3.Connection:
        journals = [self.path.with_name(self.path.name + end) for end in _SUFFIXES]
        journals = [file for file in journals if file.exists() and file.stat().st_size]
        if journals:
            # A recorder died while writing. SQLite repairs that, but only in a file that it may
            # write to; the bag itself stays as it is.
            self._copy = tempfile.TemporaryDirectory(prefix='tablerunner-bag-')
            for file in (self.path, *journals):
                shutil.copyfile(file, Path(self._copy.name) / file.name)
            self._note('', 'the recorder did not close it', 'read as of its last whole commit')
            connection = sqlite3.connect(Path(self._copy.name) / self.path.name)
        else:
            address = f'{self.path.resolve().as_uri()}?mode=ro&immutable=1'
            connection = sqlite3.connect(address, uri=True)
        # Otherwise SQLite refuses a file that is shorter than its head says, as a whole.
        connection.execute('PRAGMA writable_schema = ON')
        connection.execute('PRAGMA query_only = ON')
        pages = connection.execute('PRAGMA page_size').fetchone()[0]
        with self.path.open('rb') as file:
            stated = int.from_bytes(file.read(32)[28:], 'big')
        present = self.path.stat().st_size // pages
        if not journals and present < stated:
            self._note(f'byte {self.path.stat().st_size}', 'the file is cut off',
                       f'{stated - present} of {stated} pages are missing')
        return connection

    def _topics(self) -> None:
        assert self._connection is not None
        columns = {row[1] for row in self._connection.execute('PRAGMA table_info(topics)')}
        if not columns:
            raise sqlite3.DatabaseError('there is none')
        qos = 'offered_qos_profiles' if 'offered_qos_profiles' in columns else "''"
        definitions = self._definitions()
        for key, name, msgtype, serialization, profiles in self._connection.execute(
            f'SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id'
        ):
            encoding, text = definitions.get(msgtype, ('', ''))
            self.channels[key] = Channel(name, msgtype, encoding, text, serialization, profiles)

    def _definitions(self) -> dict[str, tuple[str, str]]:
        assert self._connection is not None
        try:
            if not self._connection.execute('PRAGMA table_info(message_definitions)').fetchall():
                return {}
            rows = self._connection.execute(
                'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
            )
            return {row[0]: (row[1], row[2]) for row in rows}
        except sqlite3.Error as error:
            self._note('message definitions', str(error), 'definitions known to this program '
                       'are used')
            return {}

    def _inner_metadata(self) -> None:
        assert self._connection is not None
        try:
            row = self._connection.execute('SELECT metadata FROM metadata LIMIT 1').fetchone()
        except (sqlite3.Error, UnicodeDecodeError):
            return  # older versions have none, and metadata.yaml says the same
        self.metadata = row[0] if row and isinstance(row[0], str) else ''

    # -- rows -------------------------------------------------------------------------------

    def _rows(self) -> None:
        strangers = 0
        for key, topic, stamp, kind in self._walk():
            if kind != 'blob' or not isinstance(topic, int) or not isinstance(stamp, int):
                self._note(f'message {key}', 'a row holds no message', 'left out')
            elif topic not in self.channels:
                strangers += 1
            else:
                self.entries.append(
                    (stamp, self._number, len(self.entries), topic, key, 0, 0)
                )
        if strangers:
            self._note('', f'{strangers} messages belong to no topic', 'left out')

    def _walk(self) -> Iterator[tuple[int, int, int, str]]:
        """Yield rows in their order; pass over what cannot be read and note it."""
        last = -1
        while True:
            try:
                for row in self._after(last):
                    yield row
                    last = row[0]
                return
            except sqlite3.Error as error:
                following = self._readable_after(last + 1)
                first = last + 1
                if following is None:
                    self._note(f'messages from {first} on', str(error), 'missing')
                    return
                self._note(f'messages {first} to {following - 1}', str(error), 'missing')
                last = following - 1

    def _after(self, last: int, limit: int = -1) -> Iterator[tuple[int, int, int, str]]:
        assert self._connection is not None
        yield from self._connection.execute(
            'SELECT id, topic_id, timestamp, typeof(data) FROM messages '
            'WHERE id > ? ORDER BY id LIMIT ?',
            (last, limit),
        )

    def _readable_after(self, first: int) -> int | None:
        """Return the first row number at or after one from which reading works again."""
        step, working = 1, None
        while step < 1 << 40:
            row = self._try_from(first + step)
            if row is not None:
                working = row
                break
            step *= 2
        if working is None:
            return None
        low, high = first + step // 2, first + step
        while high - low > 1:
            middle = (low + high) // 2
            if self._try_from(middle) is None:
                low = middle
            else:
                high = middle
        return self._try_from(high)

    def _try_from(self, first: int) -> int | None:
        try:
            return next((row[0] for row in self._after(first - 1, 1)), None)
        except sqlite3.Error:
            return None

    def _note(self, place: str, reason: str, lost: str = '') -> None:
        self.damage.append(Damage(self.path.name, place, reason, lost))
