"""Fixtures for tests over DDS: a room, and a robot in it that is all but real."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from sensor_msgs.msg import Range
from std_srvs.srv import Trigger

from nav_controller.node import NavNode
from tablerunner.geometry.pose import Pose2
from tablerunner_interfaces.action import Deliver
from tablerunner_interfaces.msg import Stop
from tablerunner_ros.conversions.quaternion import fill_quaternion
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.fixtures import domain, probe, processes, quick_diagnostics
from tablerunner_ros.testing.probe import Probe

__all__ = ['domain', 'probe', 'processes', 'quick_diagnostics']

ROOM = """\
name: room
walls:
  - {name: hull, closed: true, points: [[0, 0], [5, 0], [5, 4], [0, 4]]}
boxes:
  - {name: block, x: 2.5, y: 3.4, length: 0.6, width: 0.6}
kitchen: {stop: [1.0, 1.0, 0.0]}
tables:
  - {name: table_1, x: 2.6, y: 0.4, length: 0.4, width: 0.4, stop: [1.9, 1.0, 0.0]}
  - {name: table_2, x: 4.6, y: 3.6, length: 0.4, width: 0.4, stop: [4.0, 3.0, 0.0]}
"""
SENSORS = ('left', 'left_front', 'front', 'right_front', 'right')
SERVICES = ('confirm', 'pause', 'resume', 'skip', 'cancel_delivery', 'return_home')
PERIOD_S = 0.05
START = Pose2(1.0, 1.0, 0.0)


class Robot:
    """Feeds the nodes under test with pose and ultrasonics and drives as it is told.

    Attributes
    ----------
    pose : Pose2
        base_link in map; follows ``cmd_vel`` or ``cmd_vel_nav``, whichever `follow` names.
    ranges : dict of str to float
        What each sensor reads [m]; one that is taken out falls silent.
    """

    def __init__(self, probe: Probe, follow: str = '') -> None:
        self.probe = probe
        self.pose = START
        self.ranges = dict.fromkeys(SENSORS, math.inf)
        self.position_variance, self.heading_variance = 0.0025, 0.0025
        self.localised = True
        self.frame = 'map'
        self.sensor_frames = {name: f'ultrasonic_{name}' for name in SENSORS}
        self.velocity = Twist()
        if follow:
            probe.node.create_subscription(Twist, follow, self._on_velocity, 1)
        for name in SENSORS:
            probe.speak(Range, f'ultrasonic/{name}')
        probe.speak(Odometry, 'odometry/filtered')
        self.timer = probe.node.create_timer(PERIOD_S, self.tick)

    def _on_velocity(self, message: Twist) -> None:
        self.velocity = message

    def tick(self) -> None:
        """Move on by one period and publish what the sensors of a robot would."""
        linear, turn = self.velocity.linear.x * PERIOD_S, self.velocity.angular.z * PERIOD_S
        step = Pose2(linear * math.cos(turn / 2), linear * math.sin(turn / 2), turn)
        self.pose = self.pose @ step
        for name, distance in self.ranges.items():
            self.publish_range(name, distance)
        if self.localised:
            self.publish_pose()

    def publish_pose(self) -> None:
        """Publish where the robot is."""
        message = Odometry()
        message.header.stamp = self.probe.node.get_clock().now().to_msg()
        message.header.frame_id = self.frame
        message.child_frame_id = 'base_link'
        message.pose.pose.position.x = self.pose.x
        message.pose.pose.position.y = self.pose.y
        fill_quaternion(message.pose.pose.orientation, self.pose.heading)
        message.pose.covariance[0] = message.pose.covariance[7] = self.position_variance
        message.pose.covariance[35] = self.heading_variance
        message.twist.twist = self.velocity
        self.probe.publish('odometry/filtered', message)

    def publish_range(self, name: str, distance: float) -> None:
        """Publish one reading."""
        message = Range(
            radiation_type=Range.ULTRASOUND,
            field_of_view=0.48,
            min_range=0.03,
            max_range=3.0,
            range=distance,
        )
        message.header.stamp = self.probe.node.get_clock().now().to_msg()
        message.header.frame_id = self.sensor_frames[name]
        self.probe.publish(f'ultrasonic/{name}', message)


class Customer:
    """Sends deliveries and listens to how they go."""

    def __init__(self, probe: Probe) -> None:
        self.probe = probe
        self.client = ActionClient(probe.node, Deliver, 'deliver')
        self.services = {name: probe.node.create_client(Trigger, name) for name in SERVICES}
        self.velocities = probe.listen(Twist, 'cmd_vel_nav')
        self.plans = probe.listen(PathMessage, 'plan')
        self.feedback: list[Deliver.Feedback] = []
        self.handle: Any = None

    def send(self, *stops: Stop, return_home: bool = False, queue: bool = False) -> Any:
        """Send a goal; return its handle once it was answered."""
        self.probe.wait_for(self.client.server_is_ready, 'the deliver action')
        future = self.client.send_goal_async(
            Deliver.Goal(stops=list(stops), return_home=return_home, queue=queue),
            lambda message: self.feedback.append(message.feedback),
        )
        self.probe.wait_for(future.done, 'an answer to the goal')
        self.handle = future.result()
        return self.handle

    def result(self, handle: Any = None, limit_s: float = 60.0) -> tuple[int, Deliver.Result]:
        """Wait for the end; return status and result."""
        future = (handle or self.handle).get_result_async()
        self.probe.wait_for(future.done, 'a result', limit_s)
        return future.result().status, future.result().result

    def wait_state(self, words: str, limit_s: float = 20.0) -> Deliver.Feedback:
        """Wait for feedback of a state."""
        try:
            self.probe.wait_for(
                lambda: any(item.state == words for item in self.feedback),
                f'feedback {words!r}',
                limit_s,
            )
        except AssertionError as error:
            raise AssertionError(f'{error}; only { {i.state for i in self.feedback} }') from None
        return next(item for item in self.feedback if item.state == words)

    def ask(self, service: str) -> Trigger.Response:
        """Return the answer of one of the node's services, which is asked once."""
        future = self.services[service].call_async(Trigger.Request())
        self.probe.wait_for(future.done, f'an answer of {service}')
        return future.result()

    def cancel(self, handle: Any = None) -> int:
        """Ask for a goal's end; return how many goals are being cancelled."""
        future = (handle or self.handle).cancel_goal_async()
        self.probe.wait_for(future.done, 'an answer to the cancellation')
        return len(future.result().goals_canceling)

    def stands(self, duration_s: float = 0.5) -> bool:
        """Return whether zero, and nothing else, is commanded for a while."""
        seen = len(self.velocities)
        self.probe.spin(duration_s)
        new = self.velocities[seen:]
        return bool(new) and all(m.linear.x == 0.0 and m.angular.z == 0.0 for m in new)


class Running:
    """One node for the tests of a module, each of which finds the robot at its start.

    Attributes
    ----------
    probe : Probe
    robot : Robot
    customer : Customer
    """

    def __init__(self, domain: int, room: Path, parameters: dict[str, Any]) -> None:
        self.probe = Probe(domain)
        self.robot = Robot(self.probe, 'cmd_vel_nav')
        values = {'scenario': str(room), **parameters}
        self.node = self.probe.host(
            NavNode,
            parameter_overrides=[Parameter(name, value=each) for name, each in values.items()],
        )
        self.customer = Customer(self.probe)
        self.probe.get_parameter('nav_controller', 'scenario')

    def begin(self) -> None:
        """Forget what was heard, and put the robot at its start."""
        self.robot.pose = START
        self.robot.ranges = dict.fromkeys(SENSORS, math.inf)
        self.robot.localised = True
        self.customer.feedback.clear()


@pytest.fixture(scope='module')
def make_running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Running]]:
    """Return a maker of nodes that a module shares; parameters by keyword."""
    made: list[Running] = []
    with contextlib.ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setattr('tablerunner_ros.diagnostics.PERIOD_S', 0.1)

        def make(**parameters: Any) -> Running:
            path = tmp_path_factory.mktemp('room') / 'room.yaml'
            path.write_text(ROOM, encoding='utf-8')
            item = Running(stack.enter_context(lease_domain()), path, parameters)
            made.append(item)
            return item

        yield make
        for item in made:
            item.probe.close()


@pytest.fixture
def robot(make_robot: Callable[..., Robot]) -> Robot:
    """Return a robot that drives as nav_controller wants."""
    return make_robot('cmd_vel_nav')


@pytest.fixture
def customer(probe: Probe, room: Path) -> Customer:
    """Return a customer of a node of the test's own."""
    probe.host(NavNode, parameter_overrides=[Parameter('scenario', value=str(room))])
    return Customer(probe)


@pytest.fixture
def make_customer() -> type[Customer]:
    """Return a maker of customers."""
    return Customer


@pytest.fixture(autouse=True)
def _quick(quick_diagnostics: None) -> None:
    """Report often, in every test of these nodes."""


@pytest.fixture
def make_robot(probe: Probe) -> Callable[..., Robot]:
    """Return a maker of robots."""
    return lambda follow='': Robot(probe, follow)


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """Return a scenario file of a small room with two tables."""
    path = tmp_path / 'room.yaml'
    path.write_text(ROOM, encoding='utf-8')
    return path


def words(status: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a status."""
    return {item.key: item.value for item in status.values}
