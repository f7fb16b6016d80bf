"""Signals as a question."""

from __future__ import annotations

import os
import signal

import pytest

from tablerunner_bringup.interrupts import Interrupts


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupts_first_asks_second_insists(number):
    """One signal asks for an orderly end, two for an end at once; none raises."""
    with Interrupts() as interrupts:
        assert not interrupts.asked
        os.kill(os.getpid(), number)
        assert interrupts.asked
        assert not interrupts.insisted
        os.kill(os.getpid(), number)
        assert interrupts.insisted
    assert interrupts.name == number.name


def test_interrupts_old_handlers_come_back():
    """Afterwards a Ctrl-C raises KeyboardInterrupt again."""
    before = signal.getsignal(signal.SIGINT)
    with Interrupts():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before
