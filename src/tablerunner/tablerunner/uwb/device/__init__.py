"""Devices on a port, a socket or in a capture: opened, read, opened again. See docs/protocols.md.

No ROS here; `uwb_driver` publishes what comes out.
"""

from tablerunner.uwb.device.build import build_session
from tablerunner.uwb.device.config import DEVICES, EXCHANGES, DeviceConfig
from tablerunner.uwb.device.reader import DeviceReader
from tablerunner.uwb.device.session import Batch, DeviceHealth, DeviceSession, LinkState

__all__ = [
    'DEVICES',
    'EXCHANGES',
    'Batch',
    'DeviceConfig',
    'DeviceHealth',
    'DeviceReader',
    'DeviceSession',
    'LinkState',
    'build_session',
]
