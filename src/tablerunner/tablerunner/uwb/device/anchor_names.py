"""Ids of anchors as devices write them, and as people do; and the names they have in the map."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from tablerunner.errors import ConfigError
from tablerunner.uwb.protocol.linktrack import ROLES

_ADDRESS = re.compile(r'(?:0x|DW|ID)?([0-9A-F]{1,4}|[0-9A-F]{16})', re.IGNORECASE)
_NODE = re.compile(rf'({"|".join(ROLES)})?(\d{{1,3}})', re.IGNORECASE)


def device_id(protocol: str, written: str) -> str:
    """Return an id as the parser of a protocol gives it; empty where it is none.

    Parameters
    ----------
    protocol : str
        Name of the protocol, of `PROTOCOLS`.
    written : str
        As people write it: ``022E``, ``0x22e`` or ``DW022E`` (the label) for a DWM1001,
        ``anchor3`` or ``3`` for a LinkTrack.
    """
    if protocol.startswith('dwm1001'):
        address = _ADDRESS.fullmatch(written)
        return address[1].upper().rjust(4, '0') if address else ''
    if protocol == 'linktrack':
        node = _NODE.fullmatch(written)
        if node is None or int(node[2]) > 255:
            return ''
        return f'{(node[1] or "anchor").lower()}{int(node[2])}'
    return written


def anchor_names(
    protocol: str, device_ids: Sequence[str], anchor_ids: Sequence[str]
) -> Mapping[str, str]:
    """Return the name of each anchor by the device's id of it; empty where none are given.

    Raises
    ------
    ConfigError
        Not one id for each anchor, an id that the protocol cannot have, or one given twice.
    """
    if device_ids and len(device_ids) != len(anchor_ids):
        raise ConfigError(
            'device_ids', tuple(device_ids), f'{len(anchor_ids)} ids, one for each of anchor_ids'
        )
    names: dict[str, str] = {}
    for index, (written, name) in enumerate(zip(device_ids, anchor_ids, strict=False)):
        known = device_id(protocol, written)
        if not known:
            raise ConfigError(f'device_ids[{index}]', written, _EXPECTED.get(protocol, 'an id'))
        if known in names:
            raise ConfigError(f'device_ids[{index}]', written, 'each id once')
        names[known] = name
    return names


_EXPECTED = {
    'dwm1001': "a 16-bit address in hexadecimal, in quotes, as '022E'",
    'dwm1001_tlv': "a 16-bit address in hexadecimal, in quotes, as '022E'",
    'linktrack': "a role and a number up to 255, as 'anchor3'",
}
