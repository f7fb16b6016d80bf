"""`tablerunner record`: run a recorder until it is told to end."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

from tablerunner.bags.writer import BagWriter
from tablerunner.cli.console import Progress
from tablerunner_bringup.interrupts import Interrupts
from tablerunner_bringup.polling import bare_node
from tablerunner_bringup.recorder import Losses, Recorder, Selection

_POLL_S = 0.005
_SCAN_S = 0.25
_FLUSH_S = 1.0
_LAST_WORDS_S = 0.2


@dataclass(frozen=True)
class RecordOptions:
    """What to record, where to, and until when."""

    folder: Path
    storage: str = 'mcap'
    selection: Selection = field(default_factory=Selection)
    use_sim_time: bool = False
    duration_s: float = float('inf')
    domain: int | None = None


def record(options: RecordOptions, progress: Progress) -> tuple[int, Losses]:
    """Record until SIGINT, SIGTERM or the given duration; return the messages and the losses.

    Raises
    ------
    BagError
        The bag cannot be made or written.
    """
    with (
        Interrupts() as interrupts,
        BagWriter(options.folder, options.storage) as bag,
        bare_node('tablerunner_recorder', options.domain) as node,
        progress,
    ):
        progress.say(f'recording to {options.folder}; Ctrl-C ends it')
        recorder = Recorder(
            node,
            bag,
            options.selection,
            options.use_sim_time,
            lambda topic, msgtype: progress.say(f'  {topic} [{msgtype}]'),
        )
        begun = time.monotonic()
        scanned = flushed = -1.0
        while not interrupts.asked and time.monotonic() - begun < options.duration_s:
            now = time.monotonic() - begun
            if now - scanned >= _SCAN_S or scanned < 0.0:
                recorder.scan()
                scanned = now
            recorder.drain()
            if now - flushed >= _FLUSH_S:
                bag.flush()
                flushed = now
                progress.show(f'{now:6.0f} s  {recorder.written} messages')
            time.sleep(_POLL_S)
        _take_last_words(recorder)
        return recorder.written, recorder.losses


def _take_last_words(recorder: Recorder) -> None:
    """Take what is still on its way; bounded, for the topics need not fall silent."""
    deadline = time.monotonic() + _LAST_WORDS_S
    while time.monotonic() < deadline:
        recorder.drain()
        time.sleep(_POLL_S)
    recorder.finish()
