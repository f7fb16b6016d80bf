"""Which device, where it is, and how to talk to it."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError

EXCHANGES = 'exchanges'
DEVICES = (EXCHANGES, 'dwm1001', 'linktrack', 'udp', 'replay')
BAUD = {'dwm1001': 115_200, 'dwm1001_tlv': 115_200, 'linktrack': 921_600}
"""Bits a second on the line, where nothing else is asked for, by protocol."""


@dataclass(frozen=True)
class SerialConfig(Config):
    """The serial port of `dwm1001` and `linktrack`."""

    port: str = parameter('', description='Path of the port, e.g. /dev/serial/by-id/...')
    baud: int = parameter(
        0,
        unit='bit/s',
        description='Speed of the port; 0: 115200 for dwm1001, 921600 for linktrack',
        low=0,
        high=12_000_000,
    )


@dataclass(frozen=True)
class Dwm1001Config(Config):
    """How a DWM1001 is asked."""

    mode: str = parameter(
        'lec',
        description='Lines of the shell (lec, les) or the binary interface (tlv)',
        choices=('lec', 'les', 'tlv'),
    )
    poll_rate: float = parameter(
        50.0,
        unit='Hz',
        description='How often tlv asks whether there is a new location',
        above=0.0,
        high=200.0,
    )


@dataclass(frozen=True)
class UdpConfig(Config):
    """Where datagrams are waited for."""

    address: str = parameter(
        '', description='IPv4 address of the interface to listen on; empty: all'
    )
    port: int = parameter(0, description='Port to listen on', low=0, high=65_535)


@dataclass(frozen=True)
class ReplayConfig(Config):
    """How a capture is played."""

    file: str = parameter('', description='Path of the capture')
    rate: float = parameter(
        1.0,
        description='How many times faster than it was taken',
        above=0.0,
        high=1000.0,
    )
    stamps: str = parameter(
        'now',
        description='Times of the ranges: moved to the present, or as captured',
        choices=('now', 'captured'),
    )


@dataclass(frozen=True)
class ReconnectConfig(Config):
    """When a device is given up, and when it is tried again."""

    first: float = parameter(
        0.5,
        unit='s',
        description='Wait before a port that could not be opened is tried again; it doubles',
        above=0.0,
        high=60.0,
    )
    longest: float = parameter(
        8.0, unit='s', description='Longest of these waits', above=0.0, high=600.0
    )
    patience: float = parameter(
        10.0,
        unit='s',
        description='Time without anything understood after which the port is opened anew',
        low=2.0,
        high=3600.0,
    )


@dataclass(frozen=True)
class DeviceConfig(Config):
    """Where the ranges come from."""

    device: str = parameter(
        EXCHANGES,
        description='Where the ranges come from: exchanges takes uwb/exchanges, the others read '
        'a device or a capture of one',
        choices=DEVICES,
    )
    device_ids: tuple[str, ...] = parameter(
        (),
        description="The device's id of each of anchor_ids, as '022E' or 'anchor3'; empty: the "
        'same',
    )
    device_tag: str = parameter(
        '', description='Only ranges of this tag are taken; empty: of the first that reports'
    )
    least_delay: float = parameter(
        0.0,
        unit='s',
        description='What the fastest message takes from ranging to arrival, where that is known',
        low=0.0,
        high=1.0,
    )
    capture_file: str = parameter(
        '', description='What the device sends is added to this file; empty: it is not kept'
    )
    serial: SerialConfig = parameter(factory=SerialConfig, description='The serial port')
    dwm1001: Dwm1001Config = parameter(factory=Dwm1001Config, description='How a DWM1001 is asked')
    udp: UdpConfig = parameter(factory=UdpConfig, description='Where datagrams are waited for')
    replay: ReplayConfig = parameter(factory=ReplayConfig, description='How a capture is played')
    reconnect: ReconnectConfig = parameter(
        factory=ReconnectConfig, description='When to try again'
    )

    def check(self) -> None:
        """Check that what the device needs is given."""
        if self.device in ('dwm1001', 'linktrack') and not self.serial.port:
            raise ConfigError(
                'serial.port', '', f'the path of a serial port for device {self.device}'
            )
        if self.device == 'udp' and not self.udp.port:
            raise ConfigError('udp.port', 0, 'a port from 1 to 65535 for device udp')
        if self.udp.address and not _is_ipv4(self.udp.address):
            raise ConfigError('udp.address', self.udp.address, 'an IPv4 address, or nothing')
        if self.device == 'replay' and not self.replay.file:
            raise ConfigError('replay.file', '', 'the path of a capture for device replay')
        if self.reconnect.longest < self.reconnect.first:
            raise ConfigError(
                'reconnect.longest',
                self.reconnect.longest,
                f'at least reconnect.first, {self.reconnect.first:g}',
            )
        if self.capture_file and self.device in (EXCHANGES, 'replay'):
            raise ConfigError('capture_file', self.capture_file, f'none for device {self.device}')

    @property
    def protocol(self) -> str:
        """Name of the protocol that the device speaks; empty where a capture says it."""
        if self.device == 'dwm1001':
            return 'dwm1001_tlv' if self.dwm1001.mode == 'tlv' else 'dwm1001'
        return self.device if self.device in ('linktrack', 'udp') else ''

    @property
    def baud(self) -> int:
        """Bits a second on the line, given or the protocol's own; 0 where there is none."""
        return self.serial.baud or BAUD.get(self.protocol, 0)


def _is_ipv4(text: str) -> bool:
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True
