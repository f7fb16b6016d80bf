"""All checks, in the order in which one would look."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from tablerunner.doctor.environment import (
    DISCOVERY,
    ENVIRONMENT,
    SERIAL,
    check_discovery,
    check_environment,
    check_serial,
)
from tablerunner.doctor.facts import Facts
from tablerunner.doctor.finding import Finding
from tablerunner.doctor.frames import FRAMES, check_frames
from tablerunner.doctor.settings import (
    ANCHORS,
    DIAGNOSTICS,
    PARAMETERS,
    check_anchors,
    check_diagnostics,
    check_parameters,
)
from tablerunner.doctor.topics import (
    CLOCKS,
    NODES,
    TOPICS,
    check_clocks,
    check_nodes,
    check_topics,
)

CHECKS: dict[str, Callable[[Facts], Iterator[Finding]]] = {
    ENVIRONMENT: check_environment,
    SERIAL: check_serial,
    DISCOVERY: check_discovery,
    NODES: check_nodes,
    TOPICS: check_topics,
    CLOCKS: check_clocks,
    FRAMES: check_frames,
    PARAMETERS: check_parameters,
    ANCHORS: check_anchors,
    DIAGNOSTICS: check_diagnostics,
}
"""Each check by its name."""


_HOST = {ENVIRONMENT, SERIAL}


def diagnose(facts: Facts, checks: Collection[str] = tuple(CHECKS)) -> tuple[Finding, ...]:
    """Return what the checks find, all or some of them, in their own order.

    Where there is no node at all, what is missing besides would only be its consequences: of the
    checks that need a robot, that of discovery stands for all.
    """
    asked = [name for name in CHECKS if name in checks]
    if not facts.discovery.nodes and not set(asked) <= _HOST:
        asked = [name for name in asked if name in _HOST] + [DISCOVERY]
    return tuple(finding for name in asked for finding in CHECKS[name](facts))
