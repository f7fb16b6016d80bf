"""Stamps there and back."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from hypothesis import given

from tablerunner_ros.conversions.stamp import stamp_from_message, stamp_to_message
from tablerunner_ros.testing.strategies import stamps


@given(stamps)
def test_stamp_there_and_back_is_the_same(stamp: int) -> None:
    """No nanosecond is lost, unlike with floating-point seconds."""
    message = stamp_to_message(stamp)
    assert 0 <= message.nanosec < 10**9
    assert stamp_from_message(message) == stamp


def test_stamp_of_seconds_and_nanoseconds() -> None:
    """Both parts count."""
    assert stamp_from_message(Time(sec=2, nanosec=5)) == 2_000_000_005
