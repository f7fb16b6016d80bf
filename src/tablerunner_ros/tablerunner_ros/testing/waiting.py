"""Waiting for a condition, never for a time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar('T')

LIMIT_S = 20.0
"""How long to wait before a test fails; generous, since machines under test may be slow."""


def wait_for(
    condition: Callable[[], T], what: str, limit_s: float = LIMIT_S, step_s: float = 0.01
) -> T:
    """Call `condition` until it returns something true, and return that.

    Raises
    ------
    AssertionError
        Not within `limit_s`; `what` says in words what was waited for.
    """
    end = time.monotonic() + limit_s
    while True:
        result = condition()
        if result:
            return result
        if time.monotonic() > end:
            raise AssertionError(f'waited {limit_s:g} s in vain for {what}')
        time.sleep(step_s)
