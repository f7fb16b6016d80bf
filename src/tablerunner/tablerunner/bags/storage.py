"""What the readers of both storages have in common: topics, entries, and records of damage."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeAlias


@dataclass(frozen=True, slots=True)
class Damage:
    """Something that a bag should hold and that cannot be read.

    Attributes
    ----------
    file : str
        Name of the file inside the bag.
    place : str
        Where in it: ``byte 4711``, ``messages 120 to 133``, a topic; empty for the whole file.
    reason : str
        What is wrong.
    lost : str
        What is missing because of it, as far as it is known; empty when nothing is.
    """

    file: str
    place: str
    reason: str
    lost: str = ''

    def __str__(self) -> str:
        """Return it as one line for people."""
        where = f'{self.file}, {self.place}' if self.place else self.file
        return f'{where}: {self.reason}' + (f'; {self.lost}' if self.lost else '')


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic as one storage file knows it."""

    topic: str
    msgtype: str
    encoding: str = ''  # of the definition: ros2msg or ros2idl; empty when there is none
    definition: str = ''
    serialization: str = 'cdr'
    qos: str = ''  # offered QoS profiles, YAML as in the bag


Entry: TypeAlias = tuple[int, int, int, int, int, int, int]
"""Where one message is, as a plain tuple since a bag has very many: time of reception [ns], number
of the file in the bag, order in that file, channel, and three numbers of the storage's own.
Entries sort by time, then by their order in the bag."""


class Storage(Protocol):
    """One storage file of a bag, read as far as it can be read."""

    path: Path
    channels: dict[int, Channel]
    entries: list[Entry]
    damage: list[Damage]

    def load(self, entry: Entry) -> bytes:
        """Return the serialised message of an entry; BagError when it cannot be read."""

    def close(self) -> None:
        """Let go of the file."""
