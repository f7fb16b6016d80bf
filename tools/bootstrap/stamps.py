"""Stamps: what a finished step was made from, so that it is done again only when that changed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path


def digest(words: Iterable[str], files: Iterable[Path] = (), root: Path | None = None) -> str:
    """Return a hash of words and of files: their contents, and their names as seen from `root`."""
    total = hashlib.sha256()
    for word in words:
        total.update(b'word\0' + word.encode() + b'\0')
    for path in sorted(files):
        name = path.relative_to(root) if root else path
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        total.update(b'file\0' + str(name).encode() + b'\0' + content.encode() + b'\0')
    return total.hexdigest()


def read(path: Path) -> str:
    """Return what the stamp says, nothing if there is none."""
    try:
        return path.read_text(encoding='ascii').strip()
    except (OSError, UnicodeDecodeError):
        return ''


def write(path: Path, value: str) -> None:
    """Write a stamp in one go: it is there whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(path.name + '.new')
    draft.write_text(value + '\n', encoding='ascii')
    draft.replace(path)
