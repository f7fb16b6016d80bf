"""Frames and their parents, as tf has them: who hangs on whom, and how it is turned."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.geometry.rotation import Rotation, rotation_of_rpy

_IDENTITY = rotation_of_rpy(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Link:
    """One frame in its parent."""

    parent: str
    child: str
    rotation: Rotation  # of the child's vectors into the parent's
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the child's origin [m]


class FrameTree:
    """Keeps the newest link of each child; names may have the leading slash of ROS 1."""

    def __init__(self) -> None:
        self._links: dict[str, Link] = {}

    def add(self, link: Link) -> None:
        """Take a link; it replaces that of the same child."""
        self._links[link.child.lstrip('/')] = link

    @property
    def links(self) -> tuple[Link, ...]:
        """All links, in the order in which their children came first."""
        return tuple(self._links.values())

    def chain(self, ancestor: str, frame: str) -> tuple[Link, ...] | None:
        """Return the links from `ancestor` down to `frame`; None where they do not connect."""
        found: list[Link] = []
        at, top = frame.lstrip('/'), ancestor.lstrip('/')
        while at != top:
            link = self._links.get(at)
            if link is None or any(link is other for other in found):  # another tree, or a ring
                return None
            found.append(link)
            at = link.parent.lstrip('/')
        return tuple(reversed(found))

    def rotation(self, ancestor: str, frame: str) -> Rotation | None:
        """Return the rotation of the vectors of `frame` into `ancestor`; None if unknown."""
        links = self.chain(ancestor, frame)
        if links is None:
            return None
        turned = _IDENTITY
        for link in links:
            turned = turned @ link.rotation
        return turned

    def root(self, frame: str) -> str:
        """Return the frame at the top of the tree that holds `frame`; itself if it has no parent.

        A ring has no top: the frame at which it closes is returned.
        """
        at, seen = frame.lstrip('/'), {frame.lstrip('/')}
        while at in self._links:
            at = self._links[at].parent.lstrip('/')
            if at in seen:
                break
            seen.add(at)
        return at
