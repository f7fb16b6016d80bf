"""Parameters of uwb_driver beside those of the core and of tablerunner_ros."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter


@dataclass(frozen=True)
class UwbDriverConfig(Config):
    """Frames of the node and how soon silence is an error."""

    map_frame: str = parameter('map', description='Frame of the anchors and of the fix')
    tag_frame: str = parameter('uwb_tag', description="Frame of the tag's antenna")
    silence: float = parameter(
        1.0,
        unit='s',
        description='Silence of an anchor, or of all, after which diagnostics report it',
        above=0.0,
        high=60.0,
    )
