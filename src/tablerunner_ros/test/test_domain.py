"""A domain for each test, whoever tests beside it."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile

import pytest
from rclpy.action import ActionClient

from tablerunner_interfaces.action import Deliver
from tablerunner_ros.testing.domain import (
    DOMAINS,
    DomainLeftError,
    NoDomainError,
    is_spoken_in,
    lease_domain,
)
from tablerunner_ros.testing.probe import Probe


@pytest.fixture
def locks_only(monkeypatch, tmp_path):
    """Keep out of the way of the tests that run meanwhile, which speak in the same domains."""
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    monkeypatch.setattr('tablerunner_ros.testing.domain.is_spoken_in', lambda number: False)


def test_domain_that_has_been_free_for_longest_is_taken(locks_only):
    """So none is taken twice before all the others were, by whichever process."""
    code = (
        'import sys, tempfile; tempfile.tempdir = sys.argv[1]\n'
        'from tablerunner_ros.testing import domain\n'
        'domain.is_spoken_in = lambda number: False\n'
        'for _ in range(5):\n    with domain.lease_domain() as number: print(number)\n'
    )
    taken = []
    for _ in DOMAINS[5:]:
        with lease_domain() as number:
            taken.append(number)
    done = subprocess.run(
        [sys.executable, '-c', code, tempfile.gettempdir()],
        capture_output=True,
        text=True,
        check=True,
    )
    taken += map(int, done.stdout.split())
    assert sorted(taken) == list(DOMAINS)
    with lease_domain() as number:
        assert number == taken[0]


def test_domain_that_is_held_is_passed_over_until_none_is_left(locks_only):
    leases = [lease_domain() for _ in DOMAINS]
    assert sorted(lease.__enter__() for lease in leases) == list(DOMAINS)
    with pytest.raises(NoDomainError, match='all in use'), lease_domain():
        pass
    leases[4].__exit__(None, None, None)
    with lease_domain() as number:
        assert number in DOMAINS
    for lease in leases[:4] + leases[5:]:
        lease.__exit__(None, None, None)


def test_domain_with_a_participant_left_is_named_and_not_leased_again(monkeypatch):
    monkeypatch.setattr('tablerunner_ros.testing.domain._QUIET_S', 0.1)
    with contextlib.ExitStack() as stack:
        with pytest.raises(DomainLeftError, match='left in domain'), lease_domain() as number:
            stack.callback(Probe(number).close)
        monkeypatch.setattr('tablerunner_ros.testing.domain.DOMAINS', (number,))
        with pytest.raises(NoDomainError), lease_domain():
            pass
    with lease_domain() as again:
        assert again == number


def test_probe_that_asked_for_an_action_leaves_nobody():
    with lease_domain() as number:
        probe = Probe(number)
        client = ActionClient(probe.node, Deliver, 'deliver')
        probe.close()
        assert not is_spoken_in(number)
        del client
