"""DWM1001: into the shell, and `lec` or `les` begun there.

Facts of the shell and where they are from: docs/protocols.md. Two carriage returns open it; in it
a carriage return repeats the last command, and the command that begins the lines also ends them.
So it is listened first, the shell is asked with `si`, which changes nothing, and the lines are
begun only when none came for longer than a tag that stands still takes.
"""

from __future__ import annotations

from enum import Enum, auto

from tablerunner.uwb.device.dialogue import Dialogue
from tablerunner.uwb.protocol import DeviceFact, DevicePosition, DeviceRange, Parsed
from tablerunner.uwb.protocol.dwm1001_shell import NEW_SET

LISTEN_S = 0.5
ANSWER_S = 1.0
BETWEEN_RETURNS_S = 0.2
"""Both carriage returns have to come within a second; a module that sleeps loses the first."""

RETURNS = 3
QUIET_S = 1.0
"""Silence after which the shell is asked whether it is still there."""

STILL_S = 10.0
"""Between two lines of a tag that stands still, where the module does not say (its default)."""

FAILURES = 2
"""Times that the shell did not open before it is said."""

GARBAGE = 100
"""More bytes than a module out of its shell answers to all that is tried."""

_PROMPT = b'dwm> '


class _Stage(Enum):
    LISTENING = auto()
    ASKING = auto()  # si has been sent
    ENTERING = auto()  # carriage returns are being sent
    OPENED = auto()  # the shell has just opened
    INFORMING = auto()  # si has been sent to it
    RUNNING = auto()


_WORDS = {
    _Stage.LISTENING: 'listening',
    _Stage.ASKING: 'asking whether the shell is there',
    _Stage.ENTERING: 'opening the shell',
    _Stage.OPENED: 'the shell is open',
    _Stage.INFORMING: 'asking for its settings',
    _Stage.RUNNING: 'ranging',
}


class ShellDialogue(Dialogue):
    """With a DWM1001 in or out of its shell.

    Parameters
    ----------
    command : str
        ``lec`` or ``les``.
    what : str
        For messages.
    """

    def __init__(self, command: str, what: str) -> None:
        super().__init__(what)
        self._command = command.encode() + b'\r'
        self._still_s = STILL_S
        self._forget(0.0)

    def _forget(self, now: float) -> None:
        self._stage = _Stage.LISTENING
        self._until = now + LISTEN_S  # of the stage
        self._tail = b''  # of what came: a prompt may be cut
        self._failures = 0
        self._returns = 0
        self._line_at = now
        self._ask_at = 0.0
        self._ask_after_s = QUIET_S
        self._vain = 0  # times the lines were begun and none came

    @property
    def status(self) -> str:
        """What the dialogue is doing."""
        if self._stage is _Stage.RUNNING and self._vain > 1:
            return 'the shell answers, but the tag reports no ranges'
        return _WORDS[self._stage]

    def begin(self, now: float) -> None:
        """Listen first: the lines may be on already."""
        super().begin(now)
        self._forget(now)

    def wait_s(self, now: float) -> float:
        """Return the time until the stage is over."""
        due = min(self._ask_at, self._lines_due()) if self._running else self._until
        return max(due - now, 0.0)

    def due(self, now: float) -> bytes:
        """Go on to the next stage where this one is over."""
        if self._running:
            return self._due_running(now)
        if now < self._until:
            return b''
        if self._stage is _Stage.LISTENING:
            return self._ask(_Stage.ASKING, now)
        if self._stage is _Stage.OPENED:
            return self._ask(_Stage.INFORMING, now)
        if self._stage is _Stage.INFORMING:
            return self._begin_lines(now)
        if self._stage is _Stage.ASKING:
            self._stage, self._returns = _Stage.ENTERING, 0
        elif self._returns == RETURNS:
            self._failures += 1
            self._returns = 0
        self._returns += 1
        last = self._returns == RETURNS
        self._until = now + (ANSWER_S if last else BETWEEN_RETURNS_S)
        return b'\r'

    def heard(self, data: bytes, parsed: Parsed, frames: int, now: float) -> Parsed:
        """Note lines, prompts, and what the module says of itself."""
        believed = super().heard(data, parsed, frames, now)
        for record in parsed.records:
            if isinstance(record, DeviceFact) and record.name == 'update_interval_still_ms':
                self._still_s = max(float(record.value) / 1000.0, 0.1)
        if _has_line(parsed):
            self._line_at = now
            self._vain = 0
            self._ask_after_s = QUIET_S
            self._run(now)
            return believed
        text = self._tail + data
        self._tail = text[-len(_PROMPT) + 1 :]
        if _PROMPT in text:
            self._prompted(now)
        return believed

    def trouble(self, now: float) -> str:
        """Return what is wrong: garbage, or a module that does not answer."""
        if self._running:
            return ''
        if self._bytes > GARBAGE:
            return super().trouble(now)
        if self._failures < FAILURES:
            return ''
        return f'the module does not open its shell: {self._failures} tries ({self._what})'

    @property
    def _running(self) -> bool:
        return self._stage is _Stage.RUNNING

    def _run(self, now: float) -> None:
        self._stage = _Stage.RUNNING
        self._failures = 0
        self._ask_at = now + self._ask_after_s

    def _lines_due(self) -> float:
        """Return when lines that do not come are begun again."""
        return self._line_at + 1.0 + 1.2 * self._still_s

    def _due_running(self, now: float) -> bytes:
        if now >= self._lines_due():
            return self._begin_lines(now)
        if now >= self._ask_at:
            self._ask_after_s = min(2.0 * self._ask_after_s, 1.0 + self._still_s)
            return self._ask(_Stage.ASKING, now)
        return b''

    def _ask(self, stage: _Stage, now: float) -> bytes:
        self._stage, self._until, self._tail = stage, now + ANSWER_S, b''
        return b'si\r'

    def _begin_lines(self, now: float) -> bytes:
        self._line_at = now
        self._vain += 1
        self._run(now)
        return self._command

    def _prompted(self, now: float) -> None:
        """Go on after a prompt: an answer to what was asked."""
        self._understood, self._bytes = now, 0
        self._tail = b''
        if self._stage is _Stage.ASKING:
            self._run(now)
        elif self._stage is _Stage.ENTERING:
            self._stage, self._until = _Stage.OPENED, now
        elif self._stage is _Stage.INFORMING:
            self._until = now


def _has_line(parsed: Parsed) -> bool:
    return any(isinstance(record, (DeviceRange, DevicePosition)) for record in parsed.records) or (
        any(refusal.reason == NEW_SET for refusal in parsed.refusals)
    )
