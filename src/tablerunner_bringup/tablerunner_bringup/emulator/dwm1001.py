"""A DWM1001 with PANS firmware as seen from its UART: the shell, and the lines of `lec`.

By docs/protocols.md, written without the code that reads it. Times are given, so that nothing here
reads a clock.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

BANNER = b'\r\n\r\n DWM1001 TWR Real Time Location System\r\n\r\n'
PROMPT = b'dwm> '
UPDATE_S = 0.1
RETURNS_WITHIN_S = 1.0

_RETURN = 13
_MOST_ANCHORS = 4
_FORGET_S = 1.0
_LONGEST_LINE = 64


class Dwm1001:
    """Answers what is sent to it, and says a line whenever its tag has ranged.

    Parameters
    ----------
    anchors : mapping of str to tuple
        Address (four hex digits) and place as it was configured [m], of each anchor.
    """

    def __init__(self, anchors: Mapping[str, tuple[float, float, float]]) -> None:
        self._anchors = dict(anchors)
        self._ranges: dict[str, tuple[float, float]] = {}
        self._in_shell = False
        self._ranging = False
        self._returned_at = -math.inf
        self._line = b''
        self._last = b''
        self._next = 0.0

    def measure(self, address: str, range_m: float, now_s: float) -> None:
        """Note a range."""
        self._ranges[address] = (range_m, now_s)

    def hear(self, data: bytes, now_s: float) -> bytes:
        """Return what it answers to bytes: in the shell an echo, what a command says, a prompt."""
        said = b''
        for byte in data:
            said += self._take(byte, now_s)
        return said

    def tick(self, now_s: float) -> bytes:
        """Return the line that is due, if one is."""
        if not (self._in_shell and self._ranging) or now_s < self._next:
            return b''
        self._next = max(self._next + UPDATE_S, now_s)
        heard = [
            (address, range_m)
            for address, (range_m, at) in self._ranges.items()
            if now_s - at < _FORGET_S
        ][:_MOST_ANCHORS]
        if not heard:
            return b''
        line = f'DIST,{len(heard)}'
        for index, (address, range_m) in enumerate(heard):
            x, y, z = self._anchors[address]
            line += f',AN{index},{address},{x:.2f},{y:.2f},{z:.2f},{range_m:.2f}'
        return line.encode() + b'\r\n'

    def _take(self, byte: int, now_s: float) -> bytes:
        if not self._in_shell:
            return self._outside(byte, now_s)
        if byte != _RETURN:
            self._line = (self._line + bytes([byte]))[-_LONGEST_LINE:]
            return bytes([byte])
        command = self._line or self._last  # a return alone repeats the last command
        self._line, self._last = b'', command
        said = b'\r\n' + self._obey(command, now_s)
        return said + PROMPT if self._in_shell else said

    def _outside(self, byte: int, now_s: float) -> bytes:
        """Two returns within a second open the shell; all else is not understood here."""
        if byte != _RETURN:
            return b''
        twice = now_s - self._returned_at <= RETURNS_WITHIN_S
        self._returned_at = now_s
        if not twice:
            return b''
        self._in_shell, self._line, self._last = True, b'', b''
        return BANNER + PROMPT

    def _obey(self, command: bytes, now_s: float) -> bytes:
        if command == b'lec':
            self._ranging = not self._ranging
            self._next = now_s
        elif command == b'quit':
            self._in_shell = self._ranging = False
        elif command == b'si':
            tenths = round(10 * UPDATE_S)
            return (
                b'[000014.330 INF] sys: fw2 fw_ver=x01030001 cfg_ver=x00010700\r\n'
                b'[000014.330 INF] mode: tn (act,twr,np,le)\r\n'
                + f'[000014.340 INF] cfg: upd_rate_norm={tenths} upd_rate_stat={tenths} '.encode()
                + b'label=DW0001\r\n'
            )
        elif command:
            return b'unknown command\r\n'
        return b''
