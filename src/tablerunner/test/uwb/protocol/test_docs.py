"""docs/protocols.md against the parsers: its examples are read, its tables are of this code."""

import json
import re
from pathlib import Path

import pytest
import yaml

from tablerunner.uwb.device import DEVICES, DeviceConfig
from tablerunner.uwb.device.anchor_names import anchor_names
from tablerunner.uwb.device.tlv_dialogue import ANSWER_S, LATE, Request
from tablerunner.uwb.protocol import PROTOCOLS, Dwm1001Shell, Dwm1001Tlv, LinkTrack, Udp
from tablerunner.uwb.protocol.dwm1001_tlv import ERRORS
from tablerunner.uwb.protocol.linktrack import ROLES

PAGE = (Path(__file__).parents[5] / 'docs' / 'protocols.md').read_text(encoding='utf-8')


def section(title):
    """Return the lines of a section."""
    return PAGE.split(f'\n## {title}\n')[1].split('\n## ')[0].splitlines()


def shown_bytes(title):
    """Return the bytes that a section shows in hexadecimal."""
    lines = [line for line in section(title) if re.fullmatch(r' {4}([0-9a-f]{2} ?)+', line)]
    return bytes.fromhex(' '.join(lines))


def test_linktrack_example():
    parsed = LinkTrack().feed(shown_bytes('LinkTrack'), 1)
    assert [(item.device, item.anchor, item.range_m) for item in parsed.ranges] == [
        ('tag1', 'anchor3', 3.0)
    ]


def test_tlv_example():
    parsed = Dwm1001Tlv().feed(shown_bytes('DWM1001: binary interface'), 1)
    assert parsed.records[0].place == (1.0, -1.0, 0.3)
    assert [(item.anchor, item.range_m) for item in parsed.ranges] == [('022E', 2.41)]


def test_shell_examples():
    lec, les, lep, *info = (
        line.strip().encode() + b'\r\n'
        for line in section('DWM1001: shell')
        if line.startswith('    ')
    )
    parser = Dwm1001Shell()
    facts = parser.feed(b''.join(info), 1).records
    assert [item.value for item in facts] == ['01030001', 'tn (act,twr,np,le)', 100, 10_000]
    assert [item.range_m for item in parser.feed(lec, 1).ranges] == [3.44, 5.68]
    assert parser.feed(les, 1).refusals[0].reason in PAGE
    assert [item.range_m for item in parser.feed(les, 1).ranges] == [3.38, 5.49]
    assert parser.feed(lep, 1).records[0].place == (7.1, 5.24, -2.03)


def test_udp_examples():
    examples = [line.strip().encode() for line in section('UDP') if line.startswith('    {')]
    assert len(examples) == 2
    for data in examples:
        assert [item.range_m for item in Udp().feed(data, 1).ranges] == [3.21]
    for field in json.loads(examples[1]):
        assert f'`{field}`' in '\n'.join(section('UDP'))


@pytest.mark.parametrize('name', sorted(PROTOCOLS))
def test_protocol_is_in_the_table_with_its_class_and_time(name):
    parser = PROTOCOLS[name]()
    (row,) = (line for line in PAGE.splitlines() if line.startswith(f'| `{name}` | `'))
    assert f'`{type(parser).__name__}`' in row
    assert ('none: arrival' in row) == (parser.counter_bits == 0)
    if parser.counter_bits:
        unit = {1e6: '1 ms', 1e3: '1 µs'}[parser.tick_ns]
        assert f'{parser.counter_bits} bits of {unit}' in row


def test_roles_and_errors_are_told():
    assert ', '.join(f'{index} {role}' for index, role in enumerate(ROLES)) in PAGE
    assert all(f'{code} ' in PAGE for code in ERRORS)
    assert f'LinkTrack {LinkTrack.longest} bytes' in PAGE
    assert f'TLV {Dwm1001Tlv.longest},' in PAGE


def test_devices_defaults_and_requests_are_told():
    """What the page says of the driver is what the code does."""
    config = DeviceConfig()
    text = ' '.join(PAGE.split())
    for name in DEVICES:
        assert any(line.startswith(f'| `{name}` |') for line in PAGE.splitlines())
    reconnect = config.reconnect
    assert (reconnect.first, reconnect.longest, reconnect.patience) == (0.5, 8.0, 10.0)
    assert 'after 0.5 s, 1 s, 2 s ... 8 s (`reconnect.first`, `reconnect.longest`)' in text
    assert '`reconnect.patience` (10 s)' in text
    assert f'`dwm1001.poll_rate`, {config.dwm1001.poll_rate:g} Hz' in text
    assert f'later than {ANSWER_S:g} s is refused (`{LATE}`)' in text
    for request in list(Request)[:5]:
        assert f'(`{request.value.hex(" ")}`)' in text
    example = PAGE.split('# robot.yaml\n')[1].split('\n\n')[0]
    given = yaml.safe_load(example)['/**/uwb_driver']['ros__parameters']
    names = anchor_names('dwm1001', given['device_ids'], given['anchor_ids'])
    assert names['022E'] == 'north'
    assert len(given['anchor_positions']) == 3 * len(names) == 12
