"""MCAP files, read record by record from the front: a cut-off file is read like a whole one.

The format: https://mcap.dev/spec. Nothing but the data section is needed; the index at the end is
only used to find the way past a damaged place, and its absence is reported.
"""

from __future__ import annotations

import mmap
import re
import struct
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path

from tablerunner.bags.compression import decompress
from tablerunner.bags.storage import Channel, Damage, Entry

MAGIC = b'\x89MCAP0\r\n'
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
_DATA_END = 0x0F
_LAST_OPCODE = 0x0F
_PREFIX = struct.Struct('<BQ')
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_MESSAGE_START = struct.Struct('<BQHIQQ')  # prefix and head together
_CHUNK_HEAD = struct.Struct('<QQQI')
_U16 = struct.Struct('<H')
_U32 = struct.Struct('<I')
_U64 = struct.Struct('<Q')
_CHUNK_START = re.compile(
    rb'\x06(?=.{8}.{8}.{8}.{8}.{4}(?:\x00{4}|\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd))', re.DOTALL
)
_FOOTER_SIZE = 20
_KEPT_CHUNKS = 4


class McapStorage:
    """One MCAP file; see `tablerunner.bags.storage.Storage`."""

    def __init__(self, path: Path, number: int = 0) -> None:
        self.path = path
        self._number = number
        self.channels: dict[int, Channel] = {}
        self.entries: list[Entry] = []
        self.damage: list[Damage] = []
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._orphans: dict[int, int] = {}
        self._chunks: dict[int, tuple[int, int, str, int]] = {}  # offset, size, kind, raw size
        self._loaded: OrderedDict[int, bytes | memoryview] = OrderedDict()
        self._file = path.open('rb')
        size = path.stat().st_size
        self._map = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ) if size else None
        self._data: bytes | mmap.mmap = self._map if self._map is not None else b''
        self._scan()

    def close(self) -> None:
        """Let go of the file."""
        self._loaded.clear()
        self._data = b''
        if self._map is not None:
            self._map.close()
        self._file.close()

    def load(self, entry: Entry) -> bytes:
        """Return the serialised message of an entry."""
        chunk, start, end = entry[4:]
        if chunk < 0:
            return self._data[start:end]
        if chunk not in self._loaded:
            self._loaded[chunk] = self._open_chunk(chunk)[0]
            if len(self._loaded) > _KEPT_CHUNKS:
                self._loaded.popitem(last=False)
        return bytes(self._loaded[chunk][start:end])

    # -- reading the file from the front ----------------------------------------------------

    def _scan(self) -> None:
        size = len(self._data)
        if size == 0:
            self._note('', 'the file is empty')
            return
        position = len(MAGIC)
        if self._data[: len(MAGIC)] != MAGIC[: min(size, len(MAGIC))]:
            self._note('byte 0', 'the file does not begin as an MCAP file does')
            position = self._next_chunk(0)
        ended = False
        while position < size and not ended:
            position, ended = self._top_level(position, size)
        whole = self._read_footer(size)
        if not ended:
            self._note(
                f'byte {size}',
                'the file ends without its closing records',
                'it was cut off or never closed; what stood behind is missing',
            )
        elif not whole:
            self._note(
                f'byte {size}', 'the index at the end is damaged', 'no message is lost by that'
            )
        self._settle_orphans()

    def _top_level(self, position: int, size: int) -> tuple[int, bool]:
        """Read the record at a position; return where the next one is, and whether it was last."""
        if size - position < _PREFIX.size:
            return size, False
        opcode, length = _PREFIX.unpack_from(self._data, position)
        body = position + _PREFIX.size
        end = body + length
        if opcode == _CHUNK:
            if not self._chunk(position, body, min(end, size), whole=end <= size):
                return self._next_chunk(position + 1), False
            return end, False
        if not 0 < opcode <= _LAST_OPCODE and opcode < 0x80:
            following = self._next_chunk(position + 1)
            self._note(
                f'byte {position}',
                'no MCAP record begins here',
                f'{following - position} bytes passed over',
            )
            return following, False
        if end > size:
            following = self._next_chunk(position + 1)
            if following < size:
                self._note(
                    f'byte {position}',
                    'a record is longer than the file',
                    f'{following - position} bytes passed over',
                )
            return following, False
        if opcode in (_DATA_END, _FOOTER):
            return end, True
        try:
            self._record(opcode, self._data, body, end, -1)
        except (struct.error, UnicodeDecodeError, IndexError):
            self._note(f'byte {position}', f'a record of kind {opcode} cannot be read')
        return end, False

    def _chunk(self, position: int, body: int, end: int, whole: bool) -> bool:
        """Read a chunk as far as it goes; return False when its head makes no sense."""
        try:
            _, _, raw_size, checksum = _CHUNK_HEAD.unpack_from(self._data, body)
            kind, data = _text(self._data, body + _CHUNK_HEAD.size, end)
            (size,) = _U64.unpack_from(self._data, data)
        except (struct.error, UnicodeDecodeError, IndexError):
            if whole:
                self._note(f'byte {position}', 'the head of a chunk cannot be read')
            return not whole
        data += _U64.size
        if whole and data + size != end:
            self._note(f'byte {position}', 'the head of a chunk contradicts its length')
            return False
        size = min(size, end - data)
        number = len(self._chunks)
        self._chunks[number] = (data, size, kind, raw_size)
        raw, problem = self._open_chunk(number, checksum if whole else 0)
        if problem:
            self._note(
                f'byte {position}',
                problem,
                'its messages are missing' if not raw else 'what it still gives was read',
            )
        elif not whole:
            self._note(
                f'byte {end}',
                'the last chunk is cut off',
                f'{len(raw)} of {raw_size} bytes of it are left',
            )
        self._chunk_records(number, raw, complete=len(raw) == raw_size, position=position)
        return True

    def _chunk_records(
        self, number: int, raw: bytes | memoryview, complete: bool, position: int
    ) -> None:
        here, size = 0, len(raw)
        entries, file, unpack = self.entries, self._number, _MESSAGE_START.unpack_from
        while size - here >= _PREFIX.size:
            # Nearly all are messages: read them without a call each.
            while size - here >= _MESSAGE_START.size:
                opcode, length, channel, _, stamp, _ = unpack(raw, here)
                end = here + _PREFIX.size + length
                if opcode != _MESSAGE or length < _MESSAGE_HEAD.size or end > size:
                    break
                start = here + _MESSAGE_START.size
                entries.append((stamp, file, len(entries), channel, number, start, end))
                here = end
            if size - here < _PREFIX.size:
                break
            opcode, length = _PREFIX.unpack_from(raw, here)
            body = here + _PREFIX.size
            end = body + length
            if opcode not in (_SCHEMA, _CHANNEL, _MESSAGE) and opcode < 0x80:
                self._note(
                    f'byte {position}',
                    f'a chunk holds a record of kind {opcode} at its byte {here}',
                    f'the last {size - here} bytes of the chunk are missing',
                )
                return
            if end > size:
                break
            try:
                self._record(opcode, raw, body, end, number)
            except (struct.error, UnicodeDecodeError, IndexError):
                self._note(f'byte {position}', f'a record of a chunk cannot be read ({opcode})')
            here = end
        if here < size and complete:
            self._note(
                f'byte {position}',
                f'a record of a chunk is longer than the chunk, at its byte {here}',
                f'the last {size - here} bytes of the chunk are missing',
            )

    def _record(
        self, opcode: int, data: bytes | memoryview | mmap.mmap, body: int, end: int, chunk: int
    ) -> None:
        if opcode == _MESSAGE:
            channel, _, stamp, _ = _MESSAGE_HEAD.unpack_from(data, body)
            if body + _MESSAGE_HEAD.size > end:
                raise struct.error
            start = body + _MESSAGE_HEAD.size
            self.entries.append(
                (stamp, self._number, len(self.entries), channel, chunk, start, end)
            )
        elif opcode == _SCHEMA:
            (key,) = _U16.unpack_from(data, body)
            name, here = _text(data, body + 2, end)
            encoding, here = _text(data, here, end)
            text, _ = _text(data, here, end)
            self._schemas.setdefault(key, (name, encoding, text))
        elif opcode == _CHANNEL:
            (key,) = _U16.unpack_from(data, body)
            (schema,) = _U16.unpack_from(data, body + 2)
            topic, here = _text(data, body + 4, end)
            serialization, here = _text(data, here, end)
            qos = _mapping(data, here, end).get('offered_qos_profiles', '')
            name, encoding, text = self._schemas.get(schema, ('', '', ''))
            if key not in self.channels or (name and not self.channels[key].msgtype):
                self.channels[key] = Channel(topic, name, encoding, text, serialization, qos)

    # -- past damaged places ----------------------------------------------------------------

    def _next_chunk(self, position: int) -> int:
        """Return where the next plausible chunk begins, or the end of the file."""
        size = len(self._data)
        for match in _CHUNK_START.finditer(self._data, position):
            start = match.start()
            (length,) = _U64.unpack_from(self._data, start + 1)
            text = start + _PREFIX.size + _CHUNK_HEAD.size
            (words,) = _U32.unpack_from(self._data, text)
            if text + 12 + words > size:
                continue
            (inner,) = _U64.unpack_from(self._data, text + 4 + words)
            if length == _CHUNK_HEAD.size + 12 + words + inner:
                return start
        return size

    def _read_footer(self, size: int) -> bool:
        """Take channels from the summary at the end, for chunks whose own are damaged.

        Return whether the end is as it should be.
        """
        start = size - len(MAGIC) - _PREFIX.size - _FOOTER_SIZE
        if start < 0 or self._data[size - len(MAGIC) :] != MAGIC:
            return False
        if _PREFIX.unpack_from(self._data, start) != (_FOOTER, _FOOTER_SIZE):
            return False
        (summary,) = _U64.unpack_from(self._data, start + _PREFIX.size)
        if not summary:
            return True
        if summary > start:
            return False
        for opcode, body, end in _records(self._data, summary, start):
            if opcode in (_SCHEMA, _CHANNEL):
                try:
                    self._record(opcode, self._data, body, end, -1)
                except (struct.error, UnicodeDecodeError, IndexError):
                    return False
        return True

    def _settle_orphans(self) -> None:
        """Drop messages whose topic is not known, and say so."""
        known = {key for key, channel in self.channels.items() if channel.msgtype}
        lost = sum(entry[3] not in known for entry in self.entries)
        if lost:
            self.entries = [entry for entry in self.entries if entry[3] in known]
            self._note(
                '',
                'the record that names a topic is missing',
                f'{lost} messages of it cannot be read',
            )

    # -- helpers ----------------------------------------------------------------------------

    def _open_chunk(self, number: int, checksum: int = 0) -> tuple[bytes | memoryview, str]:
        offset, size, kind, raw_size = self._chunks[number]
        return decompress(self._data[offset : offset + size], kind, raw_size, checksum)

    def _note(self, place: str, reason: str, lost: str = '') -> None:
        self.damage.append(Damage(self.path.name, place, reason, lost))


def _text(data: bytes | memoryview | mmap.mmap, start: int, end: int) -> tuple[str, int]:
    """Return a length-prefixed string and where it ends; IndexError when it does not fit."""
    (length,) = _U32.unpack_from(data, start)
    stop = start + 4 + length
    if stop > end:
        raise IndexError
    return bytes(data[start + 4 : stop]).decode(), stop


def _mapping(data: bytes | memoryview | mmap.mmap, start: int, end: int) -> dict[str, str]:
    (length,) = _U32.unpack_from(data, start)
    here, stop = start + 4, start + 4 + length
    if stop > end:
        raise IndexError
    pairs = {}
    while here < stop:
        key, here = _text(data, here, stop)
        pairs[key], here = _text(data, here, stop)
    return pairs


def _records(
    data: bytes | memoryview | mmap.mmap, start: int, end: int
) -> Iterator[tuple[int, int, int]]:
    while end - start >= _PREFIX.size:
        opcode, length = _PREFIX.unpack_from(data, start)
        body = start + _PREFIX.size
        if body + length > end:
            return
        yield opcode, body, body + length
        start = body + length
