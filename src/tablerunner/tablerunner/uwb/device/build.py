"""A session from its configuration."""

from __future__ import annotations

import time
from collections.abc import Sequence

from tablerunner.uwb.device.anchor_names import anchor_names
from tablerunner.uwb.device.capture_file import CaptureFile, CaptureWriter
from tablerunner.uwb.device.config import BAUD, DeviceConfig
from tablerunner.uwb.device.datagrams import Datagrams
from tablerunner.uwb.device.dialogue import Dialogue
from tablerunner.uwb.device.range_maker import RangeMaker
from tablerunner.uwb.device.serial_port import SerialPort
from tablerunner.uwb.device.session import DeviceSession
from tablerunner.uwb.device.shell_dialogue import ShellDialogue
from tablerunner.uwb.device.source import Source
from tablerunner.uwb.device.tlv_dialogue import TlvDialogue
from tablerunner.uwb.protocol import open_protocol

BITS_OF_A_BYTE = 10  # with start and stop bit


def build_session(config: DeviceConfig, anchor_ids: Sequence[str]) -> DeviceSession:
    """Return the session of a device other than `EXCHANGES`.

    Parameters
    ----------
    config : DeviceConfig
    anchor_ids : sequence of str
        Names of the anchors in the map, in the order of ``device_ids``.

    Raises
    ------
    ConfigError
        An id that the device cannot have, or a file that cannot be used.
    """
    source = _source(config)
    protocol = source.protocol if isinstance(source, CaptureFile) else config.protocol
    names = anchor_names(protocol, config.device_ids, anchor_ids)
    parser = open_protocol(protocol)
    baud = config.baud or BAUD.get(protocol, 0)
    parser.byte_ns = BITS_OF_A_BYTE * 1e9 / baud if baud else 0.0
    capture = None
    if config.capture_file:
        capture = CaptureWriter(config.capture_file, protocol, time.time_ns())
    return DeviceSession(
        source,
        parser,
        _dialogue(config, baud),
        RangeMaker(parser, names, config.device_tag, config.least_delay),
        config.reconnect,
        capture,
    )


def _source(config: DeviceConfig) -> Source:
    if config.device == 'replay':
        replay = config.replay
        return CaptureFile(replay.file, replay.rate, replay.stamps == 'captured')
    if config.device == 'udp':
        return Datagrams(config.udp.address, config.udp.port)
    return SerialPort(config.serial.port, config.baud)


def _dialogue(config: DeviceConfig, baud: int) -> Dialogue:
    if config.device in ('udp', 'replay'):
        return Dialogue(config.device, silent_well=True)
    if config.device == 'linktrack':
        return Dialogue(f'linktrack at {baud} bit/s')
    what = f'dwm1001 in mode {config.dwm1001.mode} at {baud} bit/s'
    if config.dwm1001.mode == 'tlv':
        return TlvDialogue(config.dwm1001.poll_rate, what)
    return ShellDialogue(config.dwm1001.mode, what)
