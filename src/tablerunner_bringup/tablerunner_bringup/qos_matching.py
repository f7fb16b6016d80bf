"""Ask for what publishers offer, and offer again what they offered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import yaml
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from tablerunner.bags.writer import OfferedQuality

RECORDING_DEPTH = 1000
"""Messages that may wait for the recorder: ten seconds of an IMU at 100 Hz."""

_UNKNOWN_DEPTH = 10


def subscription_profile(
    offered: Sequence[QoSProfile], depth: int = RECORDING_DEPTH
) -> QoSProfile:
    """Return the strongest profile that every one of the publishers can serve.

    Asking for more than a publisher offers would silently receive nothing from it: reliable only
    if all are reliable, the past of transient-local publishers only if all keep it.
    """
    reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in offered)
    latched = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered)
    return _profile(reliable and bool(offered), latched and bool(offered), depth)


def publisher_profile(offered: Sequence[QoSProfile], messages: int) -> QoSProfile:
    """Return the profile with which one publisher stands in for all that were recorded.

    Reliable if any of them was, so that no subscriber of theirs is turned away. A reliable one
    keeps all messages until they are acknowledged: a player that is faster than its listeners
    waits for them instead of overwriting what they have not got yet. A transient-local one
    stands in for several publishers with a past of their own (``tf_static``), so it keeps as
    many messages as the topic has, up to `RECORDING_DEPTH`.
    """
    reliable = any(p.reliability == ReliabilityPolicy.RELIABLE for p in offered) or not offered
    latched = any(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered)
    if latched:
        return _profile(reliable, True, max(1, min(messages, RECORDING_DEPTH)))
    if reliable:
        return QoSProfile(
            history=HistoryPolicy.KEEP_ALL,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.VOLATILE,
        )
    depth = max((p.depth for p in offered), default=0)
    return _profile(False, False, max(depth, 100))


def recorded_quality(offered: Sequence[QoSProfile]) -> OfferedQuality:
    """Return what the bag says of a topic: the most that any of its publishers offered."""
    return OfferedQuality(
        reliable=any(p.reliability == ReliabilityPolicy.RELIABLE for p in offered),
        transient_local=any(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in offered),
        # The graph does not tell the queue of a publisher in another process.
        depth=max((p.depth for p in offered), default=0) or _UNKNOWN_DEPTH,
    )


def offered_profiles(text: str) -> tuple[QoSProfile, ...]:
    """Return the profiles that a bag holds of a topic; words and numbers are both understood.

    What is not there or not understood is passed over: a bag of unknown quality is played
    reliable and volatile, which serves every ordinary subscriber.
    """
    try:
        items = yaml.safe_load(text) if text else []
    except yaml.YAMLError:
        return ()
    if not isinstance(items, list):
        return ()
    return tuple(
        _profile(
            _is_policy(item.get('reliability'), ReliabilityPolicy.RELIABLE),
            _is_policy(item.get('durability'), DurabilityPolicy.TRANSIENT_LOCAL),
            _depth(item.get('depth')),
        )
        for item in items
        if isinstance(item, dict)
    )


def _is_policy(value: Any, policy: ReliabilityPolicy | DurabilityPolicy) -> bool:
    if isinstance(value, str):
        return value.upper() == policy.name
    return bool(value == policy.value)


def _depth(value: Any) -> int:
    return value if isinstance(value, int) and 0 < value <= RECORDING_DEPTH else _UNKNOWN_DEPTH


def _profile(reliable: bool, latched: bool, depth: int) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
