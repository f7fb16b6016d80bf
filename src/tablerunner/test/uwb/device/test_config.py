"""What a device needs is asked for by name, and ids are read as people write them."""

import re

import pytest

from tablerunner.errors import ConfigError
from tablerunner.uwb.device import build
from tablerunner.uwb.device.anchor_names import anchor_names, device_id
from tablerunner.uwb.device.build import build_session
from tablerunner.uwb.device.config import (
    DeviceConfig,
    Dwm1001Config,
    ReconnectConfig,
    SerialConfig,
    UdpConfig,
)
from tablerunner.uwb.protocol import open_protocol


@pytest.mark.parametrize(
    ('settings', 'words'),
    [
        ({'device': 'sonar'}, "device: got 'sonar', expected one of exchanges, dwm1001"),
        ({'device': 'dwm1001'}, "serial.port: got '', expected the path of a serial port for"),
        ({'device': 'linktrack'}, "serial.port: got '', expected the path of a serial port for"),
        ({'device': 'udp'}, 'udp.port: got 0, expected a port from 1 to 65535'),
        (
            {'device': 'udp', 'udp': UdpConfig(address='robot', port=9)},
            "udp.address: got 'robot', expected an IPv4 address",
        ),
        ({'device': 'replay'}, "replay.file: got '', expected the path of a capture"),
        (
            {'reconnect': ReconnectConfig(first=9.0)},
            'reconnect.longest: got 8.0, expected at least reconnect.first, 9',
        ),
        ({'capture_file': 'x'}, "capture_file: got 'x', expected none for device exchanges"),
    ],
)
def test_what_is_missing_is_named(settings, words):
    with pytest.raises(ConfigError, match='^' + re.escape(words)):
        DeviceConfig(**settings)


@pytest.mark.parametrize(
    ('protocol', 'written', 'expected'),
    [
        ('dwm1001', '022E', '022E'),
        ('dwm1001', '22e', '022E'),
        ('dwm1001_tlv', '0x22E', '022E'),
        ('dwm1001', 'DW022E', '022E'),
        ('dwm1001', 'DECA50BFBF5001D2', 'DECA50BFBF5001D2'),
        ('dwm1001', 'north', ''),
        ('dwm1001', '12345', ''),
        ('linktrack', 'anchor3', 'anchor3'),
        ('linktrack', 'Anchor03', 'anchor3'),
        ('linktrack', '3', 'anchor3'),
        ('linktrack', 'tag255', 'tag255'),
        ('linktrack', 'anchor256', ''),
        ('linktrack', 'anker3', ''),
        ('udp', 'any thing', 'any thing'),
    ],
)
def test_id_as_people_write_it(protocol, written, expected):
    assert device_id(protocol, written) == expected


def test_names_by_the_devices_ids():
    assert anchor_names('linktrack', ['anchor0', '7'], ['north', 'south']) == {
        'anchor0': 'north',
        'anchor7': 'south',
    }
    assert anchor_names('linktrack', [], ['anchor0']) == {}


@pytest.mark.parametrize(
    ('ids', 'words'),
    [
        (['0A01'], "device_ids: got ('0A01',), expected 2 ids, one for each of anchor_ids"),
        (['0A01', 'A1B2C'], "device_ids[1]: got 'A1B2C', expected a 16-bit address in hex"),
        (['0A01', 'a01'], "device_ids[1]: got 'a01', expected each id once"),
    ],
)
def test_bad_ids_are_named(ids, words):
    with pytest.raises(ConfigError, match='^' + re.escape(words)):
        anchor_names('dwm1001', ids, ['north', 'south'])


def test_capture_that_cannot_be_written_is_named(tmp_path):
    config = DeviceConfig(
        device='udp', udp=UdpConfig(port=9), capture_file=str(tmp_path / 'no' / 'where')
    )
    with pytest.raises(ConfigError, match=r'capture_file: got .*: No such file'):
        build_session(config, [])


def test_baud_rate_is_the_protocols_own_or_as_given():
    port = SerialConfig(port='/dev/x')
    assert DeviceConfig(device='linktrack', serial=port).baud == 921_600
    assert DeviceConfig(device='dwm1001', serial=port).baud == 115_200
    tlv = DeviceConfig(device='dwm1001', serial=port, dwm1001=Dwm1001Config(mode='tlv'))
    assert (tlv.baud, tlv.protocol) == (115_200, 'dwm1001_tlv')
    assert DeviceConfig(device='linktrack', serial=port.replace(baud=460_800)).baud == 460_800


def test_serial_parser_knows_the_speed_of_the_wire(monkeypatch):
    """Frames that come in one read are dated by it; datagrams have none."""
    made = []

    def keep(name):
        made.append(open_protocol(name))
        return made[-1]

    monkeypatch.setattr(build, 'open_protocol', keep)
    port = SerialConfig(port='/dev/x', baud=460_800)
    build_session(DeviceConfig(device='linktrack', serial=port), [])
    build_session(DeviceConfig(device='udp', udp=UdpConfig(port=9)), [])
    assert [parser.byte_ns for parser in made] == [pytest.approx(1e10 / 460_800), 0.0]
