"""DWM1001 with the PANS firmware: the lines that the shell's `lec` and `les` print.

The lines and where they are documented: docs/protocols.md. They carry no checksum, no time and no
quality of a range. What is damaged shows in the form of the line, which must be right to the last
character, in anchors named twice, and in ranges that do not fit the device's own position.
"""

from __future__ import annotations

import re

from tablerunner.uwb.protocol.parser import MAX_RANGE_M, Parser
from tablerunner.uwb.protocol.plausible import ODD_RANGE, odd_one
from tablerunner.uwb.protocol.record import DeviceFact, DevicePosition, DeviceRange, Place

LONGEST_LINE = 1024
"""A line of fifteen anchors has 600 characters at most."""

MAX_RESIDUAL_M = 3.0
"""How far one range may be off the device's own position where all others fit [m]."""

MOST_ANCHORS = 15

NEW_SET = 'anchors not seen together before'
"""Why the first line with these anchors is refused, where it may have lost something."""

_MOST_SETS = 256

_NUMBER = rb'(-?\d{1,4}\.\d\d)'
_RANGE = rb'(\d{1,4}\.\d\d)'
_THREE = rb','.join([_NUMBER] * 3)
_HEAD = re.compile(rb'DIST,(\d{1,2})')
_GROUP = re.compile(rb',AN(\d{1,2}),([0-9A-F]{4}),' + _THREE + rb',' + _RANGE)
_END = re.compile(rb'(?:,POS,' + _THREE + rb',(\d{1,3}))?\Z')
_WORD = re.compile(rb'([0-9A-F]{4})\[' + _THREE + rb'\]=' + _RANGE + rb'(?: |\Z)')
_REST = re.compile(rb'(?:le_us=\d+(?: est\[' + _THREE + rb',(\d{1,3})\])?)?\Z')
_POSITION = re.compile(rb'POS,' + _THREE + rb',(\d{1,3})\Z')
_MEASURED = re.compile(rb'DIST|POS|,AN\d|\]=|est\[|le_us')
_INFO = re.compile(rb'\[\d+\.\d+ INF\] (sys|mode|cfg): (.*)\Z')
_FIRMWARE = re.compile(rb'fw_ver=x([0-9A-Fa-f]{8})\b')
_INTERVALS = re.compile(rb'stat_det=([01]) .*upd_rate_norm=(\d{1,5}) upd_rate_stat=(\d{1,5}) ')
_TEXT = re.compile(rb'[\x20-\x7e\t]*\Z')
_PROMPT = b'dwm> '
_ERROR = b'\x40\x01\x01'  # what it answers to text while it is not in its shell


class Dwm1001Shell(Parser):
    """Reads the lines of `lec`, `les`, `lep`, `si`; other text of the shell is passed over.

    A line of `les` does not tell how many anchors it has: what is lost between two of them gives
    one anchor the range of another. A line without a position may have lost it, from within the
    last range on. So the first such line with a set of anchors is refused, and the next ones are
    believed. `lec` counts its anchors, and its lines with a position are believed at once.

    Parameters
    ----------
    max_range_m : float
        Ranges beyond this are refused [m].
    max_residual_m : float
        A range that alone is off the device's own position by more than this is refused [m];
        0 judges nothing.
    """

    source = 'dwm1001'

    def __init__(
        self, max_range_m: float = MAX_RANGE_M, max_residual_m: float = MAX_RESIDUAL_M
    ) -> None:
        super().__init__(max_range_m)
        self._max_residual_m = max_residual_m
        self._buffer = b''
        self._skipping = False  # inside a line that is too long to be one
        # Anchors that came together in lines that may have lost something, with a position or not.
        self._sets: set[tuple[bool, frozenset[str]]] = set()

    @property
    def buffered(self) -> int:
        """Bytes that wait for the end of their line."""
        return len(self._buffer)

    def reset(self) -> None:
        """Forget the unfinished line, as after a reconnection; counts stay."""
        self._buffer = b''
        self._skipping = False
        self._sets.clear()

    def _take(self, data: bytes) -> None:
        buffer = self._buffer + data
        *lines, rest = buffer.split(b'\n')
        behind = len(buffer)
        for line in lines:
            behind -= len(line) + 1
            self._date(behind)
            if self._skipping:
                self._skipping = False
            elif len(line) > LONGEST_LINE:
                self._refuse('line too long')
            else:
                self._line(line.rstrip(b'\r'))
        if len(rest) > LONGEST_LINE:
            if not self._skipping:
                self._refuse('line too long')
            self._skipping, rest = True, b''
        self._buffer = b'' if self._skipping else rest

    def _line(self, line: bytes) -> None:
        while line.startswith((_PROMPT, _ERROR)):
            line = line[len(_PROMPT if line.startswith(_PROMPT) else _ERROR) :]
        if not _TEXT.match(line):
            self._refuse('line is no text')
            return
        if not _MEASURED.search(line):
            info = _INFO.match(line)
            if info is not None:
                self._info(info[1], info[2])
            return
        if line.startswith(b'DIST,'):
            self._lec(line)
        elif line.startswith(b'POS,'):
            self._lep(line)
        else:
            self._les(line)

    def _info(self, kind: bytes, text: bytes) -> None:
        """Read what `si` says of the module: firmware, mode, update intervals of 0.1 s."""
        firmware, intervals = _FIRMWARE.search(text), _INTERVALS.search(text)
        if kind == b'sys' and firmware is not None:
            self._fact('firmware', firmware[1].decode())
        elif kind == b'mode':
            self._fact('mode', text.decode()[:60])
        elif kind == b'cfg' and intervals is not None:
            detects, moving, still = (int(number) for number in intervals.groups())
            self._fact('update_interval_ms', 100 * moving)
            self._fact('update_interval_still_ms', 100 * (still if detects else moving))

    def _fact(self, name: str, value: str | int) -> None:
        self._give(DeviceFact(self._stamp, name, value))

    def _lec(self, line: bytes) -> None:
        head = _HEAD.match(line)
        if head is None:
            self._refuse('damaged line', 'DIST')
            return
        count, at = int(head[1]), head.end()
        found: list[DeviceRange] = []
        while (group := _GROUP.match(line, at)) is not None:
            if int(group[1]) != len(found):
                self._refuse('damaged line', f'AN{len(found)}')
                return
            found.append(self._range(group.groups()[1:]))
            at = group.end()
        end = _END.match(line, at)
        if end is None or len(found) != count:
            self._refuse('damaged line', 'POS' if len(found) == count else f'AN{len(found)}')
            return
        self._finish(found, end.groups(), counted=True)

    def _les(self, line: bytes) -> None:
        found: list[DeviceRange] = []
        at = 0
        while (word := _WORD.match(line, at)) is not None:
            found.append(self._range(word.groups()))
            at = word.end()
        rest = _REST.match(line, at)
        if rest is None:
            self._refuse('damaged line', f'anchor {len(found)}')
            return
        self._finish(found, rest.groups(), counted=False)

    def _lep(self, line: bytes) -> None:
        match = _POSITION.match(line)
        if match is None:
            self._refuse('damaged line', 'POS')
            return
        self._finish([], match.groups(), counted=True)

    def _range(self, texts: tuple[bytes, ...]) -> DeviceRange:
        address, x, y, z, distance = texts
        return DeviceRange(
            self._stamp,
            '',
            address.decode(),
            float(distance),
            anchor_place=(float(x), float(y), float(z)),
        )

    def _finish(
        self, found: list[DeviceRange], position: tuple[bytes | None, ...], counted: bool
    ) -> None:
        if len(found) > MOST_ANCHORS:
            self._refuse('too many anchors')
            return
        if len({item.anchor for item in found}) < len(found):
            self._refuse('anchor named twice')
            return
        place: Place | None = None
        quality = 0
        x, y, z, percent = position
        if x is not None and y is not None and z is not None and percent is not None:
            place, quality = (float(x), float(y), float(z)), int(percent)
            if quality > 100:
                self._refuse('damaged line', 'quality')
                return
        if (not counted or place is None) and not self._familiar(found, place is not None):
            self._refuse(NEW_SET)
            return
        odd = odd_one(found, place, self._max_residual_m) if place and quality else -1
        self._frames += 1
        for index, item in enumerate(found):
            if index == odd:
                self._refuse(ODD_RANGE, item.anchor)
            else:
                self._give(item)
        if place is not None:
            self._give(DevicePosition(self._stamp, '', place, quality / 100.0))

    def _familiar(self, found: list[DeviceRange], placed: bool) -> bool:
        """Return whether such a line came before, and remember it."""
        kind = (placed, frozenset(item.anchor for item in found))
        if kind in self._sets:
            return True
        if len(self._sets) == _MOST_SETS:
            self._sets.clear()
        self._sets.add(kind)
        return False
