"""DWM1001 with the PANS firmware: answers of its binary interface (type, length, value).

The answers and where they are documented: docs/protocols.md. They carry no checksum. Lengths, the
number of entries, qualities of at most 100 %, places and distances within a few kilometres leave
shifted or cut bytes little room; a changed distance shows where it alone does not fit the
position that the device found.
"""

from __future__ import annotations

import struct

from tablerunner.uwb.protocol.framed import Fault, FramedParser
from tablerunner.uwb.protocol.parser import MAX_RANGE_M, TRUNCATED
from tablerunner.uwb.protocol.plausible import ODD_RANGE, odd_one
from tablerunner.uwb.protocol.record import DeviceFact, DevicePosition, DeviceRange, Place

MAX_RESIDUAL_M = 3.0
"""How far one range may be off the device's own position where all others fit [m]."""

ERRORS = {
    1: 'unknown command or broken frame',
    2: 'internal error',
    3: 'invalid parameter',
    4: 'busy',
    5: 'operation not permitted',
}

_STATUS, _POSITION, _UPDATE_RATE, _CONFIG = 0x40, 0x41, 0x45, 0x46
_TAG_DISTANCES, _ANCHOR_DISTANCES = 0x48, 0x49
_FIRMWARE, _CONFIG_VERSION, _HARDWARE, _STATE = 0x50, 0x51, 0x52, 0x5A

_LENGTHS = {_POSITION: (13,), _UPDATE_RATE: (4,), _CONFIG: (2,), _FIRMWARE: (4,), _STATE: (1, 2)}
_VERSION_BYTES = 18  # three times type, length and four bytes
_PLACE = struct.Struct('<iiiB')
_ENTRY = {
    _TAG_DISTANCES: struct.Struct('<QIB'),
    _ANCHOR_DISTANCES: struct.Struct('<HIBiiiB'),
}
_NEXT_ANSWER = bytes([_STATUS, 1, 0, _POSITION, 13])
_FAR_MM = 10_000_000


class Dwm1001Tlv(FramedParser):
    """Reads answers to dwm_loc_get, dwm_pos_get, dwm_ver_get, dwm_cfg_get and a few more.

    An answer to dwm_loc_get is read in two steps, the position and then the distances behind it,
    because the position alone is a whole answer to dwm_pos_get.

    Parameters
    ----------
    max_range_m : float
        Ranges beyond this are refused [m].
    max_residual_m : float
        A range that alone is off the device's own position by more than this is refused [m];
        0 judges nothing.
    """

    source = 'dwm1001'
    longest = 2 + 255
    telling = 4

    def __init__(
        self, max_range_m: float = MAX_RANGE_M, max_residual_m: float = MAX_RESIDUAL_M
    ) -> None:
        super().__init__(max_range_m)
        self._max_residual_m = max_residual_m
        self._place: Place | None = None  # of the answer whose distances come next
        self._quality = 0

    def reset(self) -> None:
        """Forget the unfinished answer, as after a reconnection; counts stay."""
        super().reset()
        self._lost()

    def _lost(self) -> None:
        self._place = None

    def _find(self, buffer: bytes, at: int, first: bool) -> int:
        if first and self._place is not None and buffer[at : at + 1] in (b'\x48', b'\x49'):
            return at
        return buffer.find(_STATUS, at)

    def _tail(self, buffer: bytes, begin: int) -> int:  # noqa: ARG002  a lone header waits itself
        return len(buffer)

    def _length(self, buffer: bytes, start: int) -> int:
        head = buffer[start : start + 5]
        if head[0] != _STATUS:
            return self._distances_length(buffer, start)
        if len(head) >= 2 and head[1] != 1:
            return 0
        if len(head) < 3:
            return -1
        if head[2] != 0:
            return 3 if head[2] in ERRORS else 0
        if len(head) >= 4 and head[3] not in _LENGTHS:
            # Another answer: the one before only said that all went well.
            return 3 if head[3] == _STATUS else 0
        if len(head) < 5:
            return -1
        if head[4] not in _LENGTHS[head[3]]:
            return 0
        if head[3] == _FIRMWARE:
            return 3 + _VERSION_BYTES
        return 5 + head[4]

    def _distances_length(self, buffer: bytes, start: int) -> int:
        head = buffer[start : start + 3]
        if len(head) < 3:
            return -1
        size = _ENTRY[head[0]].size
        return 2 + head[1] if head[1] == 1 + head[2] * size else 0

    def _fault(self, buffer: bytes, start: int, length: int) -> Fault | None:
        end = start + length
        if buffer.find(_NEXT_ANSWER, start + 1, end) >= 0:
            return Fault(TRUNCATED)
        kind = buffer[start]
        if kind in _ENTRY:
            return _distances_fault(kind, buffer[start + 3 : end])
        if buffer[start + 2] != 0:
            return None
        kind = buffer[start + 3] if length > 3 else 0
        if kind == _POSITION:
            *place, quality = _PLACE.unpack_from(buffer, start + 5)
            if quality > 100 or max(map(abs, place)) > _FAR_MM:
                return Fault('impossible position', 'position')
        if kind == _FIRMWARE:
            marks = (buffer[start + 9 : start + 11], buffer[start + 15 : start + 17])
            if marks != (bytes([_CONFIG_VERSION, 4]), bytes([_HARDWARE, 4])):
                return Fault('damaged answer', 'version')
        return None

    def _decode(self, buffer: bytes, start: int, length: int) -> None:
        kind = buffer[start]
        if kind in _ENTRY:
            self._decode_distances(kind, buffer[start + 3 : start + length])
            self._place = None
            return
        self._place = None
        if buffer[start + 2] != 0:
            self._refuse(f'device answers: {ERRORS[buffer[start + 2]]}', 'status')
            return
        if length == 3:
            return
        value = buffer[start + 5 : start + length]
        if buffer[start + 3] == _POSITION:
            x, y, z, quality = _PLACE.unpack(value)
            self._place, self._quality = (x / 1000.0, y / 1000.0, z / 1000.0), quality
            self._give(DevicePosition(self._stamp, '', self._place, quality / 100.0))
        elif buffer[start + 3] == _FIRMWARE:
            version = '.'.join(str(number) for number in (value[3], value[2], value[1]))
            self._fact('firmware', f'{version} variant {value[0] & 0x0F}')
            self._fact('configuration_version', f'{int.from_bytes(value[6:10], "little"):08x}')
            self._fact('hardware_version', f'{int.from_bytes(value[12:16], "little"):08x}')
        elif buffer[start + 3] == _CONFIG:
            self._fact('mode', 'anchor' if value[1] & 0x20 else 'tag')
            self._fact('uwb_mode', value[0] & 0x03)
            self._fact('stationary_detection', value[1] >> 2 & 1)
        elif buffer[start + 3] == _UPDATE_RATE:
            moving, still = struct.unpack('<HH', value)
            self._fact('update_interval_ms', 100 * moving)
            self._fact('update_interval_still_ms', 100 * still)
        else:
            self._fact('location_ready', value[0] & 1)
            self._fact('joined_network', value[0] >> 1 & 1)

    def _decode_distances(self, kind: int, value: bytes) -> None:
        found: list[DeviceRange] = []
        for address, millimetres, quality, *rest in _ENTRY[kind].iter_unpack(value):
            place = (rest[0] / 1000.0, rest[1] / 1000.0, rest[2] / 1000.0) if rest else None
            found.append(
                DeviceRange(
                    self._stamp,
                    '',
                    f'{address:04X}' if rest else f'{address:016X}',
                    millimetres / 1000.0,
                    quality / 100.0,
                    anchor_place=place,
                )
            )
        odd = -1
        if self._place is not None and self._quality:
            odd = odd_one(found, self._place, self._max_residual_m)
        for index, item in enumerate(found):
            if index == odd:
                self._refuse(ODD_RANGE, item.anchor)
            else:
                self._give(item)

    def _fact(self, name: str, value: str | int) -> None:
        self._give(DeviceFact(self._stamp, name, value))


def _distances_fault(kind: int, value: bytes) -> Fault | None:
    """Return what cannot be in a list of distances."""
    seen = set()
    for index, (address, millimetres, quality, *rest) in enumerate(
        _ENTRY[kind].iter_unpack(value)
    ):
        part = f'entry {index}'
        if quality > 100 or millimetres > _FAR_MM:
            return Fault('impossible distance', part)
        if rest and (rest[3] > 100 or max(map(abs, rest[:3])) > _FAR_MM):
            return Fault('impossible place of an anchor', part)
        if address in seen:
            return Fault('anchor named twice', part)
        seen.add(address)
    return None
