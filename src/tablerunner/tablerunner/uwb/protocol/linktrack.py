"""Nooploop LinkTrack: NodeFrame2 and NodeFrame3, which list the distances to other nodes.

Frame tables and where they come from: docs/protocols.md. All numbers are little-endian.
"""

from __future__ import annotations

import struct

from tablerunner.uwb.protocol.framed import Fault, FramedParser
from tablerunner.uwb.protocol.parser import TRUNCATED
from tablerunner.uwb.protocol.record import DevicePosition, DeviceRange

ROLES = ('node', 'anchor', 'tag', 'console', 'dt_master', 'dt_slave', 'monitor')

_HEADER = 0x55
_FRAME2, _FRAME3 = 0x04, 0x05
_FIXED = {_FRAME2: 119, _FRAME3: 21}  # bytes before the nodes
_NODE = {_FRAME2: struct.Struct('<BBHbBB6x'), _FRAME3: struct.Struct('<BBHbBB')}
_SYSTEM_TIME = {_FRAME2: 6, _FRAME3: 10}
_UINT32 = struct.Struct('<I')
_POSITION = struct.Struct('<BBBHbHbHb')  # precision [cm] and place [mm, 24 bits] by axis
_POSITION_AT = 10
_NO_POSITION_MM = -8_388_000
_MOST_NODES = 255


def device_name(role: int, number: int) -> str:
    """Return a node's id in our writing of it: the role and the number, as ``anchor3``."""
    return f'{ROLES[role]}{number}'


_NAMES = {
    (role, number): device_name(role, number)
    for role in range(len(ROLES))
    for number in range(256)
}


class LinkTrack(FramedParser):
    """Reads NodeFrame2 and NodeFrame3 in any mixture, and passes over other frames.

    The checksum is the sum of all bytes modulo 256: one byte that changed never passes, damage to
    several passes once in 256 times. So roles, node numbers and the count of nodes must be in
    order as well.
    """

    source = 'linktrack'
    tick_ns = 1e6
    counter_bits = 32
    longest = _FIXED[_FRAME2] + _MOST_NODES * _NODE[_FRAME2].size + 1

    def _find(self, buffer: bytes, at: int, first: bool) -> int:  # noqa: ARG002  no continuation
        return buffer.find(_HEADER, at)

    def _tail(self, buffer: bytes, begin: int) -> int:  # noqa: ARG002  a lone header waits itself
        return len(buffer)

    def _length(self, buffer: bytes, start: int) -> int:
        head = buffer[start + 1 : start + 4]
        if not head:
            return -1
        mark = head[0]
        if mark not in _FIXED:
            return 0
        if len(head) < 3:
            return -1
        length = head[1] | head[2] << 8
        count, rest = divmod(length - _FIXED[mark] - 1, _NODE[mark].size)
        if rest or not 0 <= count <= _MOST_NODES:
            return 0
        told = start + _FIXED[mark] - 1
        if told < len(buffer) and buffer[told] != count:
            return 0
        return length

    def _fault(self, buffer: bytes, start: int, length: int) -> Fault | None:
        end = start + length - 1
        if sum(memoryview(buffer)[start:end]) & 0xFF != buffer[end]:
            return Fault('checksum does not agree', 'checksum')
        if buffer.find(buffer[start : start + 4], start + 1, end + 1) >= 0:
            return Fault(TRUNCATED, 'nodes')
        if buffer[start + 4] >= len(ROLES):
            return Fault('unknown role', 'header')
        mark = buffer[start + 1]
        size, first = _NODE[mark].size, start + _FIXED[mark]
        seen = set()
        for index, at in enumerate(range(first, end, size)):
            node = buffer[at : at + 2]
            if node[0] >= len(ROLES):
                return Fault('unknown role', f'node {index}')
            if node in seen:
                return Fault('node named twice', f'node {index}')
            seen.add(node)
        return None

    def _decode(self, buffer: bytes, start: int, length: int) -> None:
        mark = buffer[start + 1]
        device = _NAMES[buffer[start + 4], buffer[start + 5]]
        (ticks,) = _UINT32.unpack_from(buffer, start + _SYSTEM_TIME[mark])
        if mark == _FRAME2:
            self._decode_position(buffer, start, device)
        nodes = memoryview(buffer)[start + _FIXED[mark] : start + length - 1]
        for role, number, low, high, first_path, received in _NODE[mark].iter_unpack(nodes):
            self._give(
                DeviceRange(
                    self._stamp,
                    device,
                    _NAMES[role, number],
                    ((high << 16) + low) / 1000.0,
                    rx_power_dbm=received / -2.0,
                    first_path_power_dbm=first_path / -2.0,
                    ticks=ticks,
                )
            )

    def _decode_position(self, buffer: bytes, start: int, device: str) -> None:
        _, _, _, x, x_high, y, y_high, z, z_high = _POSITION.unpack_from(
            buffer, start + _POSITION_AT
        )
        millimetres = ((x_high << 16) + x, (y_high << 16) + y, (z_high << 16) + z)
        if _NO_POSITION_MM not in millimetres:
            x_m, y_m, z_m = (number / 1000.0 for number in millimetres)
            self._give(DevicePosition(self._stamp, device, (x_m, y_m, z_m)))
