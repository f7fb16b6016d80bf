"""Device protocols: bytes in, records out; no port is opened here. See docs/protocols.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from tablerunner.uwb.protocol.capture import Replay, capture_chunk, capture_header
from tablerunner.uwb.protocol.clock_mapping import ClockMapping, MappedStamp
from tablerunner.uwb.protocol.dwm1001_shell import Dwm1001Shell
from tablerunner.uwb.protocol.dwm1001_tlv import Dwm1001Tlv
from tablerunner.uwb.protocol.linktrack import LinkTrack
from tablerunner.uwb.protocol.parser import Parser
from tablerunner.uwb.protocol.record import (
    DeviceFact,
    DevicePosition,
    DeviceRange,
    Parsed,
    to_sample,
)
from tablerunner.uwb.protocol.udp import Udp

PROTOCOLS: Mapping[str, Callable[[], Parser]] = MappingProxyType(
    {
        'dwm1001': Dwm1001Shell,
        'dwm1001_tlv': Dwm1001Tlv,
        'linktrack': LinkTrack,
        'udp': Udp,
    }
)
"""What makes the parser of each protocol, with its defaults."""


def open_protocol(name: str) -> Parser:
    """Return a new parser of a protocol; `KeyError` where there is none of this name."""
    return PROTOCOLS[name]()


__all__ = [
    'PROTOCOLS',
    'ClockMapping',
    'DeviceFact',
    'DevicePosition',
    'DeviceRange',
    'Dwm1001Shell',
    'Dwm1001Tlv',
    'LinkTrack',
    'MappedStamp',
    'Parsed',
    'Parser',
    'Replay',
    'Udp',
    'capture_chunk',
    'capture_header',
    'open_protocol',
    'to_sample',
]
