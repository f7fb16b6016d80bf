"""nav_controller over DDS."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Path as PathMessage
from rclpy.parameter import Parameter

from nav_controller.node import NavNode
from tablerunner_interfaces.msg import Stop
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.testing.process import Processes


def pose(x: float, y: float, frame: str = 'map') -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y = x, y
    message.pose.orientation.w = 1.0
    return message


def table(name: str, wait: float = 0.0) -> Stop:
    return Stop(table=name, wait=wait)


def test_delivery_arrives_and_comes_home(customer: Any, robot: Any) -> None:
    """To a table and back, with feedback, plan and the final result."""
    customer.send(table('table_1', 0.5), return_home=True)
    assert customer.handle.accepted
    first = customer.wait_state('driving')
    assert first.stop == 'table_1'
    assert first.stop_index == 0
    assert 0.0 < first.distance_left < 1.2
    assert first.pose.header.frame_id == 'map'
    plan = next(item for item in customer.plans if item.poses)
    assert plan.poses[-1].pose.position.x == pytest.approx(1.9)
    waiting = customer.wait_state('waiting')
    assert waiting.distance_left == 0.0
    returning = customer.wait_state('returning')
    assert returning.stop_index == 1
    assert returning.stop == 'kitchen'
    status, result = customer.result()
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert result.success
    assert result.reached == ['table_1', 'kitchen']
    assert result.missed == []
    assert result.message == '2 of 2 stops reached'
    assert math.hypot(robot.pose.x - 1.0, robot.pose.y - 1.0) < 0.25
    assert max(abs(message.linear.x) for message in customer.velocities) <= 0.6
    assert customer.stands()


@pytest.mark.parametrize(
    ('stop', 'words'),
    [
        (table('table_9'), "no table 'table_9'; known are one of kitchen, table_1, table_2"),
        (Stop(pose=pose(2.0, 2.0, 'odom')), 'stop 1: not in frame map'),
        (Stop(pose=pose(2.0, 2.0, '')), 'stop 1: not in frame map'),
        (Stop(pose=pose(math.nan, 2.0)), 'stop 1: '),
        (Stop(pose=pose(9.0, 2.0)), 'stop 1: the goal (9.00, 2.00) is outside the room'),
        (Stop(pose=pose(2.5, 3.4)), 'stop 1: the goal (2.50, 3.40) is inside an obstacle'),
        (Stop(pose=pose(0.1, 2.0)), 'from an obstacle'),
        (table('table_1', -1.0), 'the wait must be at least 0 s'),
        (table('table_1', math.nan), 'the wait must be at least 0 s'),
    ],
)
def test_bad_stop_ends_the_delivery_with_its_reason(
    customer: Any, robot: Any, stop: Stop, words: str
) -> None:
    customer.send(stop)
    status, result = customer.result(limit_s=10.0)
    assert status == GoalStatus.STATUS_ABORTED
    assert not result.success
    assert words in result.message
    assert len(result.missed) == len(result.reasons) == 1
    assert customer.stands(0.2)
    reported = customer.probe.wait_diagnostic(
        'nav_controller: deliver', 'refused', lambda count: int(count) == 1
    )
    assert any(words in item.key for item in reported.values)


def test_delivery_without_stops_is_refused(customer: Any) -> None:
    customer.send()
    status, result = customer.result(limit_s=10.0)
    assert status == GoalStatus.STATUS_ABORTED
    assert 'at least one stop' in result.message


def test_second_delivery_is_refused_while_busy(customer: Any, robot: Any) -> None:
    first = customer.send(table('table_2'))
    customer.wait_state('driving')
    second = customer.send(table('table_1'))
    status, result = customer.result(second, 10.0)
    assert status == GoalStatus.STATUS_ABORTED
    assert 'busy' in result.message
    status, result = customer.result(first)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert result.reached == ['table_2']


@pytest.mark.parametrize('state', ['driving', 'waiting', 'waiting for localisation'])
def test_cancel_stops_the_robot_and_tells_what_was_missed(
    customer: Any, robot: Any, state: str
) -> None:
    robot.localised = state != 'waiting for localisation'
    customer.send(table('table_1', 60.0), table('table_2'))
    customer.wait_state(state)
    future = customer.handle.cancel_goal_async()
    customer.probe.wait_for(future.done, 'an answer to the cancellation')
    assert len(future.result().goals_canceling) == 1
    status, result = customer.result(limit_s=10.0)
    assert status == GoalStatus.STATUS_CANCELED
    assert not result.success
    assert 'table_2' in result.missed
    assert set(result.reasons) == {'cancelled'}
    customer.probe.spin(0.8)
    assert customer.stands()


def test_delivery_after_a_cancelled_one_is_taken(customer: Any, robot: Any) -> None:
    first = customer.send(table('table_2'))
    customer.wait_state('driving')
    future = first.cancel_goal_async()
    customer.probe.wait_for(future.done, 'an answer to the cancellation')
    customer.result(first, 10.0)
    customer.send(table('table_1'))
    assert customer.result()[1].reached == ['table_1']


def test_robot_without_pose_waits(customer: Any, robot: Any) -> None:
    robot.localised = False
    customer.send(table('table_1'))
    customer.wait_state('waiting for localisation')
    assert customer.stands()
    robot.localised = True
    assert customer.result()[1].reached == ['table_1']


def test_robot_without_heading_drives_gently_to_find_it(customer: Any, robot: Any) -> None:
    robot.heading_variance = 3.29
    customer.send(table('table_1'))
    customer.wait_state('finding its heading')
    customer.probe.wait_for(
        lambda: customer.velocities[-1].linear.x == pytest.approx(0.2), 'a gentle drive'
    )
    robot.heading_variance = 0.0025
    assert customer.result()[1].reached == ['table_1']


def test_goal_pose_is_driven_to(customer: Any, robot: Any) -> None:
    probe = customer.probe
    probe.speak(PoseStamped, 'goal_pose')
    probe.connected('goal_pose')
    probe.publish('goal_pose', pose(1.8, 1.4))
    probe.wait_for(
        lambda: math.hypot(robot.pose.x - 1.8, robot.pose.y - 1.4) < 0.2, 'the robot at the goal'
    )
    probe.wait_diagnostic('nav_controller', 'state', 'done')


@pytest.mark.parametrize(
    ('goal', 'words'),
    [
        (pose(1.8, 1.4, 'odom'), 'not in frame map'),
        (pose(math.nan, 1.4), 'position is not finite'),
        (pose(9.0, 1.4), 'goal: the goal (9.00, 1.40) is outside the room'),
        (pose(2.5, 3.4), 'goal: the goal (2.50, 3.40) is inside an obstacle'),
    ],
)
def test_bad_goal_pose_is_refused_with_its_reason(
    customer: Any, robot: Any, goal: PoseStamped, words: str
) -> None:
    probe = customer.probe
    probe.speak(PoseStamped, 'goal_pose')
    probe.connected('goal_pose')
    probe.publish('goal_pose', goal)
    probe.wait_diagnostic('nav_controller: goal_pose', f'refused: {words}', '1')
    assert customer.stands(0.3)


def test_goal_pose_does_not_disturb_a_delivery(customer: Any, robot: Any) -> None:
    probe = customer.probe
    probe.speak(PoseStamped, 'goal_pose')
    customer.send(table('table_1'))
    customer.wait_state('driving')
    probe.connected('goal_pose')
    probe.publish('goal_pose', pose(4.0, 1.0))
    probe.wait_diagnostic('nav_controller: goal_pose', 'refused', '1')
    assert customer.result()[1].reached == ['table_1']


def test_waypoints_are_passed_in_their_order(customer: Any, robot: Any) -> None:
    probe = customer.probe
    probe.speak(PathMessage, 'waypoints')
    probe.connected('waypoints')
    way = PathMessage(poses=[pose(1.6, 1.0), pose(1.6, 1.6)])
    way.header.frame_id = 'map'
    probe.publish('waypoints', way)
    for x, y in ((1.6, 1.0), (1.6, 1.6)):
        probe.wait_for(
            lambda x=x, y=y: math.hypot(robot.pose.x - x, robot.pose.y - y) < 0.25,
            f'the robot at {x}, {y}',
        )
    probe.wait_diagnostic('nav_controller', 'state', 'done')


def test_empty_waypoints_are_refused(customer: Any, robot: Any) -> None:
    probe = customer.probe
    probe.speak(PathMessage, 'waypoints')
    probe.connected('waypoints')
    way = PathMessage()
    way.header.frame_id = 'map'
    probe.publish('waypoints', way)
    probe.wait_diagnostic('nav_controller: waypoints', 'refused: path is empty', '1')


def test_stop_for_something_in_the_way_is_told(customer: Any, robot: Any) -> None:
    """What safety_state says comes back in the feedback."""
    probe = customer.probe
    probe.speak(DiagnosticStatus, 'safety_state')
    customer.send(table('table_2'))
    customer.wait_state('driving')
    status = DiagnosticStatus(level=DiagnosticStatus.ERROR, name='safety_stop')
    status.values = [
        KeyValue(key='state', value='stop'),
        KeyValue(key='blocked', value='true'),
        KeyValue(key='obstacle x [m]', value='0.4'),
        KeyValue(key='obstacle y [m]', value='0.0'),
    ]
    probe.publish('safety_state', status)
    customer.wait_state('stopped for something in the way')


def test_stamped_velocity_by_parameter(probe: Probe, room: Path) -> None:
    heard = probe.listen(TwistStamped, 'cmd_vel_nav')
    probe.host(
        NavNode,
        parameter_overrides=[
            Parameter('scenario', value=str(room)),
            Parameter('twist_stamped', value=True),
        ],
    )
    probe.wait_for(lambda: heard, 'a stamped velocity')
    assert heard[0].header.frame_id == 'base_link'


def test_speed_limit_changes_at_run_time(customer: Any, robot: Any) -> None:
    probe = customer.probe
    assert probe.set_parameter('nav_controller', 'limits.max_speed', 0.2) == ''
    customer.send(table('table_1'))
    customer.result()
    top = max(message.linear.x for message in customer.velocities)
    assert top == pytest.approx(0.2)
    refused = probe.set_parameter('nav_controller', 'follower.lookahead_max', 0.1)
    assert 'at least lookahead_min' in refused


@pytest.mark.parametrize(
    ('parameters', 'words'),
    [
        ({}, 'scenario'),
        ({'scenario': 'nowhere.yaml'}, 'nowhere.yaml'),
        ({'scenario': 'nowhere.yaml', 'controller': 'magic'}, 'one of fuzzy, pure_pursuit'),
        ({'scenario': 'nowhere.yaml', 'limits.max_speed': 'fast'}, 'limits.max_speed'),
    ],
)
def test_bad_parameter_ends_with_code_2(
    processes: Processes, parameters: dict[str, Any], words: str
) -> None:
    process = processes.node('nav_controller', 'nav_controller', parameters)
    assert process.wait() == 2
    assert words in process.output


def test_process_ends_cleanly_during_a_delivery(
    probe: Probe, processes: Processes, room: Path, robot: Any, make_customer: Any
) -> None:
    customer = make_customer(probe)
    process = processes.node('nav_controller', 'nav_controller', {'scenario': str(room)})
    probe.wait_for(customer.client.server_is_ready, 'the deliver action')
    # An answer is lost while the server has not found its client: this one comes after it.
    probe.get_parameter('nav_controller', 'scenario')
    customer.send(table('table_2'))
    customer.wait_state('driving')
    assert process.end() == 0
