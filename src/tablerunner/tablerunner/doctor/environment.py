"""Is this machine set up: programs, middleware, discovery, serial ports."""

from __future__ import annotations

import math
from collections.abc import Iterator

from tablerunner.doctor.facts import DiscoveryFacts, EnvironmentFacts, Facts, SerialFacts
from tablerunner.doctor.finding import Finding, error, ok, warning

ENVIRONMENT, DISCOVERY, SERIAL = 'environment', 'discovery', 'serial'

RANGES = ('', 'SUBNET', 'LOCALHOST', 'OFF', 'SYSTEM_DEFAULT')
LAST_DOMAIN = 101
"""Above it the ports of DDS are those that Linux hands out to anybody."""

_OLDEST_PYTHON = (3, 10)
_OPEN = 'source env.sh (with ROS 2: install/setup.bash); if that does not help, make setup'
_FIRST_YEAR = 2024


def check_environment(facts: Facts) -> Iterator[Finding]:
    """Yield whether everything that runs is there."""
    found = facts.environment
    version = '.'.join(map(str, found.python))
    if found.python[:2] < _OLDEST_PYTHON:
        advice = 'use Python 3.10 or later: make PYTHON=python3.12 setup'
        yield error(ENVIRONMENT, 'python', f'{version} is too old', advice)
    else:
        yield ok(ENVIRONMENT, 'python', version)
    for what, names in (
        ('packages', found.missing_packages),
        ('programs', found.missing_programs),
    ):
        if names:
            yield error(ENVIRONMENT, what, f'missing: {", ".join(names)}', _OPEN)
        else:
            yield ok(ENVIRONMENT, what, 'all there')
    if found.middleware:
        yield ok(ENVIRONMENT, 'middleware', found.middleware)
    else:
        asked = found.variables.get('RMW_IMPLEMENTATION', '')
        advice = 'unset RMW_IMPLEMENTATION, or install what it names' if asked else _OPEN
        yield error(ENVIRONMENT, 'middleware', f'{asked or "none"} cannot be loaded', advice)
    yield from _variables(found)
    if found.year < _FIRST_YEAR:
        yield error(
            ENVIRONMENT,
            'clock',
            f'the clock of this machine says {found.year}',
            'set it: a board without a battery needs NTP (timedatectl, chrony) before ROS starts',
        )


def _variables(found: EnvironmentFacts) -> Iterator[Finding]:
    domain = found.variables.get('ROS_DOMAIN_ID', '')
    if domain and not (domain.isdigit() and int(domain) <= LAST_DOMAIN):
        yield error(
            ENVIRONMENT,
            'ROS_DOMAIN_ID',
            f'{domain!r} is no usable domain',
            f'export ROS_DOMAIN_ID=N with N from 0 to {LAST_DOMAIN}, the same in every shell',
        )
    else:
        yield ok(ENVIRONMENT, 'ROS_DOMAIN_ID', domain or 'not set: 0')
    name = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
    reach = found.variables.get(name, '')
    if reach not in RANGES:
        expected = ', '.join(RANGES[1:])
        yield error(ENVIRONMENT, name, f'{reach!r} is unknown', f'use one of {expected}')
    elif reach == 'OFF':
        yield error(ENVIRONMENT, name, 'OFF: no node finds another', f'unset {name}')
    elif reach == 'LOCALHOST':
        yield ok(ENVIRONMENT, name, 'LOCALHOST: only nodes of this machine are found')
    else:
        yield ok(ENVIRONMENT, name, reach or 'not set: SUBNET')
    if found.variables.get('ROS_LOCALHOST_ONLY', '0') not in ('', '0'):
        yield warning(
            ENVIRONMENT,
            'ROS_LOCALHOST_ONLY',
            'set, which overrides ROS_AUTOMATIC_DISCOVERY_RANGE',
            'unset it and use ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST',
        )


def check_discovery(facts: Facts) -> Iterator[Finding]:
    """Yield whether nodes find each other, and whether any is there."""
    found = facts.discovery
    if math.isnan(found.loopback_s):
        yield error(
            DISCOVERY,
            'loopback',
            'two participants on this machine do not hear each other',
            'allow UDP ports 7400 and up and multicast 239.255.0.1 in the firewall; the loopback '
            'needs multicast (sudo ip link set lo multicast on); /dev/shm must be writable; a '
            'profile in FASTDDS_DEFAULT_PROFILES_FILE must fit',
        )
    else:
        words = f'two participants hear each other after {found.loopback_s:.1f} s'
        yield ok(DISCOVERY, 'loopback', words)
    if found.nodes:
        yield ok(DISCOVERY, f'domain {found.domain}', f'{len(found.nodes)} nodes')
        doubled = sorted({name for name in found.nodes if found.nodes.count(name) > 1})
        for name in doubled:
            yield error(
                DISCOVERY,
                name,
                'runs more than once under one name',
                'end all but one (ps ax | grep ' + name + '), or give each a namespace',
            )
        return
    yield error(DISCOVERY, f'domain {found.domain}', 'no node', _where(found))


def _where(found: DiscoveryFacts) -> str:
    if found.elsewhere:
        names = ', '.join(found.elsewhere[:4])
        return f'the nodes are in another namespace ({names}): give it by --namespace'
    if found.other_domains:
        first = found.other_domains[0]
        spoken = ', '.join(map(str, found.other_domains))
        return f'somebody speaks in domain {spoken}: try tablerunner doctor --domain {first}'
    return (
        'start the robot (tablerunner launch --no-sim --params robot.yaml); where it is another '
        'computer: the same ROS_DOMAIN_ID, and ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET on both'
    )


def check_serial(facts: Facts) -> Iterator[Finding]:
    """Yield whether the serial ports can be used."""
    if not facts.serial:
        yield ok(SERIAL, 'ports', 'none; right where ranges come by network or are simulated')
    for port in facts.serial:
        yield _port(port, facts.serial)


def _port(port: SerialFacts, all_ports: tuple[SerialFacts, ...]) -> Finding:
    if not port.exists:
        others = ', '.join(item.path for item in all_ports if item.exists) or 'none'
        return error(
            SERIAL,
            port.path,
            'is not there',
            f'plug the module in and look at dmesg; ports that are there: {others}; names under '
            '/dev/serial/by-id stay the same after replugging',
        )
    if not port.is_device:
        return error(SERIAL, port.path, 'is no serial port', 'give the path of a tty')
    if not port.accessible:
        advice = f'sudo usermod -aG {port.group} $USER, then log out and in again'
        found = error if port.wanted else warning
        return found(SERIAL, port.path, 'this user may not read and write it', advice)
    if len(port.holders) > 1:
        return error(
            SERIAL,
            port.path,
            f'open in several programs: {", ".join(port.holders)}',
            'each byte goes to one of them only: end all but the driver (ModemManager, too: sudo '
            'systemctl disable --now ModemManager)',
        )
    held = f', open in {port.holders[0]}' if port.holders else ''
    return ok(SERIAL, port.path, f'can be used{held}')
