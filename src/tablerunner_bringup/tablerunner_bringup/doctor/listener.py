"""Listens to a running robot for some seconds and tells what it heard, as plain facts."""

from __future__ import annotations

import math
import statistics
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from tf2_msgs.msg import TFMessage

from tablerunner.doctor import AnchorFacts, LinkFacts, StatusFacts, TopicFacts
from tablerunner.geometry.frame_tree import Link
from tablerunner.messages.stamp import stamp_from_message
from tablerunner.messages.transforms import links_from_message
from tablerunner.types import NANOSECONDS
from tablerunner_bringup.message_types import MessageTypeError, message_class
from tablerunner_bringup.polling import never_called, take_all
from tablerunner_bringup.qos_matching import subscription_profile

TOPICS = (
    'clock',
    'joint_states',
    'imu/data',
    'uwb/exchanges',
    'uwb/ranges',
    'uwb/anchors',
    'uwb/pose',
    'camera/pose',
    'odom',
    'odometry/filtered',
    'pose',
    'cmd_vel_nav',
    'cmd_vel',
)
"""Topics that are looked at besides ultrasonic/*; tf and diagnostics by themselves."""

_STAMPED = {'joint_states', 'imu/data', 'uwb/exchanges', 'uwb/ranges', 'odom', 'odometry/filtered'}
_MULTIPLE = {'ultrasonic'}
_STEP_S = 0.01
_NLOS = 0.5


@dataclass
class Heard:
    """What came on one topic."""

    count: int = 0
    first: int = 0  # [ns] arrivals
    last: int = 0
    ages_s: list[float] = field(default_factory=list)
    zero_stamps: int = 0
    frames: set[str] = field(default_factory=set)
    names: dict[str, None] = field(default_factory=dict)
    ranges: Counter[str] = field(default_factory=Counter)
    judged: Counter[str] = field(default_factory=Counter)
    nlos: Counter[str] = field(default_factory=Counter)


class Listener:
    """Subscribes to what there is, in the namespace of its node; `run` listens.

    Parameters
    ----------
    node : rclpy.node.Node
        In no executor.
    odom_topic : str
        Name of the wheel odometry.
    """

    def __init__(self, node: Node, odom_topic: str = 'odom') -> None:
        self._node = node
        self._names = {'odom': odom_topic}
        self._subscriptions: dict[str, Any] = {}
        self._heard: dict[str, Heard] = {}
        self._links: dict[tuple[str, str], tuple[Link, bool, int]] = {}
        self._statuses: dict[str, tuple[StatusFacts, float]] = {}
        self._clock_first = self._clock_now = 0
        self._duration_s, self._ended = 0.0, 0

    @property
    def simulated(self) -> bool:
        """Whether there is a /clock."""
        return bool(self._clock_now)

    @property
    def clock_moved(self) -> bool:
        """Whether it went on."""
        return self._clock_now > self._clock_first

    def run(self, seconds: float, show: Callable[[float], None]) -> None:
        """Listen; `show` is told the time that is left."""
        start = time.monotonic()
        looked_at = 0.0
        while (elapsed := time.monotonic() - start) < seconds:
            if elapsed >= looked_at:
                self._subscribe()
                looked_at = elapsed + 0.5
                show(seconds - elapsed)
            self._drain()
            time.sleep(_STEP_S)
        self._duration_s, self._ended = seconds, time.time_ns()

    # -- facts --------------------------------------------------------------------------------

    def topics(self) -> dict[str, TopicFacts]:
        """Return each topic that somebody speaks of, by its relative name."""
        types = dict(self._node.get_topic_names_and_types())
        found = {}
        for name in [*TOPICS, *self._ultrasonics(types)]:
            full = self._full(name)
            if full in types:
                found[name] = self._topic(name, full, tuple(types[full]))
        return found

    def links(self) -> tuple[LinkFacts, ...]:
        """Return all transforms that were heard."""
        now = self._clock_now or time.time_ns()
        return tuple(
            LinkFacts(link, static, 0.0 if static else (now - stamp) / NANOSECONDS)
            for link, static, stamp in self._links.values()
        )

    def statuses(self) -> tuple[StatusFacts, ...]:
        """Return the newest status of each name."""
        return tuple(status for status, _ in self._statuses.values())

    def anchors(self) -> dict[str, AnchorFacts]:
        """Return the anchors of which ranges were heard."""
        heard = self._heard.get('uwb/ranges', Heard())
        return {
            name: AnchorFacts(
                count,
                heard.nlos[name] / heard.judged[name] if heard.judged[name] else math.nan,
            )
            for name, count in heard.ranges.items()
        }

    # -- inside -------------------------------------------------------------------------------

    def _full(self, name: str) -> str:
        return self._node.resolve_topic_name('/clock' if name == 'clock' else self._alias(name))

    def _alias(self, name: str) -> str:
        return self._names.get(name, name)

    def _ultrasonics(self, types: dict[str, Any]) -> list[str]:
        begin = self._node.resolve_topic_name('ultrasonic/x')[:-1]
        return ['ultrasonic/' + name[len(begin) :] for name in types if name.startswith(begin)]

    def _topic(self, name: str, full: str, types: tuple[str, ...]) -> TopicFacts:
        heard = self._heard.get(name, Heard())
        publishers = self._node.get_publishers_info_by_topic(full)
        return TopicFacts(
            types=types,
            publishers=tuple(info.node_name for info in publishers),
            mismatches=tuple(self._mismatches(full, publishers)),
            count=heard.count,
            rate_hz=_rate_hz(heard),
            silent_s=(self._ended - heard.last) / NANOSECONDS if heard.count else math.nan,
            duration_s=self._duration_s,
            age_s=statistics.median(heard.ages_s) if heard.ages_s else math.nan,
            zero_stamps=heard.zero_stamps,
            frames=tuple(sorted(heard.frames)),
            names=tuple(heard.names),
        )

    def _mismatches(self, full: str, publishers: list[Any]) -> list[str]:
        found = []
        own = self._node.get_name()
        for subscriber in self._node.get_subscriptions_info_by_topic(full):
            if subscriber.node_name == own:
                continue
            for publisher in publishers:
                what = _unmet(publisher.qos_profile, subscriber.qos_profile)
                if what:
                    found.append(
                        f'{subscriber.node_name} asks for {what}, which {publisher.node_name} '
                        'does not offer: it hears nothing'
                    )
        return found

    def _subscribe(self) -> None:
        types = dict(self._node.get_topic_names_and_types())
        wanted = [*TOPICS, *self._ultrasonics(types), 'tf', 'tf_static', 'diagnostics']
        for name in wanted:
            full = self._full(name)
            if name in self._subscriptions or full not in types:
                continue
            infos = self._node.get_publishers_info_by_topic(full)
            if not infos:
                continue
            try:
                type_ = message_class(infos[0].topic_type)
            except MessageTypeError:
                continue
            profile = subscription_profile([info.qos_profile for info in infos])
            if name in ('tf', 'tf_static', 'diagnostics'):
                profile.depth = 200
            self._subscriptions[name] = self._node.create_subscription(
                type_, full, never_called, profile
            )
            self._heard.setdefault(name, Heard())

    def _drain(self) -> None:
        for name, subscription in self._subscriptions.items():
            for message, info in take_all(subscription):
                self._take(name, message, info['received_timestamp'])

    def _take(self, name: str, message: Any, received: int) -> None:
        heard = self._heard[name]
        heard.count += 1
        heard.first, heard.last = heard.first or received, received
        if name == 'clock':
            self._clock_now = stamp_from_message(message.clock)
            self._clock_first = self._clock_first or self._clock_now
        elif isinstance(message, TFMessage):
            self._take_links(name == 'tf_static', message)
        elif isinstance(message, DiagnosticArray):
            self._take_statuses(message)
        elif hasattr(message, 'header'):
            self._take_stamped(name, heard, message, received)

    def _take_stamped(self, name: str, heard: Heard, message: Any, received: int) -> None:
        stamp = stamp_from_message(message.header.stamp)
        heard.frames.add(message.header.frame_id)
        measured = name in _STAMPED or name.partition('/')[0] in _MULTIPLE
        if stamp == 0:
            heard.zero_stamps += measured
        elif measured:
            heard.ages_s.append(((self._clock_now or received) - stamp) / NANOSECONDS)
        if name == 'joint_states':
            heard.names.update(dict.fromkeys(message.name))
        elif name == 'uwb/ranges':
            anchor = message.anchor_id
            heard.ranges[anchor] += 1
            if not math.isnan(message.nlos_probability):
                heard.judged[anchor] += 1
                heard.nlos[anchor] += message.nlos_probability > _NLOS

    def _take_links(self, static: bool, message: TFMessage) -> None:
        stamps = [stamp_from_message(item.header.stamp) for item in message.transforms]
        for link, stamp in zip(links_from_message(message), stamps, strict=True):
            if isinstance(link, Link):
                self._links[(link.parent, link.child)] = (link, static, stamp)

    def _take_statuses(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            level = int.from_bytes(status.level, 'little')
            fact = StatusFacts(status.name, level, status.message, values)
            self._statuses[status.name] = (fact, time.monotonic())


def _rate_hz(heard: Heard) -> float:
    """Return the rate from the first message to the last: discovery takes its time before."""
    if heard.count < 2 or heard.last <= heard.first:
        return 0.0
    return (heard.count - 1) * NANOSECONDS / (heard.last - heard.first)


def _unmet(offered: Any, asked: Any) -> str:
    """Return what a subscriber asks for and a publisher does not offer; empty when all is met."""
    if (
        asked.reliability == ReliabilityPolicy.RELIABLE
        and offered.reliability == ReliabilityPolicy.BEST_EFFORT
    ):
        return 'reliable messages'
    if (
        asked.durability == DurabilityPolicy.TRANSIENT_LOCAL
        and offered.durability == DurabilityPolicy.VOLATILE
    ):
        return 'the messages of before (transient local)'
    return ''
