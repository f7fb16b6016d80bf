"""Stamps and ages by the node's clock, real and simulated; transforms on the wire."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from tablerunner.geometry.pose import Pose2
from tablerunner_ros.clocks import age_s, now_ns, steady_ns
from tablerunner_ros.stamps import StampCheck, StampConfig
from tablerunner_ros.testing.fixtures import domain, probe  # noqa: F401
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.transforms import (
    StaticTransformBroadcaster,
    TransformBroadcaster,
    transform_message,
)

SECOND = 10**9


def simulated(probe: Probe) -> Node:  # noqa: F811
    return probe.host(
        lambda **options: Node('mine', **options),
        parameter_overrides=[Parameter('use_sim_time', value=True)],
    )


def test_stamp_check_by_the_wall_clock(probe: Probe) -> None:  # noqa: F811
    """What lies ahead beyond the tolerance is future; the past never is."""
    check = StampCheck(probe.node, StampConfig(stamp_tolerance=0.5))
    now = now_ns(probe.node)
    assert not check.is_future(now)
    assert not check.is_future(now + SECOND // 4)
    assert check.is_future(now + 2 * SECOND)
    assert not check.is_future(5)


def test_stamp_check_by_a_simulated_clock(probe: Probe) -> None:  # noqa: F811
    """Before the first /clock nothing is judged; afterwards that clock is the measure."""
    node = simulated(probe)
    check = StampCheck(node, StampConfig())
    assert not check.is_future(50 * SECOND)
    publisher = probe.node.create_publisher(Clock, '/clock', 1)

    def tick() -> bool:
        publisher.publish(Clock(clock=Time(sec=10)))
        probe.spin(0.02)
        return now_ns(node) == 10 * SECOND

    probe.wait_for(tick, 'simulated time')
    assert check.is_future(50 * SECOND)
    assert not check.is_future(10 * SECOND + SECOND // 4)
    assert age_s(node, 8 * SECOND) == 2.0
    assert age_s(node, 11 * SECOND) == -1.0


def test_steady_time_goes_on_while_simulated_time_stands(probe: Probe) -> None:  # noqa: F811
    """What is stale is noticed although the clock stands."""
    node = simulated(probe)
    before = steady_ns()
    assert now_ns(node) == now_ns(node) == 0
    probe.spin(0.02)
    assert steady_ns() > before


def test_transform_broadcaster_sends_what_it_is_given(probe: Probe) -> None:  # noqa: F811
    """The one message it reuses carries the new pose each time."""
    heard = probe.listen(TFMessage, 'tf')
    broadcaster = TransformBroadcaster(probe.node, 'odom', 'base_link')
    probe.heard('tf')
    probe.spin(0.1)
    broadcaster.send(SECOND, Pose2(1.0, 2.0, 0.0))
    broadcaster.send(2 * SECOND, Pose2(3.0, 4.0, 0.0))
    probe.wait_for(lambda: len(heard) == 2, 'two transforms')
    places = [message.transforms[0].transform.translation for message in heard]
    assert [(place.x, place.y) for place in places] == [(1.0, 2.0), (3.0, 4.0)]
    assert [message.transforms[0].header.stamp.sec for message in heard] == [1, 2]


def test_static_transforms_reach_a_late_listener_all_together(probe: Probe) -> None:  # noqa: F811
    """A latched topic keeps one message: it holds all, the newest of each."""
    broadcaster = StaticTransformBroadcaster(probe.node)
    broadcaster.send(transform_message(0, 'base_link', 'imu_link', Pose2(1.0)))
    broadcaster.send(
        transform_message(0, 'base_link', 'uwb_tag', Pose2(2.0)),
        transform_message(0, 'base_link', 'imu_link', Pose2(3.0)),
    )
    heard = probe.listen(TFMessage, 'tf_static')
    message = probe.wait_for(lambda: heard, 'the transforms')[-1]
    got = {item.child_frame_id: item.transform.translation.x for item in message.transforms}
    assert got == {'imu_link': 3.0, 'uwb_tag': 2.0}
