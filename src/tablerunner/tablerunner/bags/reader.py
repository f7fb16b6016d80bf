"""Read bags: whole ones, and what is left of damaged ones."""

from __future__ import annotations

import struct
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_typestore

from tablerunner.bags.compression import decompress_file, decompress_message
from tablerunner.bags.definitions import TypeStore, known_types, parse_definition
from tablerunner.bags.folder import METADATA, BagFolder
from tablerunner.bags.mcap import McapStorage
from tablerunner.bags.sqlite import SqliteStorage
from tablerunner.bags.storage import Channel, Damage, Entry, Storage
from tablerunner.errors import BagError

_DECODE_ERRORS = (
    SerdeError,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    OverflowError,
    struct.error,
)


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """What a bag holds of one topic."""

    name: str
    msgtype: str
    count: int
    qos: str = ''  # offered QoS profiles, YAML as in the bag
    expected: int | None = None  # messages according to metadata.yaml; None: it does not say


class RawMessage(NamedTuple):
    """One message as it was received, serialised."""

    topic: str
    stamp: int  # [ns] time of reception
    msgtype: str
    data: bytes


class BagMessage(NamedTuple):
    """One message, deserialised by `rosbags`: attributes as in its definition."""

    topic: str
    stamp: int  # [ns] time of reception
    msgtype: str
    message: Any


class BagReader:
    """A bag folder, or a single .mcap or .db3 file, opened for reading.

    Messages come in the order of reception; at equal times in the order in which they were
    written. What cannot be read is told in `damage` and never raises.

    Parameters
    ----------
    path : Path or str
        The bag.

    Raises
    ------
    BagError
        There is no bag at `path`.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._folder = BagFolder.find(self.path)
        self._storages: list[Storage] = []
        self._temporary: list[tempfile.TemporaryDirectory[str]] = []
        self._types: dict[tuple[str, str], TypeStore | None] = {}
        self._undecoded: dict[tuple[str, str], tuple[int, int, str]] = {}
        self._type_damage: list[Damage] = []
        for number, file in enumerate(self._folder.files):
            self._open(file, number)
        self._entries = sorted(entry for storage in self._storages for entry in storage.entries)
        self.topics = self._summarize()

    # -- what is in it ----------------------------------------------------------------------

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What is missing; messages that do not deserialise are known once they were read."""
        found = list(self._folder.damage)
        for storage in self._storages:
            found.extend(storage.damage)
        found.extend(self._type_damage)
        found.extend(self._count_damage())
        for (file, topic), (count, stamp, reason) in sorted(self._undecoded.items()):
            noun = 'message' if count == 1 else 'messages'
            found.append(
                Damage(
                    file,
                    topic,
                    f'{count} {noun} cannot be decoded, the first at {stamp} ns: {reason}',
                    'left out',
                )
            )
        return tuple(found)

    @property
    def message_count(self) -> int:
        """Number of messages that can be reached."""
        return len(self._entries)

    @property
    def start(self) -> int:
        """Time of reception of the first message [ns]; 0 when there is none."""
        return self._entries[0][0] if self._entries else 0

    @property
    def end(self) -> int:
        """Time of reception of the last message [ns]; 0 when there is none."""
        return self._entries[-1][0] if self._entries else 0

    def topic(self, name: str) -> TopicInfo | None:
        """Return what the bag holds of a topic, None when it does not hold it."""
        return next((item for item in self.topics if item.name == name), None)

    def definition(self, name: str) -> tuple[str, str] | None:
        """Return encoding and text of the definition that the bag holds of a message type."""
        for storage in self._storages:
            for channel in storage.channels.values():
                if channel.msgtype == name and channel.definition:
                    return channel.encoding, channel.definition
        return None

    # -- messages ---------------------------------------------------------------------------

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Yield serialised messages, of some topics or of all."""
        for channel, entry in self._selected(topics):
            data = self._load(channel, entry)
            if data is not None:
                yield RawMessage(channel.topic, entry[0], channel.msgtype, data)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yield deserialised messages, of some topics or of all; the others cost nothing."""
        for channel, entry in self._selected(topics):
            store = self._types_of(channel)
            data = self._load(channel, entry)
            if data is None or store is None:
                continue
            try:
                message = store.deserialize_cdr(data, channel.msgtype)
            except _DECODE_ERRORS as error:
                self.refuse(channel.topic, entry[0], str(error), entry[1])
                continue
            yield BagMessage(channel.topic, entry[0], channel.msgtype, message)

    def refuse(self, topic: str, stamp: int, reason: str, file: int = 0) -> None:
        """Count a message as damaged: it decodes to something that its type does not allow."""
        name = self._folder.files[file].name
        count, first, words = self._undecoded.get((name, topic), (0, stamp, reason))
        self._undecoded[(name, topic)] = (count + 1, first, words)

    def close(self) -> None:
        """Let go of the files."""
        for storage in self._storages:
            storage.close()
        for folder in self._temporary:
            folder.cleanup()

    def __enter__(self) -> BagReader:
        """Return the reader itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the bag."""
        self.close()

    # -- inside -----------------------------------------------------------------------------

    def _open(self, file: Path, number: int) -> None:
        readable = file
        try:
            if file.suffix == '.zstd':
                readable = self._unpack(file)
            storage: Storage
            if readable.suffix == '.mcap':
                storage = McapStorage(readable, number)
            else:
                storage = SqliteStorage(readable, number)
        except OSError as error:
            raise BagError(f'{file} cannot be read: {error.strerror or error}') from error
        self._storages.append(storage)

    def _unpack(self, file: Path) -> Path:
        folder = tempfile.TemporaryDirectory(prefix='tablerunner-bag-')
        self._temporary.append(folder)
        raw, problem = decompress_file(file.read_bytes())
        if problem:
            self._folder.damage.append(Damage(file.name, '', problem))
        unpacked = Path(folder.name) / file.stem
        unpacked.write_bytes(raw)
        return unpacked

    def _selected(self, topics: Collection[str] | None) -> Iterator[tuple[Channel, Entry]]:
        wanted = {
            (number, key): channel
            for number, storage in enumerate(self._storages)
            for key, channel in storage.channels.items()
            if topics is None or channel.topic in topics
        }
        for entry in self._entries:
            channel = wanted.get((entry[1], entry[3]))
            if channel is not None:
                yield channel, entry

    def _load(self, channel: Channel, entry: Entry) -> bytes | None:
        try:
            data = self._storages[entry[1]].load(entry)
            return decompress_message(data) if self._folder.message_compression else data
        except (BagError, ValueError) as error:
            self.refuse(channel.topic, entry[0], str(error), entry[1])
            return None

    def _types_of(self, channel: Channel) -> TypeStore | None:
        key = (channel.msgtype, channel.definition)
        if key not in self._types:
            self._types[key] = self._make_types(channel)
        return self._types[key]

    def _make_types(self, channel: Channel) -> TypeStore | None:
        """Return the types by the bag's own definition, by a known one where it has none."""
        known = known_types()
        name = channel.msgtype
        reason = 'the bag holds no definition of it'
        if channel.serialization != 'cdr':
            reason = f'its messages are serialised as {channel.serialization!r}, not as CDR'
            self._type_damage.append(Damage(METADATA, channel.topic, reason, 'left out'))
            return None
        if channel.definition:
            try:
                store = get_typestore(Stores.EMPTY)
                store.register(parse_definition(name, channel.encoding, channel.definition))
                same = name in known.fielddefs and store.hash_rihs01(name) == known.hash_rihs01(
                    name
                )
                return known if same else store
            except (BagError, TypesysError, KeyError, SyntaxError) as error:
                reason = str(error)
        if name in known.fielddefs:
            if channel.definition:
                self._type_damage.append(
                    Damage('', channel.topic, reason, 'the definition known here is used')
                )
            return known
        self._type_damage.append(Damage('', channel.topic, f'{name}: {reason}', 'left out'))
        return None

    def _summarize(self) -> tuple[TopicInfo, ...]:
        counts = Counter((entry[1], entry[3]) for entry in self._entries)
        found: dict[str, TopicInfo] = {}
        for number, storage in enumerate(self._storages):
            for key, channel in storage.channels.items():
                before = found.get(channel.topic)
                found[channel.topic] = TopicInfo(
                    channel.topic,
                    channel.msgtype,
                    counts[number, key] + (before.count if before else 0),
                    channel.qos or (before.qos if before else ''),
                    self._folder.counts.get(channel.topic),
                )
        return tuple(found[name] for name in sorted(found))

    def _count_damage(self) -> list[Damage]:
        """Return where metadata.yaml promises more than was found."""
        found = {item.name: item.count for item in self.topics}
        return [
            Damage(
                METADATA, topic, f'{expected} messages are named, {found.get(topic, 0)} were found'
            )
            for topic, expected in sorted(self._folder.counts.items())
            if found.get(topic, 0) != expected
        ]
