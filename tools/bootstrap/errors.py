"""The one exception of the set-up."""

from __future__ import annotations


class SetupError(Exception):
    """Something is missing or went wrong; the message says what, and what to do."""
