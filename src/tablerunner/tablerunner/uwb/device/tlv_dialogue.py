"""DWM1001: asked for its locations by the binary interface, each of them once.

A location that is asked for again is given again, and nothing in it says how old it is. So the
module is asked whether there is a new one (dwm_status_get), and for the location only then. The
range bears the time at which the module said so: it was measured since the question before.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from enum import Enum

from tablerunner.types import Refusal
from tablerunner.uwb.device.dialogue import Dialogue
from tablerunner.uwb.protocol import DeviceFact, DeviceRange, Parsed
from tablerunner.uwb.protocol.record import Record

ANSWER_S = 0.3
"""What comes later than this after its request is refused: nobody knows what it answers."""

MOST_TRIES = 3
"""Requests without an answer, in a row, before it is said, and before the shell is left."""

LATE = 'answer came too late'


class Request(Enum):
    """What the module is asked."""

    VERSION = b'\x15\x00'  # dwm_ver_get
    INTERVALS = b'\x04\x00'  # dwm_upd_rate_get
    CONFIGURATION = b'\x08\x00'  # dwm_cfg_get
    STATUS = b'\x32\x00'  # dwm_status_get
    LOCATION = b'\x0c\x00'  # dwm_loc_get
    LEAVE_SHELL = b'\rquit\r'  # what was sent before stands in its line


class TlvDialogue(Dialogue):
    """With a DWM1001 out of its shell, or brought out of it.

    Parameters
    ----------
    rate_hz : float
        Questions for a new location a second.
    what : str
        For messages.
    """

    def __init__(self, rate_hz: float, what: str) -> None:
        super().__init__(what)
        self._period_s = 1.0 / rate_hz
        self._forget(0.0)

    def _forget(self, now: float) -> None:
        self._setup = deque([Request.VERSION, Request.INTERVALS, Request.CONFIGURATION])
        self._pending: Request | None = None
        self._sent_at = 0.0
        self._poll_at = now
        self._ready = 0  # when the module said that there is a location [ns]; 0: it did not
        self._frames = 0  # of the answer to LOCATION
        self._unanswered = 0  # in a row
        self.timeouts = 0

    @property
    def status(self) -> str:
        """What the dialogue is doing."""
        if self._unanswered >= MOST_TRIES:
            return 'waiting for an answer'
        return 'asking for its settings' if self._setup else 'asking for locations'

    def begin(self, now: float) -> None:
        """Ask what it is, then for locations."""
        super().begin(now)
        self._forget(now)

    def wait_s(self, now: float) -> float:
        """Return the time until the next request, or until one has been in vain."""
        if self._pending is not None:
            return max(self._sent_at + ANSWER_S - now, 0.0)
        if self._setup or self._ready:
            return 0.0
        return max(self._poll_at - now, 0.0)

    def due(self, now: float) -> bytes:
        """Return the next request; one at a time is under way."""
        if self._pending is not None:
            if now < self._sent_at + ANSWER_S:
                return b''
            self._missed()
        if self._unanswered and self._unanswered % (MOST_TRIES + 1) == MOST_TRIES:
            return self._send(Request.LEAVE_SHELL, now)
        if self._setup:
            return self._send(self._setup.popleft(), now)
        if self._ready:
            return self._send(Request.LOCATION, now)
        if now < self._poll_at:
            return b''
        self._poll_at = max(self._poll_at + self._period_s, now)
        return self._send(Request.STATUS, now)

    def heard(self, data: bytes, parsed: Parsed, frames: int, now: float) -> Parsed:
        """Believe locations that were asked for, once, and date them."""
        super().heard(data, parsed, frames, now)
        records: list[Record] = []
        refusals = list(parsed.refusals)
        in_time = now <= self._sent_at + ANSWER_S
        located = self._pending is Request.LOCATION and in_time and self._ready > 0
        for record in parsed.records:
            if isinstance(record, DeviceFact):
                records.append(record)
                if record.name == 'location_ready':
                    self._ready = record.stamp if record.value else 0
            elif located:
                records.append(replace(record, stamp=self._ready))
            elif isinstance(record, DeviceRange):
                refusals.append(Refusal(record.stamp, 'dwm1001', record.anchor, LATE))
        if located:
            self._frames += frames
        if frames:
            self._answered(located and self._frames < 2 and not _has_error(refusals))
        return Parsed(tuple(records), tuple(refusals))

    def trouble(self, now: float) -> str:
        """Return what is wrong: garbage, or a module that does not answer."""
        words = super().trouble(now)
        if self._bytes:
            return words
        if self._unanswered < MOST_TRIES:
            return ''
        return f'the module does not answer: {self._unanswered} requests in vain ({self._what})'

    def _send(self, request: Request, now: float) -> bytes:
        self._pending, self._sent_at, self._frames = request, now, 0
        return request.value

    def _missed(self) -> None:
        if self._pending is Request.LOCATION:
            self._ready = 0
            if self._frames:  # a position without distances: no anchor was heard
                self._pending = None
                return
        self._pending = None
        self._unanswered += 1
        self.timeouts += 1

    def _answered(self, incomplete: bool) -> None:
        """Note that the request has been answered; of a location two frames come."""
        self._unanswered = 0
        if incomplete:
            return
        if self._pending is Request.LOCATION:
            self._ready = 0
        self._pending = None


def _has_error(refusals: list[Refusal]) -> bool:
    return any(item.reason.startswith('device answers') for item in refusals)
