"""Write bags that ROS 2, `rosbags` and Foxglove open, with every message definition inside."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
from rosbags.typesys import TypesysError

from tablerunner.bags.contract import Quality
from tablerunner.bags.definitions import TypeStore, known_types
from tablerunner.errors import BagError

STORAGES = ('mcap', 'sqlite3')
"""The storages that a bag can be written in; the first is the default."""

_PLUGINS = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}
_INFINITE = QosTime(9223372036, 854775807)


@dataclass(frozen=True, slots=True)
class OfferedQuality:
    """Quality of service that a topic's publisher offered."""

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10
    keep_all: bool = False

    @classmethod
    def of(cls, quality: Quality) -> OfferedQuality:
        """Return the quality that the contract names."""
        return cls(quality.reliable, quality.transient_local, quality.depth)

    def to_rosbags(self) -> Qos:
        """Return it as `rosbags` writes it."""
        return Qos(
            QosHistory.KEEP_ALL if self.keep_all else QosHistory.KEEP_LAST,
            self.depth,
            QosReliability.RELIABLE if self.reliable else QosReliability.BEST_EFFORT,
            QosDurability.TRANSIENT_LOCAL if self.transient_local else QosDurability.VOLATILE,
            _INFINITE,
            _INFINITE,
            QosLiveliness.AUTOMATIC,
            _INFINITE,
            False,
        )


class BagWriter:
    """A new bag, open for writing.

    Parameters
    ----------
    path : Path
        Folder of the bag; it must not exist.
    storage : str
        One of `STORAGES`.
    types : TypeStore, optional
        Where definitions are taken from; `known_types` when not given. A recorder of any topic
        passes `types_for`, or adds types later by the argument of `add_topic`.

    Raises
    ------
    BagError
        The folder exists or cannot be made, or the storage is unknown.
    """

    def __init__(self, path: Path, storage: str = STORAGES[0], types: TypeStore = None) -> None:
        if storage not in _PLUGINS:
            raise BagError(f'storage {storage!r} is not known; known are {", ".join(STORAGES)}')
        self.path = Path(path)
        self._types = known_types() if types is None else types
        self._stores: dict[str, tuple[TypeStore, str]] = {}
        self._connections: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        try:
            self._writer = Writer(self.path, version=9, storage_plugin=_PLUGINS[storage])
            self._writer.open()
        except WriterError as error:
            raise BagError(f'{self.path} exists already; a bag is never written over') from error
        except OSError as error:
            raise BagError(f'{self.path} cannot be made: {error.strerror or error}') from error

    def add_topic(
        self,
        topic: str,
        msgtype: str,
        quality: OfferedQuality | Quality = Quality.RELIABLE_10,
        types: TypeStore = None,
    ) -> None:
        """Announce a topic before its first message.

        Parameters
        ----------
        topic : str
            Full name; a leading slash is added where it is missing, as rosbag2 has them.
        msgtype : str
            Full type name, e.g. ``sensor_msgs/msg/Imu``.
        quality : OfferedQuality or Quality
            What a player is to offer.
        types : TypeStore, optional
            Where the definition is; the bag's own when not given.

        Raises
        ------
        BagError
            The topic was announced before, or no definition of its type is known.
        """
        name = absolute(topic)
        store = self._types if types is None else types
        if name in self._connections:
            raise BagError(f'topic {name} was announced twice')
        offered = OfferedQuality.of(quality) if isinstance(quality, Quality) else quality
        try:
            self._connections[name] = self._writer.add_connection(
                name, msgtype, typestore=store, offered_qos_profiles=[offered.to_rosbags()]
            )
        except (TypesysError, KeyError) as error:
            raise BagError(f'topic {name}: no definition of {msgtype} is known') from error
        self._stores[name] = (store, msgtype)
        self.counts[name] = 0

    def write(self, topic: str, stamp: int, message: Any) -> None:
        """Write a message of `rosbags`, received at `stamp` [ns]."""
        name = absolute(topic)
        store, msgtype = self._stores[name]
        self.write_raw(name, stamp, store.serialize_cdr(message, msgtype))

    def write_raw(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Write a message that is serialised already, received at `stamp` [ns].

        Raises
        ------
        BagError
            The topic was not announced, or the disk is full or gone.
        """
        name = absolute(topic)
        if name not in self._connections:
            raise BagError(f'topic {name} was not announced')
        try:
            self._writer.write(self._connections[name], stamp, data)
        except OSError as error:
            raise BagError(f'{self.path} cannot be written: {error.strerror or error}') from error
        self.counts[name] += 1

    def flush(self) -> None:
        """Bring what was written to the disk, so that it outlives a kill of this process."""
        storage: Any = self._writer.storage
        if hasattr(storage, 'close_chunk'):
            if storage.chunk.bio.tell():
                storage.close_chunk()
            storage.bio.flush()
        else:
            storage.conn.commit()

    def close(self) -> None:
        """Write index and metadata.yaml; the bag is complete."""
        self._writer.close()

    def discard(self) -> None:
        """Close and delete the bag."""
        self._writer.abort()
        shutil.rmtree(self.path, ignore_errors=True)

    def __enter__(self) -> BagWriter:
        """Return the writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the bag, also after an error: what was written so far is of use."""
        self.close()


def absolute(topic: str) -> str:
    """Return a topic's name with its leading slash."""
    return topic if topic.startswith('/') else f'/{topic}'
