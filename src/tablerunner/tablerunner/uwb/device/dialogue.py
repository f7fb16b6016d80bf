"""What has to be said to a device so that it reports ranges, and whether it does."""

from __future__ import annotations

import math

from tablerunner.uwb.protocol import Parsed

TROUBLE_S = 1.5
"""Without anything understood for so long, it is said."""

IDLE_S = 3600.0
"""Nothing is due before something comes."""


class Dialogue:
    """With a device that talks by itself and is told nothing; base of the others.

    Times are of a steady clock [s].

    Parameters
    ----------
    what : str
        The protocol and its settings, for messages.
    silent_well : bool
        Whether silence is no trouble: of datagrams nobody knows when they should come.
    """

    def __init__(self, what: str, silent_well: bool = False) -> None:
        self._what = what
        self._silent_well = silent_well
        self._understood = 0.0  # when something last was
        self._bytes = 0  # since then

    @property
    def status(self) -> str:
        """What the device is doing, in words."""
        return 'open'

    def begin(self, now: float) -> None:
        """Begin with a device that has just been connected."""
        self._understood, self._bytes = now, 0

    def due(self, now: float) -> bytes:  # noqa: ARG002  this one says nothing
        """Return what is to be sent now; empty: nothing."""
        return b''

    def wait_s(self, now: float) -> float:  # noqa: ARG002  this one says nothing
        """Return the time until something may be due [s]."""
        return IDLE_S

    def heard(self, data: bytes, parsed: Parsed, frames: int, now: float) -> Parsed:
        """Take what came; return of what was parsed what can be believed.

        Parameters
        ----------
        data : bytes
            What came, unparsed.
        parsed : Parsed
            What became whole by it.
        frames : int
            How many frames that were.
        now : float
            When [s].
        """
        self._bytes += len(data)
        if frames:
            self._understood, self._bytes = now, 0
        return parsed

    def trouble(self, now: float) -> str:
        """Return what is wrong with the device; empty: nothing."""
        quiet_s = now - self._understood
        if quiet_s < TROUBLE_S:
            return ''
        if self._bytes:
            return (
                f'{self._bytes} bytes in {math.floor(quiet_s)} s and nothing of {self._what} '
                'among them: wrong baud rate, or another device?'
            )
        return '' if self._silent_well else f'nothing received for {math.floor(quiet_s)} s'
