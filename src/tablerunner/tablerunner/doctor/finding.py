"""One thing that was looked at: how it is, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Level(Enum):
    """How bad it is."""

    OK = 'ok'
    WARNING = 'warning'
    ERROR = 'error'


@dataclass(frozen=True)
class Finding:
    """What was found.

    Attributes
    ----------
    check : str
        Group: environment, discovery, serial, nodes, topics, clocks, frames, parameters, anchors
        or diagnostics.
    subject : str
        What it is about: a topic, a frame, a port.
    level : Level
    words : str
        How it is.
    advice : str
        What to do; empty where nothing is wrong.
    """

    check: str
    subject: str
    level: Level
    words: str
    advice: str = ''

    def as_json(self) -> dict[str, str]:
        """Return it as plain data."""
        return {
            'check': self.check,
            'subject': self.subject,
            'level': self.level.value,
            'words': self.words,
            'advice': self.advice,
        }


def ok(check: str, subject: str, words: str) -> Finding:
    """Return that something is as it should be."""
    return Finding(check, subject, Level.OK, words)


def warning(check: str, subject: str, words: str, advice: str) -> Finding:
    """Return that something is not as good as it could be."""
    return Finding(check, subject, Level.WARNING, words, advice)


def error(check: str, subject: str, words: str, advice: str) -> Finding:
    """Return that something does not work."""
    return Finding(check, subject, Level.ERROR, words, advice)
