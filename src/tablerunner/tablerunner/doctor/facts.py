"""What was seen of a robot, as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tablerunner.geometry.frame_tree import Link


@dataclass(frozen=True)
class EnvironmentFacts:
    """What the programs run in.

    Attributes
    ----------
    python : tuple of int
        Version, three numbers.
    missing_packages : tuple of str
        Python packages that cannot be imported.
    missing_programs : tuple of str
        Node executables that are not where `ros2 run` looks.
    middleware : str
        Name of the RMW implementation; empty when none can be loaded.
    variables : mapping of str to str
        Environment variables that ROS reads, those that are set.
    year : int
        Of the host's clock.
    """

    python: tuple[int, ...] = (3, 12, 0)
    missing_packages: tuple[str, ...] = ()
    missing_programs: tuple[str, ...] = ()
    middleware: str = ''
    variables: Mapping[str, str] = field(default_factory=dict)
    year: int = 2026


@dataclass(frozen=True)
class SerialFacts:
    """A serial port.

    Attributes
    ----------
    path : str
    exists, is_device, accessible : bool
        Whether it is there, is a character device, and may be read and written by this user.
    group : str
        Group that may.
    holders : tuple of str
        Programs of this user that have it open.
    wanted : bool
        Whether somebody is told to use it.
    """

    path: str
    exists: bool = True
    is_device: bool = True
    accessible: bool = True
    group: str = 'dialout'
    holders: tuple[str, ...] = ()
    wanted: bool = False


@dataclass(frozen=True)
class DiscoveryFacts:
    """What DDS finds.

    Attributes
    ----------
    domain : int
    loopback_s : float
        Until one participant heard another on this machine; NaN when it did not.
    nodes : tuple of str
        Names of the nodes in the robot's namespace, one entry for each node.
    elsewhere : tuple of str
        Full names of nodes in other namespaces.
    other_domains : tuple of int
        Domains in which somebody on this machine speaks.
    """

    domain: int = 0
    loopback_s: float = math.nan
    nodes: tuple[str, ...] = ()
    elsewhere: tuple[str, ...] = ()
    other_domains: tuple[int, ...] = ()


@dataclass(frozen=True)
class TopicFacts:
    """One topic while it was listened to.

    Attributes
    ----------
    types : tuple of str
        All types under which it is published or subscribed to.
    publishers : tuple of str
        Names of the nodes that publish it.
    mismatches : tuple of str
        Publishers and subscribers that cannot hear each other, in words.
    count : int
        Messages heard.
    rate_hz : float
        Between the first and the last of them.
    silent_s : float
        From the last one to the end; NaN when none was heard.
    duration_s : float
        Time over which it was listened to.
    age_s : float
        Median time from stamp to arrival, by the robot's clock; NaN without stamps.
    zero_stamps : int
        Messages stamped with zero.
    frames : tuple of str
        Frames of the messages.
    names : tuple of str
        Names of joints in the messages.
    """

    types: tuple[str, ...] = ()
    publishers: tuple[str, ...] = ()
    mismatches: tuple[str, ...] = ()
    count: int = 0
    rate_hz: float = 0.0
    silent_s: float = math.nan
    duration_s: float = 1.0
    age_s: float = math.nan
    zero_stamps: int = 0
    frames: tuple[str, ...] = ()
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class LinkFacts:
    """One transform: the link, whether it is static, and how old it was at the end [s]."""

    link: Link
    static: bool = True
    age_s: float = 0.0


@dataclass(frozen=True)
class StatusFacts:
    """The newest status of one name on /diagnostics; level as there: 0 ok, 1 warn, 2 error."""

    name: str
    level: int
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class AnchorFacts:
    """Ranges of one anchor: how many, and the share that is likely NLOS (NaN unknown)."""

    count: int
    nlos_share: float = math.nan


@dataclass(frozen=True)
class Facts:
    """All that was seen.

    Attributes
    ----------
    topics : mapping of str to TopicFacts
        By relative name; those that nobody speaks of are absent.
    parameters : mapping of str to mapping
        Parameters of each node that answered.
    anchors : mapping of str to AnchorFacts
        Anchors of which ranges were heard.
    simulated : bool
        Whether there is a /clock.
    clock_moved : bool
        Whether it went on.
    localization_only : bool
        Whether somebody else drives.
    """

    environment: EnvironmentFacts = field(default_factory=EnvironmentFacts)
    serial: tuple[SerialFacts, ...] = ()
    discovery: DiscoveryFacts = field(default_factory=DiscoveryFacts)
    topics: Mapping[str, TopicFacts] = field(default_factory=dict)
    links: tuple[LinkFacts, ...] = ()
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    statuses: tuple[StatusFacts, ...] = ()
    anchors: Mapping[str, AnchorFacts] = field(default_factory=dict)
    duration_s: float = 5.0
    simulated: bool = False
    clock_moved: bool = True
    localization_only: bool = False

    def with_host(
        self,
        environment: EnvironmentFacts,
        serial: tuple[SerialFacts, ...],
        localization_only: bool,
    ) -> Facts:
        """Return the same with what the host tells and what is asked for."""
        return replace(
            self, environment=environment, serial=serial, localization_only=localization_only
        )

    def parameter(self, node: str, name: str, default: Any) -> Any:
        """Return a parameter of a node, or the default where it did not answer."""
        return self.parameters.get(node, {}).get(name, default)

    def topic(self, name: str) -> TopicFacts:
        """Return a topic; an empty one where nobody speaks of it."""
        return self.topics.get(name, TopicFacts(duration_s=self.duration_s))
