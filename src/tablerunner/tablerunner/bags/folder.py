"""Which files a bag consists of, and what its metadata.yaml says of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from tablerunner.bags.storage import Damage
from tablerunner.errors import BagError

METADATA = 'metadata.yaml'
_KINDS = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')


@dataclass
class BagFolder:
    """The parts of a bag on disk.

    Attributes
    ----------
    path : Path
        The folder, or the single storage file.
    files : list of Path
        Storage files in the order they were recorded.
    counts : dict of str to int
        Messages of each topic as metadata.yaml says; empty when it says nothing.
    message_compression : bool
        Whether each message is compressed alone.
    damage : list of Damage
        What is missing or contradicts itself.
    """

    path: Path
    files: list[Path] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    message_compression: bool = False
    damage: list[Damage] = field(default_factory=list)

    @classmethod
    def find(cls, path: Path) -> BagFolder:
        """Look at a bag folder or a storage file.

        Raises
        ------
        BagError
            There is nothing at `path`, or nothing of a bag.
        """
        if not path.exists():
            raise BagError(f'there is no bag at {path}')
        if path.is_file():
            if not path.name.endswith(_KINDS):
                raise BagError(f'{path} is not a bag: expected a folder, an .mcap or a .db3 file')
            return cls(path, [path])
        bag = cls(path)
        present = sorted(
            (file for file in path.iterdir() if file.is_file() and file.name.endswith(_KINDS)),
            key=_natural,
        )
        information = bag._read_metadata()
        if information is None and not present:
            raise BagError(f'{path} is not a bag: it holds no .mcap and no .db3 file')
        bag._take(information or {}, present)
        return bag

    def _read_metadata(self) -> dict[str, Any] | None:
        file = self.path / METADATA
        if not file.exists():
            self._note('it is missing', 'files and topics were found without it')
            return None
        try:
            data = yaml.safe_load(file.read_text(encoding='utf-8'))
            information = data['rosbag2_bagfile_information']
            if not isinstance(information, dict):
                raise TypeError('no mapping of fields')
        except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
            words = ' '.join(str(error).split())
            self._note(f'it cannot be read ({words})', 'files and topics were found without it')
            return None
        return information

    def _take(self, information: dict[str, Any], present: list[Path]) -> None:
        named = information.get('relative_file_paths')
        for name in named if isinstance(named, list) else []:
            file = self.path / Path(str(name)).name
            if file in present:
                self.files.append(file)
            else:
                self.damage.append(
                    Damage(file.name, '', 'the file is missing', 'all messages in it are missing')
                )
        for file in present:
            if file not in self.files:
                self.files.append(file)
                if information:
                    self._note(f'it does not name {file.name}', 'that file was read all the same')
        self.message_compression = (
            str(information.get('compression_mode', '')).lower() == 'message'
        )
        topics = information.get('topics_with_message_count')
        for item in topics if isinstance(topics, list) else []:
            try:
                name = str(item['topic_metadata']['name'])
                self.counts[name] = self.counts.get(name, 0) + int(item['message_count'])
            except (KeyError, TypeError, ValueError):
                self._note('an entry of its list of topics cannot be read', '')

    def _note(self, reason: str, lost: str) -> None:
        self.damage.append(Damage(METADATA, '', reason, lost))


def _natural(file: Path) -> list[tuple[int, str]]:
    """Sort bag_2.mcap before bag_10.mcap."""
    return [
        (int(part), '') if part.isdigit() else (0, part) for part in re.split(r'(\d+)', file.name)
    ]
