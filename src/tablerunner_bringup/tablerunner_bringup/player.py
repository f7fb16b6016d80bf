"""Publish recorded messages again, in their order and at their pace."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from tablerunner.errors import TablerunnerError
from tablerunner_bringup.message_types import message_class
from tablerunner_bringup.qos_matching import publisher_profile

CLOCK = '/clock'
_NANOSECONDS = 1_000_000_000
_CLOCK_STEP_NS = 10_000_000
_SLICE_S = 0.05  # longest sleep, so that a Ctrl-C is felt
_SETTLED_S = 0.5
# DDS announces itself a few times at once, then every three seconds: whoever missed the first few
# is found only then.
_DISCOVERY_S = 4.0
_ACKNOWLEDGE_S = 10.0


class PlayError(TablerunnerError):
    """Playing cannot go on: nobody listens who should, or a listener does not acknowledge."""


class Track(NamedTuple):
    """A recorded topic: its name in the bag, what publishers offered, how many messages."""

    topic: str
    msgtype: str
    offered: Sequence[QoSProfile]
    messages: int

    @property
    def latched(self) -> bool:
        """Whether late subscribers were given what was published before."""
        return any(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in self.offered)


class Message(NamedTuple):
    """A serialised message as it was recorded; `stamp` is when it was received [ns]."""

    stamp: int
    topic: str
    data: bytes


@dataclass(frozen=True)
class Pace:
    """How to play.

    Attributes
    ----------
    rate : float
        Seconds of the bag per second.
    start_s : float
        Where to begin, from the first message. Topics with a past (transient local) are brought
        up to that moment first.
    clock : bool
        Whether to publish /clock. It runs at 50 Hz of real time, and is brought forward before
        any message that is more than 10 ms ahead of it.
    remap : dict
        New names of topics.
    """

    rate: float = 1.0
    start_s: float = 0.0
    clock: bool = True
    remap: dict[str, str] = field(default_factory=dict)
    clock_rate: float = 50.0


class Player:
    """Publishes tracks of a bag.

    Raises
    ------
    MessageTypeError
        A type has no Python support here.
    """

    def __init__(self, node: Node, tracks: Iterable[Track], pace: Pace | None = None) -> None:
        self._node = node
        self._pace = pace or Pace()
        self.counts: Counter[str] = Counter()
        self.late_s = 0.0  # longest time a message came late
        self._latched: set[str] = set()
        self._publishers: dict[str, Publisher] = {}
        self._reliable: dict[str, bool] = {}
        self._clock_publisher: Publisher | None = None
        self._clock = 0
        if self._pace.clock:
            self._clock_publisher = node.create_publisher(
                Clock, CLOCK, QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
            )
        for track in tracks:
            if track.topic == CLOCK and self._pace.clock:
                continue
            profile = publisher_profile(track.offered, track.messages)
            self._publishers[track.topic] = node.create_publisher(
                message_class(track.msgtype),
                self._pace.remap.get(track.topic, track.topic),
                profile,
            )
            self._reliable[track.topic] = profile.reliability == ReliabilityPolicy.RELIABLE
            if track.latched:
                self._latched.add(track.topic)

    @property
    def topics(self) -> tuple[str, ...]:
        """Names, as published, of the topics of the bag that are played."""
        return tuple(self._pace.remap.get(topic, topic) for topic in self._publishers)

    def wait_for_listeners(
        self,
        topics: Collection[str] = (),
        limit_s: float = 30.0,
        stopped: Callable[[], bool] = lambda: False,
    ) -> list[str]:
        """Wait until whoever subscribes is connected; a message before that would be lost.

        Parameters
        ----------
        topics : collection of str
            Topics, as published, that must have a subscriber.
        limit_s : float
            How long to wait for those [s].

        Returns
        -------
        list of str
            Topics that have subscribers which this player cannot serve (they ask for a quality
            of service that was not recorded).

        Raises
        ------
        PlayError
            One of `topics` is not played or found no subscriber in time.
        """
        by_name = {self._pace.remap.get(name, name): p for name, p in self._publishers.items()}
        unknown = sorted(set(topics) - set(by_name))
        if unknown:
            raise PlayError(f'{", ".join(unknown)} cannot be waited for: not among what is played')
        if self._clock_publisher is not None:
            by_name[CLOCK] = self._clock_publisher
        begun = time.monotonic()
        quiet_since = begun
        seen: list[int] = []
        while not stopped():
            now = time.monotonic()
            matched = [publisher.get_subscription_count() for publisher in by_name.values()]
            if matched != seen:
                seen, quiet_since = matched, now
            lonely = [name for name in topics if by_name[name].get_subscription_count() == 0]
            if lonely and now - begun > limit_s:
                raise PlayError(f'nobody subscribed to {", ".join(lonely)} within {limit_s:g} s')
            unserved = [
                name
                for (name, publisher), count in zip(by_name.items(), matched, strict=True)
                if self._node.count_subscribers(name) > count
            ]
            settled = now - quiet_since > _SETTLED_S and now - begun > 2 * _SETTLED_S
            found = any(matched) and not unserved
            if not lonely and settled and (found or now - begun > _DISCOVERY_S):
                return unserved
            time.sleep(0.02)
        return []

    def play(
        self,
        messages: Iterable[Message],
        stopped: Callable[[], bool] = lambda: False,
        on_time: Callable[[float], None] = lambda elapsed_s: None,
    ) -> None:
        """Publish messages that come sorted by stamp; return at the end or when stopped.

        Reliable messages are acknowledged by every subscriber before it returns.

        Raises
        ------
        PlayError
            A subscriber did not acknowledge for too long.
        """
        first: int | None = None
        origin = 0.0
        for message in messages:
            publisher = self._publishers.get(message.topic)
            if first is None:
                first = message.stamp + round(self._pace.start_s * _NANOSECONDS)
                origin = time.monotonic()
                self._clock = 0
            if message.stamp < first:
                if publisher is not None and message.topic in self._latched:
                    self._publish(message, publisher)
                continue
            if stopped():
                break
            due = origin + (message.stamp - first) / _NANOSECONDS / self._pace.rate
            if not self._sleep_until(due, first, origin, stopped):
                break
            if message.stamp - self._clock > _CLOCK_STEP_NS:
                self._tell_time(message.stamp)
            if publisher is not None:
                self._publish(message, publisher)
            self.late_s = max(self.late_s, time.monotonic() - due)
            on_time((message.stamp - first) / _NANOSECONDS)
        self._await_acknowledgement()

    def _sleep_until(
        self, due: float, first: int, origin: float, stopped: Callable[[], bool]
    ) -> bool:
        """Sleep, with the clock going on; return whether to continue."""
        period = 1.0 / self._pace.clock_rate if self._clock_publisher else _SLICE_S
        while (left := due - time.monotonic()) > 0.0:
            if stopped():
                return False
            if left <= period:
                time.sleep(left)
                continue
            time.sleep(period)
            elapsed_s = (time.monotonic() - origin) * self._pace.rate
            self._tell_time(first + round(elapsed_s * _NANOSECONDS))
        return True

    def _tell_time(self, stamp: int) -> None:
        if self._clock_publisher is not None and stamp > self._clock:
            seconds, nanoseconds = divmod(stamp, _NANOSECONDS)
            self._clock_publisher.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))
            self._clock = stamp

    def _publish(self, message: Message, publisher: Publisher) -> None:
        deadline = time.monotonic() + _ACKNOWLEDGE_S
        while True:
            try:
                publisher.publish(message.data)
                break
            except InvalidHandle:
                raise
            except RuntimeError as error:  # RCLError: the queue is full of unacknowledged ones
                if time.monotonic() > deadline:
                    raise PlayError(
                        f'a subscriber of {message.topic} does not take what is sent: {error}'
                    ) from error
        self.counts[message.topic] += 1

    def _await_acknowledgement(self) -> None:
        for topic, publisher in self._publishers.items():
            if self._reliable[topic] and publisher.get_subscription_count():
                limit = Duration(seconds=_ACKNOWLEDGE_S)
                if not publisher.wait_for_all_acked(limit):
                    raise PlayError(f'a subscriber of {topic} did not acknowledge all of it')
