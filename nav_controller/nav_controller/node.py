"""The node nav_controller: takes deliveries and goals, plans, and drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as PathMessage
from rclpy.node import Node

from nav_controller.assembly import assemble
from nav_controller.convert import (
    destinations_from_goal,
    feedback_from_queue,
    feedback_from_status,
)
from nav_controller.deliver_server import DeliverServer
from nav_controller.follow_mode import FollowMode
from nav_controller.outputs import Outputs
from nav_controller.params import NavNodeConfig
from nav_controller.requests import Requests
from nav_controller.senses import Senses
from tablerunner.control import (
    Battery,
    Delivery,
    DeliveryStore,
    Destination,
    Dispatcher,
    MissionState,
    MissionStatus,
    Situation,
)
from tablerunner.errors import MissionError, PlanningError
from tablerunner.scenario import load_scenario
from tablerunner.types import Refusal, nanoseconds
from tablerunner_interfaces.action import Deliver
from tablerunner_ros.clocks import now_ns
from tablerunner_ros.conversions.pose import goal_from_message, path_from_message
from tablerunner_ros.diagnostics import ERROR, WARN, Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node

GOAL, WAYPOINTS, DELIVER = 'goal_pose', 'waypoints', 'deliver'


class NavNode(Node):
    """Asks the dispatcher in its control timer what to drive."""

    def __init__(self, **options: Any) -> None:
        super().__init__('nav_controller', **options)
        self._config = config = declare_config(self, NavNodeConfig, on_change=self._configure)
        scenario = load_scenario(config.scenario)
        if config.robot:
            scenario = scenario.seen_by(scenario.member(config.robot))
        self._scenario = scenario
        self._parts = assemble(config, scenario)
        self._mission = self._parts.mission
        self._battery = Battery(config.battery)
        self._store = DeliveryStore(Path(config.queue_file)) if config.queue_file else None
        self._dispatcher = Dispatcher(
            self._mission,
            self._battery,
            config.queue_limit,
            None if self._store is None else self._store.load(),
            None if self._store is None else self._store.save,
        )
        self._status: MissionStatus = self._mission.status
        self._last = ''
        self._feedback_due = 0
        self._outputs = Outputs(self, config)
        self._diagnostics = Diagnostics(self)
        self._senses = Senses(self, config, self._diagnostics, self._battery)
        self._diagnostics.describe(self._describe)
        self._deliver = DeliverServer(self, self._begin, self._dispatcher.cancel)
        self._requests = Requests(self, self._dispatcher)
        self._follow = FollowMode(self, config, scenario, self._diagnostics, self._dispatcher)
        for type_, topic, callback in (
            (PoseStamped, GOAL, self._on_goal),
            (PathMessage, WAYPOINTS, self._on_waypoints),
        ):
            self.create_subscription(type_, topic, callback, qos_for(topic, subscriber=True))
        self.create_timer(1.0 / config.control_rate, self._on_timer)

    def destroy_node(self) -> None:
        """Take the action down, which rclpy does not, and let others use the queue's file."""
        self._deliver.destroy()
        if self._store is not None:
            self._store.close()
        super().destroy_node()

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
        """Drive to places for a topic; that replaces what came by topic, never a delivery."""
        try:
            self._follow.require_idle()
            self._dispatcher.go(stops, now_ns(self))
        except (MissionError, PlanningError) as error:
            self._refuse(source, str(error))
            return
        self._diagnostics.take(source, now_ns(self))
        self.get_logger().info(f'{source}: {len(stops)} to reach')

    def _begin(self, goal: Deliver.Goal, name: str) -> str:
        """Take a delivery; return why it cannot be taken, or ''."""
        stamp = now_ns(self)
        try:
            stops = destinations_from_goal(goal, self._scenario, self._config.map_frame)
            self._follow.require_idle()
            if not stops:
                raise MissionError('a delivery needs at least one stop')
            delivery = Delivery(name, self._mission.tour_of(stops, goal.return_home))
            self._dispatcher.submit(delivery, stamp, goal.queue)
        except (MissionError, PlanningError) as error:
            return self._refuse(DELIVER, str(error))
        self._diagnostics.take(DELIVER, stamp)
        self.get_logger().info('deliver: ' + ', '.join(stop.name for stop in stops))
        return ''

    def _refuse(self, source: str, reason: str) -> str:
        self._diagnostics.refuse(Refusal(now_ns(self), source, '', reason))
        return reason

    def _on_timer(self) -> None:
        stamp = now_ns(self)
        situation = self._senses.situation(stamp)
        readings = self._senses.readings(stamp)
        self._mission.hear(readings)
        step = self._dispatcher.step(situation)
        self._status = step.status
        velocity = self._follow.step(stamp, step.velocity, readings, situation.blocked)
        self._outputs.drive(velocity, stamp)
        self._outputs.plan(step.status.path, stamp)
        self._outputs.explain(self._parts.controller.traces, stamp)
        for event in step.events:
            self.get_logger().info(event)
        for ended in step.ended:
            self._last = f'{ended.state.value}: {ended.tour.message}'
            self._deliver.finish(ended.id, ended.tour)
        if stamp >= self._feedback_due or stamp < self._feedback_due - nanoseconds(10.0):
            self._feedback_due = stamp + nanoseconds(1.0 / self._config.feedback_rate)
            self._deliver.feedback(lambda name: self._feedback(name, situation))

    def _feedback(self, name: str, situation: Situation) -> Deliver.Feedback:
        if name == self._dispatcher.current:
            return feedback_from_status(self._status, situation, self._config.map_frame)
        place = self._dispatcher.queue.place(name) or 0
        return feedback_from_queue(place, situation, self._config.map_frame)

    def _configure(self, config: NavNodeConfig) -> None:
        self._config = config
        self._parts.configure(config)
        self._battery.config = config.battery
        self._follow.configure(config)

    def _describe(self, report: Report) -> None:
        status, dispatcher, stamp = self._status, self._dispatcher, now_ns(self)
        report.values['state'] = status.state.value
        report.values['stop'] = status.stop
        report.values['distance left [m]'] = f'{status.distance_left:.2f}'
        report.values['scenario'] = self._scenario.name
        report.values['deliveries'] = str(len(dispatcher.queue))
        report.values['last delivery'] = self._last
        report.values['battery charge'] = self._battery.words(stamp)
        if dispatcher.fault:
            report.add(ERROR, dispatcher.fault)
        if status.state is MissionState.FAILED:
            report.add(ERROR, status.message)
        elif status.state in (MissionState.BLOCKED, MissionState.LOCALISING, MissionState.HELD):
            report.add(WARN, status.state.value)
        if self._battery.is_low(stamp):
            report.add(WARN, f'battery low: {self._battery.words(stamp)}')


def main() -> int:
    """Run the node until it is told to end."""
    return spin_node(NavNode)
