"""Deliveries that queue, hand over, pause and are skipped, over DDS, on one node."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import BatteryState

from tablerunner_interfaces.msg import Stop

NEAR, FAR = Stop(table='table_1'), Stop(table='table_2')


@pytest.fixture(scope='module')
def shared(make_running: Callable[..., Any]) -> Any:
    """Return one node for all tests here."""
    return make_running()


@pytest.fixture
def running(shared: Any) -> Any:
    """Return the node, idle, with the robot at its start and a battery that does not tell."""
    charge(shared, math.nan)
    shared.begin()
    return shared


def charge(running: Any, share: float) -> None:
    """Tell the node a charge until it has heard it."""
    words = 'not known' if math.isnan(share) else f'{100 * share:.0f} %'

    def heard() -> bool:
        status = running.probe.diagnostic('nav_controller')
        items = [] if status is None else status.values
        return any(i.key == 'battery charge' and i.value == words for i in items)

    running.probe.repeat(
        'battery_state', lambda: BatteryState(percentage=share), heard, f'a charge of {words}'
    )


def test_queued_delivery_waits_for_its_turn(running: Any) -> None:
    customer = running.customer
    first = customer.send(NEAR, queue=True)
    second = customer.send(NEAR, NEAR, queue=True)
    third = customer.send(NEAR, queue=True)
    queued = customer.wait_state('queued')
    assert math.isnan(queued.distance_left)
    running.probe.wait_for(
        lambda: {0, 1, 2} <= {item.queue_place for item in customer.feedback}, 'all places'
    )
    assert customer.cancel(third) == 1
    status, result = customer.result(third)
    assert status == GoalStatus.STATUS_CANCELED
    assert (result.missed, result.reasons) == (['table_1'], ['cancelled'])
    assert customer.result(first)[1].reached == ['table_1']
    status, result = customer.result(second)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert result.reached == ['table_1', 'table_1']


def test_hand_over_is_confirmed_by_service(running: Any) -> None:
    customer = running.customer
    refused = customer.ask('confirm')
    assert not refused.success
    assert 'nothing to confirm' in refused.message
    customer.send(Stop(table='table_1', confirm_within=60.0))
    customer.wait_state('waiting for confirmation')
    answer = customer.ask('confirm')
    assert (answer.success, answer.message) == (True, 'confirmed table_1')
    status, result = customer.result()
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert result.unconfirmed == []


def test_hand_over_that_nobody_confirms_is_in_the_result(running: Any) -> None:
    running.customer.send(Stop(table='table_1', confirm_within=0.5))
    status, result = running.customer.result()
    assert status == GoalStatus.STATUS_ABORTED
    assert not result.success
    assert result.reached == result.unconfirmed == ['table_1']
    assert result.message == '1 of 1 stops reached; not confirmed: table_1'


def test_pause_stands_until_resume(running: Any) -> None:
    customer = running.customer
    assert 'nothing to pause' in customer.ask('pause').message
    customer.send(FAR)
    customer.wait_state('driving')
    assert customer.ask('pause').success
    customer.wait_state('paused')
    running.probe.spin(0.8)
    assert customer.stands(0.3)
    customer.feedback.clear()
    assert customer.ask('resume').success
    customer.wait_state('driving')
    customer.cancel()
    assert customer.result()[1].missed == ['table_2']


def test_skip_goes_on_with_the_next_stop(running: Any) -> None:
    customer = running.customer
    customer.send(FAR, NEAR)
    customer.wait_state('driving')
    answer = customer.ask('skip')
    assert (answer.success, answer.message) == (True, 'skipped table_2')
    _, result = customer.result()
    assert result.reached == ['table_1']
    assert (result.missed, result.reasons) == (['table_2'], ['skipped on request'])


def test_delivery_is_cancelled_by_service_and_the_robot_sent_home(running: Any) -> None:
    customer = running.customer
    customer.send(FAR, NEAR)
    customer.wait_state('driving')
    assert 'busy' in customer.ask('return_home').message
    assert customer.ask('cancel_delivery').success
    status, result = customer.result()
    assert status == GoalStatus.STATUS_ABORTED  # only its client can cancel a goal
    assert result.missed == ['table_2', 'table_1']
    assert customer.ask('return_home').success
    running.probe.wait_diagnostic('nav_controller', 'state', 'done')
    assert math.hypot(running.robot.pose.x - 1.0, running.robot.pose.y - 1.0) < 0.25


def test_low_battery_takes_no_delivery_and_says_its_charge(running: Any) -> None:
    charge(running, 0.12)
    running.customer.send(NEAR)
    status, result = running.customer.result()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.message == 'battery too low: 12 %, at least 20 % is needed'


def test_robot_whose_battery_runs_low_finishes_and_goes_home(running: Any) -> None:
    customer = running.customer
    customer.send(NEAR)
    customer.wait_state('driving')
    charge(running, 0.1)
    assert customer.result()[1].reached == ['table_1']
    running.probe.wait_for(
        lambda: math.hypot(running.robot.pose.x - 1.0, running.robot.pose.y - 1.0) < 0.2,
        'the robot at home',
    )
    running.probe.wait_diagnostic('nav_controller', 'state', 'done')


def test_charge_that_is_no_share_is_refused(running: Any) -> None:
    running.probe.publish('battery_state', BatteryState(percentage=87.0))
    running.probe.wait_diagnostic(
        'nav_controller: battery_state', 'refused: charge is not a share from 0 to 1', '1'
    )


@pytest.mark.parametrize('confirm', [-1.0, math.nan])
def test_bad_time_to_confirm_is_refused(running: Any, confirm: float) -> None:
    running.customer.send(Stop(table='table_1', confirm_within=confirm))
    assert 'the time to confirm must be at least 0 s' in running.customer.result()[1].message


def test_goal_in_the_middle_of_another_replaces_it(running: Any) -> None:
    probe = running.probe
    probe.speak(PoseStamped, 'goal_pose')
    probe.connected('goal_pose')
    for y in (3.0, 1.0):
        goal = PoseStamped()
        goal.header.frame_id = 'map'
        goal.pose.position.x, goal.pose.position.y, goal.pose.orientation.w = 1.8, y, 1.0
        probe.publish('goal_pose', goal)
        probe.wait_diagnostic('nav_controller', 'state', 'driving')
    probe.wait_for(
        lambda: math.hypot(running.robot.pose.x - 1.8, running.robot.pose.y - 1.0) < 0.2,
        'the robot at the second goal',
    )
    assert running.robot.pose.y < 1.6
    probe.wait_diagnostic('nav_controller', 'state', 'done')
