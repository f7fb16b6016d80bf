"""Room for a camera's pictures between the processes of one machine."""

from __future__ import annotations

from collections.abc import MutableMapping

from tablerunner_bringup.executables import find_share

PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
"""Where Fast DDS 2, which rmw_fastrtps_cpp of Jazzy stands on, reads its settings from."""


def allow_large_messages(environment: MutableMapping[str, str]) -> None:
    """Let nodes that are started with this environment exchange pictures without losing them.

    Whoever has settings of Fast DDS already keeps them. Other middlewares do not look at it.
    """
    file = find_share('tablerunner_bringup') / 'dds' / 'large_messages.xml'
    environment.setdefault(PROFILES, str(file))
