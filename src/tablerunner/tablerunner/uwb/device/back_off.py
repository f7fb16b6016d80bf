"""How long to wait before the next try: ever longer, up to a limit."""

from __future__ import annotations


class BackOff:
    """Doubles from `first_s` to `longest_s` [s]."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._next_s = first_s

    def next_s(self) -> float:
        """Return how long to wait now [s]."""
        wait_s = min(self._next_s, self._longest_s)
        self._next_s = min(2.0 * wait_s, self._longest_s)
        return wait_s

    def reset(self) -> None:
        """Begin with the shortest wait again."""
        self._next_s = self._first_s
