"""The mode of nav_controller that follows a person: its service, its topics, its core objects."""

from __future__ import annotations

from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_srvs.srv import SetBool

from nav_controller.follow_convert import follow_to_message
from nav_controller.follow_params import person_of
from nav_controller.params import NavNodeConfig
from tablerunner.control import Dispatcher, limits_within, sensor_mounts
from tablerunner.control.fuzzy import Readings
from tablerunner.control.person_follower import FollowState, FollowStep, PersonFollower
from tablerunner.errors import MissionError
from tablerunner.estimation.person_locator import SOURCE, PersonLocator
from tablerunner.scenario import Scenario
from tablerunner.types import NANOSECONDS, OdometrySample, Refusal, Velocity, seconds
from tablerunner_interfaces.msg import UwbRange
from tablerunner_ros.clocks import now_ns
from tablerunner_ros.conversions.odometry import odometry_from_message
from tablerunner_ros.conversions.uwb_range import range_from_message
from tablerunner_ros.diagnostics import Diagnostics
from tablerunner_ros.qos import qos_for

ODOM, STATE, FOLLOW = 'odom', 'follow_state', 'follow'
BUSY = 'busy: a person is followed'

_ODOM_SILENT_S = 0.5
_TELL_NS = NANOSECONDS // 5
_LONGEST_STEP_S = 0.2


class FollowMode:
    """Follows on behalf of a node, on request.

    Parameters
    ----------
    node : Node
    config : NavNodeConfig
    scenario : Scenario
        Its robot says where anchors and ultrasonic sensors sit.
    diagnostics : Diagnostics
    dispatcher : Dispatcher
        What has the robot otherwise: nobody is followed while it has something to do.
    """

    def __init__(
        self,
        node: Node,
        config: NavNodeConfig,
        scenario: Scenario,
        diagnostics: Diagnostics,
        dispatcher: Dispatcher,
    ) -> None:
        self._node = node
        self._scenario = scenario
        self._diagnostics = diagnostics
        self._dispatcher = dispatcher
        self._frames = config.odom_frame, config.base_frame
        person = person_of(config.person, scenario.robot)
        self._tag_id = person.tag_id
        self._locator = PersonLocator(person) if person.anchor_ids else None
        mounts = sensor_mounts(scenario.robot)
        self._follower = PersonFollower(
            config.follow,
            limits_within(config.limits, scenario.robot.limits),
            tuple(mounts[frame] for frame in config.ultrasonic_frames),
        )
        self._odometry: OdometrySample | None = None
        self._velocity = Velocity()
        self._last = 0
        self._told: tuple[int, FollowState | None] = (0, None)
        self._state = node.create_publisher(DiagnosticStatus, STATE, qos_for(STATE))
        node.create_service(SetBool, FOLLOW, self._on_request)
        if self._locator is not None:
            self._listen(UwbRange, SOURCE, partial(self._on_range, self._locator))
            self._listen(Odometry, ODOM, partial(self._on_odometry, self._locator))

    @property
    def is_active(self) -> bool:
        """Whether somebody is followed or waited for."""
        return self._follower.is_active

    def require_idle(self) -> None:
        """Raise while somebody is followed.

        Raises
        ------
        MissionError
        """
        if self.is_active:
            raise MissionError(BUSY)

    def configure(self, config: NavNodeConfig) -> None:
        """Use other settings from now on; whoever is followed stays so."""
        limits = limits_within(config.limits, self._scenario.robot.limits)
        self._follower.configure(config.follow, limits)
        if self._locator is not None:
            self._locator.configure(person_of(config.person, self._scenario.robot))

    def step(self, stamp: int, otherwise: Velocity, readings: Readings, blocked: bool) -> Velocity:
        """Return what to drive: `otherwise` unless somebody is followed.

        A drive home, on request or for the battery, ends the following.
        """
        if stamp < self._last - NANOSECONDS:  # a bag that was started again
            self._follower.stop()
        dt = min(max(seconds(stamp - self._last), 0.0), _LONGEST_STEP_S)
        self._last = stamp
        if self._dispatcher.mission.is_busy:
            self._follower.stop()
            self._velocity = Velocity()
        odometry, locator = self._odometry, self._locator
        at_rest = not self.is_active and self._velocity == Velocity()
        if locator is None or odometry is None or at_rest:
            if self._told[1] not in (None, self._follower.state):
                self._tell(stamp, FollowStep(Velocity(), self._follower.state))
            return otherwise
        person, why = None, 'odometry is silent'
        if seconds(stamp - odometry.stamp) <= _ODOM_SILENT_S:
            sight = locator.sight(stamp)
            person, why = sight.person, sight.reason
        step = self._follower.step(stamp, dt, odometry.pose, person, why, readings, blocked)
        self._velocity = step.velocity
        self._tell(stamp, step)
        return step.velocity

    def _tell(self, stamp: int, step: FollowStep) -> None:
        """Publish a step when it is another state, and now and then."""
        at, state = self._told
        if step.state is state and 0 <= stamp - at < _TELL_NS:
            return
        if step.state is not state:
            self._node.get_logger().info(f'follow: {step.state.value} {step.reason}'.rstrip())
        self._told = stamp, step.state
        self._state.publish(follow_to_message(step, self._tag_id))

    def _listen(self, type_: Any, topic: str, callback: Any) -> None:
        self._node.create_subscription(type_, topic, callback, qos_for(topic, subscriber=True))

    def _on_request(self, request: SetBool.Request, response: SetBool.Response) -> Any:
        response.message = self._switch(request.data)
        response.success = not response.message
        if response.success:
            response.message = f'following {self._tag_id}' if request.data else 'stopped'
        self._node.get_logger().info(f'{FOLLOW}: {response.message}')
        return response

    def _switch(self, on: bool) -> str:
        """Begin or end to follow; return why not."""
        if not on:
            self._follower.stop()
            return ''
        if self._locator is None:
            return 'no anchors on the robot: person.anchor_ids, or robot.anchors of the scenario'
        if self._odometry is None:
            return 'no odometry yet'
        mission = self._dispatcher.mission
        if mission.is_busy or len(self._dispatcher.queue):
            return f'busy: {mission.status.state.value}'
        if not self.is_active:
            self._follower.start(now_ns(self._node))
        return ''

    def _on_odometry(self, locator: PersonLocator, message: Odometry) -> None:
        sample = odometry_from_message(message, *self._frames)
        refusal = sample if isinstance(sample, Refusal) else locator.add_odometry(sample)
        if refusal is not None:
            self._diagnostics.refuse(refusal)
            return
        self._diagnostics.take(ODOM, sample.stamp)
        self._odometry = sample

    def _on_range(self, locator: PersonLocator, message: UwbRange) -> None:
        sample = range_from_message(message)
        refusal = sample if isinstance(sample, Refusal) else locator.add_range(sample)
        if refusal is not None:
            self._diagnostics.refuse(refusal)
        else:
            self._diagnostics.take(SOURCE, sample.stamp)
