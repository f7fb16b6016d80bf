"""Take raw messages of any topics off the graph and hand them to a bag, in order of arrival."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import NamedTuple

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock

from tablerunner.bags.definitions import types_for
from tablerunner.bags.writer import BagWriter
from tablerunner.errors import BagError
from tablerunner_bringup.message_types import MessageTypeError, message_class
from tablerunner_bringup.polling import never_called, take_all
from tablerunner_bringup.qos_matching import recorded_quality, subscription_profile

CLOCK = '/clock'
_NANOSECONDS = 1_000_000_000
_WAITING_FOR_CLOCK = 20_000


class Arrival(NamedTuple):
    """A message as it was taken: when the middleware got it (system time, ns), and what."""

    received: int
    topic: str
    data: bytes


ON_REQUEST = 'debug_image'
"""Last part of the name of a topic that ceiling_camera fills only for who listens."""


@dataclass
class Selection:
    """Which topics to record.

    Attributes
    ----------
    patterns : collection of str
        Full topic names, ``*`` and ``?`` allowed; empty: every topic.
    hidden : bool
        Whether topics with a part that begins with an underscore are taken when not named, and
        pictures that are drawn only because somebody listens.
    """

    patterns: Collection[str] = ()
    hidden: bool = False

    def takes(self, topic: str) -> bool:
        """Return whether a topic is to be recorded."""
        if self.patterns:
            return any(fnmatchcase(topic, pattern) for pattern in self.patterns)
        parts = topic.split('/')
        drawn = parts[-1] == ON_REQUEST
        return self.hidden or not (drawn or any(part.startswith('_') for part in parts))


@dataclass
class _Track:
    msgtype: str
    subscription: Subscription
    profile: QoSProfile
    count: int = 0
    sequence: int = 0
    gap: int = 0  # numbers left out since the last look at the graph
    publisher: bytes = b''  # the only one there was then; empty: several


@dataclass
class Losses:
    """What did not get into the bag, and why.

    Attributes
    ----------
    missed : Counter
        Messages per topic that were published and never arrived here.
    unstamped : int
        Messages that came before the first /clock and were too many to keep.
    refused : dict
        Topics that cannot be recorded, with the reason.
    """

    missed: Counter[str] = field(default_factory=Counter)
    unstamped: int = 0
    refused: dict[str, str] = field(default_factory=dict)


class Recorder:
    """Subscribes raw to what appears on the graph and writes it to a bag.

    The messages are taken by polling instead of by an executor: an executor of rclpy costs about
    0.1 ms of Python per message, more than the rest of the recorder together. The time of arrival
    is the middleware's, so polling does not blur it.

    Parameters
    ----------
    node : Node
    bag : BagWriter
        Open; whoever opened it closes it.
    selection : Selection
    use_sim_time : bool
        Stamp with the /clock message that arrived last before; else with system time.
    on_topic : callable
        Told ``(topic, message type)`` of each topic when its recording begins.
    """

    def __init__(
        self,
        node: Node,
        bag: BagWriter,
        selection: Selection | None = None,
        use_sim_time: bool = False,
        on_topic: Callable[[str, str], None] = lambda topic, msgtype: None,
    ) -> None:
        self.losses = Losses()
        self._node = node
        self._bag = bag
        self._selection = selection or Selection()
        self._on_topic = on_topic
        self._tracks: dict[str, _Track] = {}
        self._sim_time = use_sim_time
        self._clock: int | None = None
        self._early: deque[Arrival] = deque()
        self._clock_subscription = None
        if use_sim_time:
            self._clock_subscription = node.create_subscription(
                Clock, CLOCK, never_called, QoSProfile(depth=1000), raw=True
            )

    @property
    def counts(self) -> dict[str, int]:
        """Messages written per topic."""
        return {topic: track.count for topic, track in self._tracks.items()}

    @property
    def written(self) -> int:
        """Messages written in all."""
        return sum(track.count for track in self._tracks.values())

    @property
    def duration_s(self) -> float:
        """Time of the clock that stamps, 0 before it is known [s]; only for progress."""
        return (self._clock or 0) / _NANOSECONDS

    def scan(self) -> None:
        """Look at the graph: begin new topics, follow publishers that offer less than before."""
        self.drain()  # a subscription that is replaced takes its queue with it
        own = self._node.get_fully_qualified_name()
        for topic, types in self._node.get_topic_names_and_types():
            if not self._selection.takes(topic) or topic in self.losses.refused:
                continue
            infos = [
                info
                for info in self._node.get_publishers_info_by_topic(topic)
                if f'{info.node_namespace.rstrip("/")}/{info.node_name}' != own
            ]
            if not infos:
                continue
            if len(types) > 1:
                self.losses.refused[topic] = 'published as ' + ' and as '.join(sorted(types))
                continue
            self._follow(topic, types[0], [info.qos_profile for info in infos])
            if topic in self._tracks:
                self._count_gap(topic, [bytes(info.endpoint_gid) for info in infos])

    def drain(self) -> int:
        """Take everything that has arrived and write it in order of arrival; return how many."""
        arrivals = [arrival for track in self._taken() for arrival in track]
        arrivals.sort(key=lambda arrival: arrival.received)
        for arrival in arrivals:
            if arrival.topic == '':
                self._clock = _stamp_of(arrival.data)
                self._write_early()
            elif self._sim_time and self._clock is None:
                if len(self._early) == _WAITING_FOR_CLOCK:
                    self._early.popleft()
                    self.losses.unstamped += 1
                self._early.append(arrival)
            else:
                if not self._sim_time:
                    self._clock = arrival.received
                self._write(arrival)
        return len(arrivals)

    def finish(self) -> None:
        """Take what is left; what never saw a clock is counted as lost."""
        self.drain()
        self.losses.unstamped += len(self._early)
        self._early.clear()

    def _write_early(self) -> None:
        while self._early:
            self._write(self._early.popleft())

    def _write(self, arrival: Arrival) -> None:
        track = self._tracks[arrival.topic]
        self._bag.write_raw(arrival.topic, self._clock or 0, arrival.data)
        track.count += 1

    def _taken(self) -> Iterator[list[Arrival]]:
        if self._clock_subscription is not None:
            yield [
                Arrival(info['received_timestamp'], '', data)
                for data, info in take_all(self._clock_subscription)
            ]
        for topic, track in self._tracks.items():
            yield [
                self._arrival(topic, track, data, info)
                for data, info in take_all(track.subscription)
            ]

    @staticmethod
    def _arrival(topic: str, track: _Track, data: bytes, info: dict[str, int]) -> Arrival:
        number = info.get('publication_sequence_number') or 0
        if track.sequence and number > track.sequence + 1:
            track.gap += number - track.sequence - 1
        track.sequence = number
        return Arrival(info['received_timestamp'] or time.time_ns(), topic, data)

    def _follow(self, topic: str, msgtype: str, offered: list[QoSProfile]) -> None:
        track = self._tracks.get(topic)
        profile = subscription_profile(offered)
        if track is None:
            try:
                message_class(msgtype)
                types = types_for([msgtype])
                self._bag.add_topic(topic, msgtype, recorded_quality(offered), types)
            except (MessageTypeError, BagError) as error:
                self.losses.refused[topic] = str(error)
                return
            subscription = self._subscribe(topic, msgtype, profile)
            self._tracks[topic] = _Track(msgtype, subscription, profile)
            self._on_topic(topic, msgtype)
        elif _asks_more(track.profile, profile):
            old = track.subscription
            track.subscription = self._subscribe(topic, track.msgtype, profile)
            track.profile = profile
            track.sequence = track.gap = 0
            self._node.destroy_subscription(old)

    def _count_gap(self, topic: str, publishers: list[bytes]) -> None:
        """Take gaps for losses, if one publisher alone numbered the messages all the while."""
        track = self._tracks[topic]
        alone = publishers[0] if len(publishers) == 1 else b''
        if track.gap and alone and alone == track.publisher:
            self.losses.missed[topic] += track.gap
        track.publisher, track.gap = alone, 0

    def _subscribe(self, topic: str, msgtype: str, profile: QoSProfile) -> Subscription:
        return self._node.create_subscription(
            message_class(msgtype), topic, never_called, profile, raw=True
        )


def _asks_more(now: QoSProfile, possible: QoSProfile) -> bool:
    reliable = ReliabilityPolicy.RELIABLE
    latched = DurabilityPolicy.TRANSIENT_LOCAL
    return (now.reliability == reliable and possible.reliability != reliable) or (
        now.durability == latched and possible.durability != latched
    )


def _stamp_of(data: bytes) -> int:
    clock = deserialize_message(data, Clock).clock
    return int(clock.sec) * _NANOSECONDS + int(clock.nanosec)
