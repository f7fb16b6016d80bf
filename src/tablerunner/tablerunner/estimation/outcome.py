"""What one input of the localiser led to."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.types import Estimate, Innovation, Refusal


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one input led to."""

    estimate: Estimate | None = None  # newest belief, if this input changed it
    innovations: tuple[Innovation, ...] = ()
    refusals: tuple[Refusal, ...] = ()


def refused(stamp: int, source: str, key: str, reason: str) -> Outcome:
    """Return the outcome of an input that was refused for a reason."""
    return Outcome(None, (), (Refusal(stamp, source, key, reason),))
