"""Domains: two runs never share one."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys

import pytest

from tablerunner_bringup import domains
from tablerunner_bringup.domains import DomainError, acquire, claim, is_silent

QUIET = range(60, 66)


def test_acquire_taken_domain_is_passed_over(tmp_path):
    """As many runs as there are domains get one each; the next one is refused."""
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(acquire(QUIET, tmp_path)) for _ in QUIET]
        assert sorted(domain.number for domain in held) == list(QUIET)
        with pytest.raises(DomainError, match='--domain'):
            acquire(QUIET, tmp_path)
    with acquire(QUIET, tmp_path) as again:
        assert again.number in QUIET


def test_acquire_holder_killed_frees_domain(tmp_path):
    """A run that was killed does not keep its domain."""
    code = (
        'import sys, time; from pathlib import Path; from tablerunner_bringup.domains import '
        'acquire; d = acquire([61], Path(sys.argv[1])); print(d.number, flush=True); '
        'time.sleep(60)'
    )
    holder = subprocess.Popen(
        [sys.executable, '-c', code, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline().strip() == '61'
        with pytest.raises(DomainError):
            acquire([61], tmp_path)
    finally:
        holder.kill()
        holder.communicate()
    with acquire([61], tmp_path) as domain:
        assert domain.number == 61


@pytest.mark.parametrize('offset', [0, 10])
def test_acquire_foreign_participant_is_passed_over(tmp_path, offset):
    """A domain in which a program that knows no locks speaks is not taken."""
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as foreign:
        foreign.bind(('', 7400 + 250 * 62 + offset))
        assert not is_silent(62)
        with acquire([62, 63], tmp_path) as domain:
            assert domain.number == 63
    assert is_silent(62)


def test_release_twice_is_harmless(tmp_path):
    """Releasing again does not close somebody else's file."""
    domain = acquire(QUIET, tmp_path)
    domain.release()
    domain.release()


@pytest.mark.parametrize('number', [-1, 233])
def test_claim_outside_range_is_refused(tmp_path, number):
    """The ports of DDS end at domain 232."""
    with pytest.raises(DomainError, match=str(number)):
        claim(number, tmp_path)


def test_claim_held_domain_is_refused(tmp_path):
    """Two simulated robots in one domain would drive each other."""
    with (
        acquire([62], tmp_path),
        pytest.raises(DomainError, match='62 is held by another run'),
    ):
        claim(62, tmp_path)
    with claim(62, tmp_path) as domain:
        assert domain.number == 62
        with pytest.raises(DomainError):
            acquire([62], tmp_path)


def test_runtime_folder_foreign_file_is_refused(tmp_path, monkeypatch):
    """A file in the folder's place is said plainly."""
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(tmp_path))
    (tmp_path / 'tablerunner').write_text('', encoding='utf-8')
    with pytest.raises(DomainError):
        domains.runtime_folder()
