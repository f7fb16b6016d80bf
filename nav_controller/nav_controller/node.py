"""The node nav_controller: takes deliveries and goals, plans, and drives."""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import Path as PathMessage
from rclpy.node import Node

from nav_controller.convert import (
    destinations_from_goal,
    feedback_from_status,
    plan_to_message,
)
from nav_controller.deliver_server import DeliverServer
from nav_controller.params import NavNodeConfig
from nav_controller.senses import Senses
from nav_controller.trace import traces_to_message
from tablerunner.control import (
    Destination,
    Mission,
    MissionState,
    MissionStatus,
    configure_controller,
    home_of,
    limits_within,
    make_controller,
    make_planner,
)
from tablerunner.errors import MissionError, PlanningError
from tablerunner.scenario import load_scenario
from tablerunner.types import Refusal, Velocity, nanoseconds
from tablerunner_interfaces.action import Deliver
from tablerunner_ros.clocks import now_ns
from tablerunner_ros.conversions.pose import goal_from_message, path_from_message
from tablerunner_ros.conversions.velocity import velocity_to_twist, velocity_to_twist_stamped
from tablerunner_ros.diagnostics import ERROR, WARN, Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node

GOAL, WAYPOINTS, DELIVER, TRACE = 'goal_pose', 'waypoints', 'deliver', 'fuzzy_trace'


class NavNode(Node):
    """Runs one mission at a time in its control timer."""

    def __init__(self, **options: Any) -> None:
        super().__init__('nav_controller', **options)
        self._config = config = declare_config(self, NavNodeConfig, on_change=self._configure)
        self._scenario = scenario = load_scenario(config.scenario)
        limits = limits_within(config.limits, scenario.robot.limits)
        self._controller = make_controller(
            config.controller,
            limits,
            scenario.robot,
            config.controllers,
            config.ultrasonic_frames,
        )
        self._controller.explain(config.publish_trace)
        self._planner = make_planner(scenario, config.planner)
        self._mission = Mission(config.mission, self._planner, self._controller, home_of(scenario))
        self._status: MissionStatus = self._mission.status
        self._plan_shown: object = None
        self._feedback_due = 0
        kind = TwistStamped if config.twist_stamped else Twist
        self._velocity = self.create_publisher(kind, 'cmd_vel_nav', qos_for('cmd_vel_nav'))
        self._plan = self.create_publisher(PathMessage, 'plan', qos_for('plan'))
        self._trace = self.create_publisher(DiagnosticArray, TRACE, qos_for(TRACE))
        self._diagnostics = Diagnostics(self)
        self._senses = Senses(self, config, self._diagnostics)
        self._diagnostics.describe(self._describe)
        self._deliver = DeliverServer(self, self._begin, self._mission.cancel)
        for type_, topic, callback in (
            (PoseStamped, GOAL, self._on_goal),
            (PathMessage, WAYPOINTS, self._on_waypoints),
        ):
            self.create_subscription(type_, topic, callback, qos_for(topic, subscriber=True))
        self.create_timer(1.0 / config.control_rate, self._on_timer)

    def _on_goal(self, message: PoseStamped) -> None:
        pose = goal_from_message(message, self._config.map_frame, GOAL)
        if isinstance(pose, Refusal):
            self._diagnostics.refuse(pose)
            return
        self._go(GOAL, (Destination('goal', pose),))

    def _on_waypoints(self, message: PathMessage) -> None:
        poses = path_from_message(message, self._config.map_frame, WAYPOINTS)
        if isinstance(poses, Refusal):
            self._diagnostics.refuse(poses)
            return
        last = len(poses)
        stops = tuple(
            Destination(f'waypoint {number}', pose, keep_heading=number == last)
            for number, pose in enumerate(poses, start=1)
        )
        self._go(WAYPOINTS, stops)

    def _go(self, source: str, stops: tuple[Destination, ...]) -> None:
        """Start a mission for a topic; it replaces one that came by topic, never a delivery."""
        if not self._deliver.is_active:
            self._mission.cancel('replaced by another goal')
        reason = self._start(source, stops, return_home=False)
        if not reason:
            self.get_logger().info(f'{source}: {len(stops)} to reach')

    def _begin(self, goal: Deliver.Goal) -> str:
        """Take up a delivery; return why it cannot be, or ''."""
        try:
            stops = destinations_from_goal(goal, self._scenario, self._config.map_frame)
        except MissionError as error:
            return self._refuse(DELIVER, str(error))
        reason = self._start(DELIVER, stops, goal.return_home)
        if not reason:
            self.get_logger().info('deliver: ' + ', '.join(stop.name for stop in stops))
        return reason

    def _start(self, source: str, stops: tuple[Destination, ...], return_home: bool) -> str:
        try:
            self._mission.start(stops, return_home)
        except (MissionError, PlanningError) as error:
            return self._refuse(source, str(error))
        self._diagnostics.take(source, now_ns(self))
        return ''

    def _refuse(self, source: str, reason: str) -> str:
        self._diagnostics.refuse(Refusal(now_ns(self), source, '', reason))
        return reason

    def _on_timer(self) -> None:
        stamp = now_ns(self)
        situation = self._senses.situation(stamp)
        self._controller.hear(self._senses.readings(stamp))
        velocity, status = self._mission.step(situation)
        self._status = status
        self._send(velocity, stamp)
        if self._controller.traces:
            self._trace.publish(traces_to_message(self._controller.traces, stamp))
        for event in status.events:
            self.get_logger().info(event)
        if status.path is not self._plan_shown:
            self._plan_shown = status.path
            self._plan.publish(plan_to_message(status.path, stamp, self._config.map_frame))
        if status.state.is_final:
            self._deliver.finish(status)
        elif stamp >= self._feedback_due or stamp < self._feedback_due - nanoseconds(10.0):
            self._feedback_due = stamp + nanoseconds(1.0 / self._config.feedback_rate)
            self._deliver.feedback(feedback_from_status(status, situation, self._config.map_frame))

    def _send(self, velocity: Velocity, stamp: int) -> None:
        if self._config.twist_stamped:
            message = velocity_to_twist_stamped(velocity, stamp, self._config.base_frame)
        else:
            message = velocity_to_twist(velocity)
        self._velocity.publish(message)

    def _configure(self, config: NavNodeConfig) -> None:
        self._config = config
        limits = limits_within(config.limits, self._scenario.robot.limits)
        configure_controller(self._controller, limits, config.controllers)
        self._controller.explain(config.publish_trace)
        self._planner = self._planner.configured(config.planner)
        self._mission.configure(config.mission, self._planner)

    def _describe(self, report: Report) -> None:
        status = self._status
        report.values['state'] = status.state.value
        report.values['stop'] = status.stop
        report.values['distance left [m]'] = f'{status.distance_left:.2f}'
        report.values['scenario'] = self._scenario.name
        if status.state is MissionState.FAILED:
            report.add(ERROR, status.message)
        elif status.state in (MissionState.BLOCKED, MissionState.LOCALISING, MissionState.HELD):
            report.add(WARN, status.state.value)


def main() -> int:
    """Run the node until it is told to end."""
    return spin_node(NavNode)
