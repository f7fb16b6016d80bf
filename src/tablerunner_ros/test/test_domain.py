"""A domain for each test, whoever tests beside it."""

from __future__ import annotations

import subprocess
import sys
import tempfile

import pytest

from tablerunner_ros.testing.domain import DOMAINS, NoDomainError, lease_domain


@pytest.fixture(autouse=True)
def _locks_of_its_own(monkeypatch, tmp_path):
    """Keep out of the way of the tests that run meanwhile."""
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))


def test_domain_that_has_been_free_for_longest_is_taken():
    """So none is taken twice before all the others were, by whichever process."""
    code = (
        'import sys, tempfile; tempfile.tempdir = sys.argv[1]\n'
        'from tablerunner_ros.testing.domain import lease_domain\n'
        'for _ in range(5):\n    with lease_domain() as number: print(number)\n'
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


def test_domain_that_is_held_is_passed_over_until_none_is_left():
    leases = [lease_domain() for _ in DOMAINS]
    assert sorted(lease.__enter__() for lease in leases) == list(DOMAINS)
    with pytest.raises(NoDomainError, match='all in use'), lease_domain():
        pass
    leases[4].__exit__(None, None, None)
    with lease_domain() as number:
        assert number in DOMAINS
    for lease in leases[:4] + leases[5:]:
        lease.__exit__(None, None, None)
