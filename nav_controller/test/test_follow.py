"""Following a person over DDS: the service, the tag's ranges, the state, and who has the robot."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool

from nav_controller.follow_convert import follow_to_message
from tablerunner.control.person_follower import FollowState, FollowStep
from tablerunner.types import Velocity
from tablerunner_interfaces.msg import Stop, UwbRange
from tablerunner_ros.conversions.quaternion import fill_quaternion

PLACES = ((0.17, 0.17, 1.0), (-0.17, 0.17, 1.0), (-0.17, -0.17, 1.0), (0.17, -0.17, 1.0))
TAG_HEIGHT = 1.2
PARAMETERS = {
    'person.tag_id': 'host_tag',
    'person.tag_height': TAG_HEIGHT,
    'person.anchor_ids': ['R0', 'R1', 'R2', 'R3'],
    'person.anchor_positions': [value for place in PLACES for value in place],
    'follow.give_up_after': 2.5,
}


class Person:
    """Somebody with a tag: odometry of the robot and ranges between the tag and its anchors.

    Attributes
    ----------
    place : tuple of float
        Of the tag in map [m].
    silent : bool
        Whether the tag says nothing.
    """

    def __init__(self, running: Any) -> None:
        self.running = running
        self.probe = running.probe
        self.place, self.silent = (2.8, 1.0), False
        self.states = self.probe.listen(DiagnosticStatus, 'follow_state')
        self.client = self.probe.node.create_client(SetBool, 'follow')
        self.probe.speak(Odometry, 'odom')
        self.probe.speak(UwbRange, 'person/ranges')
        self.sequence = 0
        self.timer = self.probe.node.create_timer(0.04, self.tick)

    def tick(self) -> None:
        """Publish odometry and one range of each anchor."""
        stamp = self.probe.node.get_clock().now().to_msg()
        pose = self.running.robot.pose
        odom = Odometry(child_frame_id='base_link')
        odom.header.stamp, odom.header.frame_id = stamp, 'odom'
        odom.pose.pose.position.x, odom.pose.pose.position.y = pose.x, pose.y
        fill_quaternion(odom.pose.pose.orientation, pose.heading)
        odom.twist.twist = self.running.robot.velocity
        self.probe.publish('odom', odom)
        for index, place in enumerate(PLACES):
            if self.silent:
                continue
            x, y = pose.transform(np.array(place[:2]))
            message = UwbRange(anchor_id=f'R{index}', tag_id='host_tag', sequence=self.sequence)
            message.header.stamp = stamp
            message.range = math.dist((x, y, place[2]), (*self.place, TAG_HEIGHT))
            message.variance, message.nlos_probability = 0.01, 0.0
            self.probe.publish('person/ranges', message)
        self.sequence += 1

    def ask(self, follow: bool) -> SetBool.Response:
        """Return the answer of the service."""
        self.probe.wait_for(self.client.service_is_ready, 'the service follow')
        future = self.client.call_async(SetBool.Request(data=follow))
        self.probe.wait_for(future.done, 'an answer of follow')
        return future.result()

    def wait_state(self, words: str, limit_s: float = 20.0) -> dict[str, str]:
        """Wait until the newest state is so; return its values."""

        def found() -> DiagnosticStatus | None:
            newest = self.states[-1] if self.states else None
            return newest if newest is not None and newest.message.startswith(words) else None

        status = self.probe.wait_for(found, f'follow_state {words!r}', limit_s)
        return {item.key: item.value for item in status.values}


@pytest.fixture(scope='module')
def person(make_running: Callable[..., Any]) -> Person:
    """Return somebody whom the one node of this module can follow."""
    running = make_running(**PARAMETERS)
    running.begin()
    found = Person(running)
    running.probe.wait_diagnostic(
        'nav_controller: person/ranges', 'taken', lambda count: int(count) > 3
    )
    return found


def test_follow_comes_to_the_set_distance_loses_finds_and_gives_up(person: Person) -> None:
    """One story: 1.8 m away, come to 1.2 m, walks off, silent, again, silent for good."""
    customer = person.running.customer
    assert person.ask(True).message == 'following host_tag'
    person.wait_state('following')
    person.wait_state('near enough')
    person.probe.spin(0.5)
    robot = person.running.robot
    away = math.dist((robot.pose.x, robot.pose.y), person.place)
    assert away == pytest.approx(1.2, abs=0.2)

    handle = customer.send(Stop(table='table_1'))
    assert customer.result(handle)[1].message == 'busy: a person is followed'

    person.silent = True
    lost = person.wait_state('waiting for the person')
    assert lost['reason'] == 'no range of the tag'
    person.silent, person.place = False, (3.6, 1.3)
    values = person.wait_state('following')
    assert float(values['distance [m]']) > 1.2
    person.wait_state('near enough')

    person.silent = True
    person.wait_state('given up: no range of the tag for 2.5 s')
    person.probe.spin(0.5)  # the last swing of looking round ends
    assert customer.stands()
    person.silent = False


def test_follow_ended_on_request_stands_and_takes_deliveries(person: Person) -> None:
    person.running.begin()
    person.place = (2.8, 1.0)
    assert person.ask(True).success
    person.wait_state('following')
    assert person.ask(False).message == 'stopped'
    person.wait_state('idle')
    person.probe.spin(0.5)
    assert person.running.customer.stands()
    person.running.customer.send(Stop(table='table_2'))
    person.running.customer.wait_state('driving')
    refused = person.ask(True)
    assert not refused.success
    assert refused.message == 'busy: driving'
    person.running.customer.cancel()
    person.running.customer.result()


def test_follow_range_of_an_unknown_anchor_is_refused(person: Person) -> None:
    message = UwbRange(anchor_id='A7', tag_id='host_tag', range=1.0)
    message.header.stamp = person.probe.node.get_clock().now().to_msg()
    person.probe.publish('person/ranges', message)
    person.probe.wait_diagnostic(
        'nav_controller: person/ranges', 'refused: unknown anchor (A7)', '1'
    )


def test_follow_distance_the_safety_stop_would_hold_is_refused_live(person: Person) -> None:
    reason = person.probe.set_parameter('nav_controller', 'follow.distance', 0.5)
    assert 'at least 0.97 m' in reason


def test_state_message_tells_state_reason_and_where() -> None:
    step = FollowStep(Velocity(), FollowState.GIVEN_UP, 'no range for 30 s', 2.0, -0.5)
    message = follow_to_message(step, 'host_tag')
    assert message.message == 'given up: no range for 30 s'
    assert message.level == DiagnosticStatus.ERROR
    values = {item.key: item.value for item in message.values}
    assert values['distance [m]'] == '2.00'
    assert values['bearing [rad]'] == '-0.50'
    assert values['tag'] == 'host_tag'
