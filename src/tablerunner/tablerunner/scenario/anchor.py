"""UWB anchors where the installer measured them to be."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.types import Anchor


@dataclass(frozen=True)
class AnchorPlace(Config):
    """One anchor on the wall or ceiling."""

    id: str = parameter(description='address that the anchor answers to')
    position: tuple[float, float, float] = parameter(description='antenna in map', unit='m')

    @property
    def anchor(self) -> Anchor:
        """The record that localisation uses."""
        return Anchor(self.id, self.position)
