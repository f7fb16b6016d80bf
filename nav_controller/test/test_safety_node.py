"""safety_stop over DDS."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from nav_controller.safety_node import SafetyNode
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes


def twist(linear: float, angular: float = 0.0) -> Twist:
    message = Twist()
    message.linear.x, message.angular.z = linear, angular
    return message


class Driver:
    """Commands a speed at 20 Hz and listens to what is left of it."""

    def __init__(self, probe: Probe, speed: float = 0.3) -> None:
        self.probe, self.speed, self.on = probe, speed, True
        self.heard = probe.listen(Twist, 'cmd_vel')
        self.states = probe.listen(DiagnosticStatus, 'safety_state')
        probe.speak(Twist, 'cmd_vel_nav')
        probe.node.create_timer(0.05, self.command)

    def command(self) -> None:
        """Publish the command, unless told not to."""
        if self.on:
            self.probe.publish('cmd_vel_nav', twist(self.speed))

    def wait_speed(self, test: Callable[[float], bool], what: str) -> float:
        """Wait for a new velocity whose speed passes a test; return after how long [s]."""
        start, seen = time.monotonic(), len(self.heard)
        self.probe.wait_for(
            lambda: any(test(message.linear.x) for message in self.heard[seen:]), what
        )
        return time.monotonic() - start

    def stands(self, duration_s: float = 0.6) -> bool:
        """Return whether nothing but zero comes, and something does, for a while."""
        seen = len(self.heard)
        self.probe.spin(duration_s)
        new = self.heard[seen:]
        return bool(new) and all(m.linear.x == 0.0 and m.angular.z == 0.0 for m in new)

    def wait_words(self, words: str) -> DiagnosticStatus:
        """Wait until the latest state says something."""
        self.probe.wait_for(
            lambda: bool(self.states) and words in self.states[-1].message,
            f'{words!r} on safety_state',
        )
        return self.states[-1]


@pytest.fixture
def robot(make_robot: Callable[..., Any]) -> Any:
    return make_robot('cmd_vel')


@pytest.fixture
def driving(probe: Probe, robot: Any) -> Driver:
    """Return a driver whose robot already drives at the speed it commands."""
    probe.host(SafetyNode)
    driver = Driver(probe)
    driver.wait_speed(lambda speed: speed >= 0.299, 'the commanded speed')
    return driver


def fusion_state(probe: Probe, state: str) -> None:
    values = [KeyValue(key='state', value=state), KeyValue(key='pose by', value='fused')]
    status = DiagnosticStatus(name='fusion_node', message=state, values=values)
    probe.publish('fusion_state', status)


def call(probe: Probe, service: str) -> Trigger.Response:
    client = probe.node.create_client(Trigger, service)
    probe.wait_for(client.service_is_ready, service)
    future = client.call_async(Trigger.Request())
    probe.wait_for(future.done, f'an answer of {service}')
    return future.result()


def test_no_command_stops_within_its_time(driving: Driver) -> None:
    """The command falls silent: zero after half a second, and zero goes on being published."""
    driving.on = False
    assert driving.wait_speed(lambda speed: speed == 0.0, 'a stop') < 1.0
    assert driving.stands()
    status = driving.wait_words('no command')
    assert status.level == DiagnosticStatus.ERROR
    driving.on = True
    driving.wait_speed(lambda speed: speed >= 0.299, 'the commanded speed again')


def test_silent_sensor_stops_and_is_named(driving: Driver, robot: Any) -> None:
    del robot.ranges['right']
    assert driving.wait_speed(lambda speed: speed == 0.0, 'a stop') < 1.0
    driving.wait_words('ultrasonic_right silent')


@pytest.mark.parametrize('bad', [math.nan, -1.0, 0.0])
def test_bad_readings_are_refused_and_stop(driving: Driver, robot: Any, bad: float) -> None:
    robot.ranges['front'] = bad
    driving.wait_words('ultrasonic_front silent')
    assert driving.stands(0.3)
    driving.probe.wait_diagnostic(
        'safety_stop: ultrasonic/ultrasonic_front', 'refused', lambda count: int(count) > 0
    )


@pytest.mark.parametrize('frame', ['base_link', 'ultrasonic_left', ''])
def test_reading_in_another_frame_than_its_topic_says_is_refused(
    driving: Driver, robot: Any, frame: str
) -> None:
    """What the left hears must not count as what is ahead, nor the other way round."""
    robot.sensor_frames['front'] = frame
    driving.wait_words('ultrasonic_front silent')
    driving.probe.wait_diagnostic(
        'safety_stop: ultrasonic/ultrasonic_front',
        'refused: not in frame ultrasonic_front',
        lambda count: int(count) > 0,
    )


def test_minus_infinity_touches_the_sensor_and_stops(driving: Driver, robot: Any) -> None:
    """REP-117; plus infinity is a free way, as all the drives here show."""
    robot.ranges['front'] = -math.inf
    driving.wait_words('obstacle: ultrasonic_front')
    assert driving.stands(0.3)


def test_lost_pose_stops(driving: Driver, robot: Any) -> None:
    robot.localised = False
    assert driving.wait_speed(lambda speed: speed == 0.0, 'a stop') < 1.0
    driving.wait_words('pose too old')


def test_pose_in_another_frame_is_no_pose(driving: Driver, robot: Any) -> None:
    robot.frame = 'odom'
    driving.wait_words('pose too old')
    driving.probe.wait_diagnostic(
        'safety_stop: odometry/filtered', 'refused: not in frame map', lambda n: int(n) > 0
    )


def test_robot_that_is_lost_slows_and_stops_until_it_is_found(driving: Driver) -> None:
    """Localisation says so itself on fusion_state; the pose looks as certain as before."""
    probe = driving.probe
    assert probe.set_parameter('safety_stop', 'safety.search_distance', 0.2) == ''
    probe.speak(DiagnosticStatus, 'fusion_state')
    probe.connected('fusion_state')
    fusion_state(probe, 'tracking')
    assert not driving.stands(0.2)
    fusion_state(probe, 'lost')
    driving.wait_speed(lambda speed: speed == pytest.approx(0.2), 'a slower speed')
    status = driving.wait_words('lost: driven far enough so')
    assert status.level == DiagnosticStatus.ERROR
    assert driving.stands(0.3)
    fusion_state(probe, 'tracking')
    driving.wait_speed(lambda speed: speed >= 0.299, 'the commanded speed again')


def test_uncertain_position_slows_and_stops(driving: Driver, robot: Any) -> None:
    robot.position_variance = 0.5**2
    driving.wait_speed(lambda speed: speed == pytest.approx(0.2), 'a slower speed')
    robot.position_variance = 1.0
    driving.wait_words('position too uncertain')
    assert driving.stands(0.3)


def test_obstacle_stops_without_waiting_for_a_command(driving: Driver, robot: Any) -> None:
    """Between two commands a reading comes: zero follows it at once."""
    driving.on = False
    robot.timer.cancel()
    seen = len(driving.heard)
    start = time.monotonic()
    robot.publish_range('front', 0.1)
    driving.probe.wait_for(
        lambda: any(message.linear.x == 0.0 for message in driving.heard[seen:]), 'a stop', 0.4
    )
    assert time.monotonic() - start < 0.4
    status = driving.wait_words('obstacle: ultrasonic_front')
    values = {item.key: item.value for item in status.values}
    assert values['state'] == 'stop'
    assert values['blocked'] == 'true'
    assert 0.2 < float(values['obstacle x [m]']) < 0.45


def test_person_who_leaves_releases_the_robot(driving: Driver, robot: Any) -> None:
    robot.ranges['front'] = 0.1
    driving.wait_words('obstacle: ultrasonic_front')
    assert driving.stands()
    robot.ranges['front'] = math.inf
    driving.wait_speed(lambda speed: speed >= 0.299, 'the commanded speed again')


def test_emergency_stop_holds_until_release(driving: Driver) -> None:
    probe = driving.probe
    answer = call(probe, 'emergency_stop')
    assert answer.success
    assert driving.stands(1.5)
    assert driving.wait_words('emergency stop').level == DiagnosticStatus.ERROR
    assert call(probe, 'release').success
    driving.wait_speed(lambda speed: speed >= 0.299, 'the commanded speed again')
    answer = call(probe, 'release')
    assert not answer.success
    assert 'no emergency stop' in answer.message


@pytest.mark.parametrize('bad', [math.nan, math.inf])
def test_command_that_is_not_finite_is_refused(driving: Driver, bad: float) -> None:
    driving.speed = bad
    assert driving.wait_speed(lambda speed: speed == 0.0, 'a stop') < 1.5
    driving.probe.wait_diagnostic(
        'safety_stop: cmd_vel_nav', 'refused: velocity is not finite', lambda n: int(n) > 0
    )
    assert all(math.isfinite(message.linear.x) for message in driving.heard)


def test_state_is_latched_for_those_who_come_late(driving: Driver) -> None:
    late = Probe(driving.probe.context.get_domain_id(), 'late')
    try:
        states = late.listen(DiagnosticStatus, 'safety_state')
        late.wait_for(lambda: states, 'the latched state')
        assert states[0].name == 'safety_stop'
    finally:
        late.close()


def test_speed_is_limited_whatever_is_asked_for(driving: Driver) -> None:
    driving.speed = 5.0
    driving.wait_speed(lambda speed: speed >= 0.55, 'the largest speed')
    assert max(message.linear.x for message in driving.heard) <= 0.6


def test_limit_can_be_changed_at_run_time(driving: Driver) -> None:
    probe = driving.probe
    driving.speed = 5.0
    assert probe.set_parameter('safety_stop', 'limits.max_speed', 0.2) == ''
    driving.wait_speed(lambda speed: speed == pytest.approx(0.2), 'the new limit')
    assert 'limits.max_speed' in probe.set_parameter('safety_stop', 'limits.max_speed', -1.0)


def test_standing_clock_stops(probe: Probe, make_robot: Callable[..., Any]) -> None:
    """/clock stands while commands go on coming: zero all the same."""
    simulated = Parameter('use_sim_time', value=True)
    probe.node.set_parameters([simulated])
    clock, running = [1_000_000_000], [True]
    publisher = probe.speak(Clock, 'clock')

    def tick() -> None:
        if running[0]:
            clock[0] += 20_000_000
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(clock[0], 1_000_000_000)
            publisher.publish(message)

    wall = RosClock(clock_type=ClockType.STEADY_TIME)
    probe.node.create_timer(0.02, tick, clock=wall)
    make_robot('cmd_vel')
    node = probe.host(SafetyNode, parameter_overrides=[simulated])
    driver = Driver(probe)
    driver.wait_speed(lambda speed: speed >= 0.299, 'the commanded speed')
    running[0] = False
    probe.node.create_timer(0.05, driver.command, clock=wall)
    assert driver.wait_speed(lambda speed: speed == 0.0, 'a stop') < 1.0
    driver.wait_words('clock stands still')
    assert driver.stands()
    assert node.get_name() == 'safety_stop'


def test_stamped_commands_by_parameter(probe: Probe, make_robot: Callable[..., Any]) -> None:
    make_robot()
    heard = probe.listen(TwistStamped, 'cmd_vel')
    probe.host(SafetyNode, parameter_overrides=[Parameter('twist_stamped', value=True)])
    probe.speak(TwistStamped, 'cmd_vel_nav')

    frame, late_s = [''], [0.0]

    def command() -> None:
        message = TwistStamped()
        message.twist = twist(0.1)
        message.header.frame_id = frame[0]
        stamp = probe.node.get_clock().now() - Duration(seconds=late_s[0])
        message.header.stamp = stamp.to_msg()
        probe.publish('cmd_vel_nav', message)

    probe.node.create_timer(0.05, command)
    probe.wait_for(lambda: heard and heard[-1].twist.linear.x == pytest.approx(0.1), 'driving')
    assert heard[-1].header.frame_id == 'base_link'
    assert heard[-1].header.stamp.sec > 0
    frame[0] = 'map'
    probe.wait_for(lambda: heard[-1].twist.linear.x == 0.0, 'a stop')
    probe.wait_diagnostic(
        'safety_stop: cmd_vel_nav', 'refused: not in frame base_link', lambda n: int(n) > 0
    )
    frame[0] = 'base_link'
    probe.wait_for(lambda: heard[-1].twist.linear.x == pytest.approx(0.1), 'driving again')
    late_s[0] = 0.6  # they come as often, but tell of the past
    probe.wait_for(lambda: heard[-1].twist.linear.x == 0.0, 'a stop for old commands')


@pytest.mark.parametrize('stamped', [False, True], ids=['twist out', 'stamped out'])
def test_command_of_one_type_becomes_one_of_the_other(
    probe: Probe, make_robot: Callable[..., Any], stamped: bool
) -> None:
    """Nav2 of Jazzy says Twist, diff_drive_controller wants TwistStamped; and the reverse."""
    taken, given = (Twist, TwistStamped) if stamped else (TwistStamped, Twist)
    make_robot()
    heard = probe.listen(given, 'cmd_vel')
    parameters = {'twist_stamped': stamped, 'nav_twist': 'twist' if stamped else 'twist_stamped'}
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    probe.host(SafetyNode, parameter_overrides=overrides)
    probe.speak(taken, 'cmd_vel_nav')

    def command() -> None:
        message = twist(0.1)
        if not stamped:
            message = TwistStamped(twist=message)
            message.header.stamp = probe.node.get_clock().now().to_msg()
        probe.publish('cmd_vel_nav', message)

    probe.node.create_timer(0.05, command)
    speed = (lambda m: m.twist.linear.x) if stamped else (lambda m: m.linear.x)
    probe.wait_for(lambda: heard and speed(heard[-1]) == pytest.approx(0.1), 'driving')


def test_geometry_comes_from_the_scenario(probe: Probe, room: Path) -> None:
    text = room.read_text() + 'robot: {limits: {speed: 0.25}}\n'
    room.write_text(text)
    node = probe.host(SafetyNode, parameter_overrides=[Parameter('scenario', value=str(room))])
    assert node._stop.limits.max_speed == 0.25
    assert node._stop.config.footprint_radius == 0.25


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ({'safety.margin': -1.0}, 'safety.margin'),
        ({'ultrasonic_poses': [0.0, 0.0]}, 'ultrasonic_poses'),
        ({'scenario': 'nowhere.yaml'}, 'nowhere.yaml'),
    ],
)
def test_bad_parameter_ends_with_code_2(
    processes: Processes, parameters: dict[str, Any], words: str
) -> None:
    process = processes.node('nav_controller', 'safety_stop', parameters)
    assert process.wait() == 2
    assert words in process.output


def test_process_ends_cleanly(probe: Probe, processes: Processes) -> None:
    probe.listen(Twist, 'cmd_vel')
    process = processes.node('nav_controller', 'safety_stop')
    probe.heard('cmd_vel')
    assert process.end() == 0


def test_process_that_is_ended_while_driving_leaves_a_zero(
    probe: Probe, processes: Processes, robot: Any
) -> None:
    """A base without a time limit of its own would go on at the last speed."""
    process = processes.node('nav_controller', 'safety_stop')
    driver = Driver(probe)
    driver.wait_speed(lambda speed: speed >= 0.299, 'the commanded speed')
    assert process.end() == 0
    probe.spin(0.2)
    assert driver.heard[-1].linear.x == 0.0


def test_no_pose_and_no_sensor_is_a_stop_from_the_start(probe: Probe) -> None:
    probe.host(SafetyNode)
    driver = Driver(probe)
    assert driver.stands(0.8)
    status = driver.wait_words('no pose')
    assert 'ultrasonic_left silent' in status.message
    probe.speak(Odometry, 'odometry/filtered')
