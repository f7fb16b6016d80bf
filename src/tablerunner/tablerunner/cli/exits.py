"""Exit codes of the command."""

DONE = 0
"""The job is done."""

FAILED = 1
"""The job was tried and failed: not delivered, a bound missed."""

BAD_INPUT = 2
"""What was given cannot be used."""
