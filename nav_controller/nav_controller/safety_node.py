"""The node safety_stop: the last word on each velocity between the controller and the base."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Range
from std_srvs.srv import Trigger

from nav_controller.convert import is_lost, localisation_of, safety_to_message
from nav_controller.params import SafetyNodeConfig
from tablerunner.control import (
    Localisation,
    SafetyDecision,
    SafetyState,
    SafetyStop,
    limits_within,
    sensor_mounts,
)
from tablerunner.scenario import DriveLimits, load_scenario
from tablerunner.types import NANOSECONDS, Refusal, Velocity, nanoseconds
from tablerunner_ros.clocks import now_ns, steady_ns, steady_timer
from tablerunner_ros.conversions.odometry import odometry_from_message
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.conversions.ultrasonic import ultrasonic_from_message
from tablerunner_ros.conversions.velocity import (
    velocity_from_message,
    velocity_to_twist,
    velocity_to_twist_stamped,
)
from tablerunner_ros.diagnostics import ERROR, WARN, Diagnostics, Report
from tablerunner_ros.parameters import declare_config
from tablerunner_ros.qos import qos_for
from tablerunner_ros.spin import spin_node

POSE, COMMAND, ULTRASONIC = 'odometry/filtered', 'cmd_vel_nav', 'ultrasonic'
_STATE_PERIOD_NS = NANOSECONDS // 2


class SafetyNode(Node):
    """Decides when a command, a reading or nothing at all arrives."""

    def __init__(self, **options: Any) -> None:
        super().__init__('safety_stop', **options)
        self._config = config = declare_config(self, SafetyNodeConfig, on_change=self._configure)
        mounts, self._base, self._radius = config.mounts, None, config.safety.footprint_radius
        if config.scenario:
            robot = load_scenario(config.scenario).robot
            mounts, self._base, self._radius = (
                sensor_mounts(robot),
                robot.limits,
                robot.footprint_radius,
            )
        self._stop = SafetyStop(config.safety, config.limits, mounts)
        self._configure(config)
        self._command: Velocity | None = None
        self._command_stamp = 0
        self._localisation, self._lost = Localisation(), False
        self._motion: Velocity | None = None
        self._clock_at, self._clock_seen = 0, steady_ns()
        self._decision: SafetyDecision | None = None
        self._sent_at = self._state_at = 0
        self._state_shown: tuple[Any, ...] = ()
        kind = TwistStamped if config.twist_stamped else Twist
        self._velocity = self.create_publisher(kind, 'cmd_vel', qos_for('cmd_vel'))
        self._state = self.create_publisher(
            DiagnosticStatus, 'safety_state', qos_for('safety_state')
        )
        self._diagnostics = Diagnostics(self)
        self._diagnostics.watch(COMMAND, config.safety.command_timeout)
        self._diagnostics.watch(POSE, config.safety.pose_timeout)
        for frame in mounts:
            self._diagnostics.watch(f'ultrasonic/{frame}', config.safety.ultrasonic_timeout)
            topic = 'ultrasonic/' + frame.removeprefix('ultrasonic_')
            self._listen(Range, topic, partial(self._on_range, frame))
        self._diagnostics.describe(self._describe)
        self._listen(Odometry, POSE, self._on_pose)
        self._listen(DiagnosticStatus, 'fusion_state', self._on_fusion)
        taken = TwistStamped if config.takes_stamped else Twist
        self._listen(taken, COMMAND, self._on_command)
        self.create_service(Trigger, 'emergency_stop', self._on_emergency)
        self.create_service(Trigger, 'release', self._on_release)
        # Wall time: it has to fire also when /clock stands.
        steady_timer(self, 1.0 / config.watch_rate, self._on_watch)

    def _listen(self, type_: Any, topic: str, callback: Any) -> None:
        self.create_subscription(type_, topic, callback, qos_for(topic, subscriber=True))

    def _on_command(self, message: Twist | TwistStamped) -> None:
        velocity = velocity_from_message(message, COMMAND, self._config.base_frame)
        if isinstance(velocity, Refusal):
            self._diagnostics.refuse(velocity)
            return
        self._command, self._command_stamp = velocity, now_ns(self)
        if isinstance(message, TwistStamped):  # it is as old as it says, not as it came
            stamp = stamp_from_message(message.header.stamp)
            self._command_stamp = min(stamp, self._command_stamp) or self._command_stamp
        self._send(self._decide())
        self._show()
        self._diagnostics.take(COMMAND, self._command_stamp)

    def _on_range(self, frame: str, message: Range) -> None:
        sample = ultrasonic_from_message(message)
        refusal = sample
        if message.header.frame_id != frame:
            refusal = Refusal(0, ULTRASONIC, '', f'not in frame {frame}')
        elif not isinstance(sample, Refusal):
            refusal = self._stop.add_reading(sample, now_ns(self))
        if refusal is not None:
            source = f'{ULTRASONIC}/{frame}'
            self._diagnostics.refuse(Refusal(refusal.stamp, source, '', refusal.reason))
            return
        before = self._decision
        decision = self._decide()
        if before is None or decision.velocity.linear_m_s < before.velocity.linear_m_s:
            self._send(decision)  # braking does not wait for the next command
        self._show()
        self._diagnostics.take(f'{ULTRASONIC}/{sample.sensor}', sample.stamp)

    def _on_pose(self, message: Odometry) -> None:
        sample = odometry_from_message(
            message, self._config.map_frame, self._config.base_frame, POSE
        )
        if isinstance(sample, Refusal):
            self._diagnostics.refuse(sample)
            return
        self._localisation = replace(localisation_of(sample), lost=self._lost)
        self._motion = Velocity(sample.linear_m_s, sample.angular_rad_s)
        self._diagnostics.take(POSE, sample.stamp)

    def _on_fusion(self, message: DiagnosticStatus) -> None:
        self._lost = is_lost(message)
        self._localisation = replace(self._localisation, lost=self._lost)

    def _on_watch(self) -> None:
        decision = self._decide()
        if steady_ns() - self._sent_at >= nanoseconds(1.0 / self._config.watch_rate):
            self._send(decision)
        self._show()

    def _decide(self) -> SafetyDecision:
        now, steady = now_ns(self), steady_ns()
        if now < self._clock_at - NANOSECONDS:
            self._stop.reset()
            self._command, self._localisation = None, Localisation(lost=self._lost)
        if now != self._clock_at:
            self._clock_at, self._clock_seen = now, steady
        fault = ''
        if now <= 0:
            fault = 'no time yet'
        elif steady - self._clock_seen > nanoseconds(self._config.clock_timeout):
            fault = 'clock stands still'
        motion = self._motion
        if now - self._localisation.stamp > nanoseconds(self._config.safety.pose_timeout):
            motion = None
        self._decision = self._stop.step(
            now, self._command, self._command_stamp, self._localisation, motion, fault
        )
        return self._decision

    def on_end(self) -> None:
        """Leave the wheels a zero: a base may have no time limit on commands of its own."""
        self._publish(Velocity(0.0, 0.0))

    def _send(self, decision: SafetyDecision) -> None:
        self._publish(decision.velocity)
        self._sent_at = steady_ns()

    def _publish(self, velocity: Velocity) -> None:
        if self._config.twist_stamped:
            message = velocity_to_twist_stamped(velocity, self._clock_at, self._config.base_frame)
        else:
            message = velocity_to_twist(velocity)
        self._velocity.publish(message)

    def _show(self) -> None:
        """Tell of the last decision: after it is sent, for the wheels come first."""
        decision, steady = self._decision, steady_ns()
        if decision is None:
            return
        shown = (decision.state, decision.reasons)
        changed = shown != self._state_shown
        if changed or steady - self._state_at >= _STATE_PERIOD_NS:
            self._state_shown, self._state_at = shown, steady
            self._state.publish(safety_to_message(decision, self._stop.emergency is not None))

    def _on_emergency(self, _request: Any, response: Trigger.Response) -> Trigger.Response:
        self._stop.trigger()
        self._send(self._decide())
        self._show()
        self.get_logger().warning('emergency stop')
        response.success, response.message = True, 'stopped until released'
        return response

    def _on_release(self, _request: Any, response: Trigger.Response) -> Trigger.Response:
        response.success = self._stop.release()
        response.message = 'released' if response.success else 'there was no emergency stop'
        self.get_logger().info(f'release: {response.message}')
        return response

    def _configure(self, config: SafetyNodeConfig) -> None:
        self._config = config
        limits = limits_within(config.limits, self._base or DriveLimits())
        self._stop.configure(config.safety.replace(footprint_radius=self._radius), limits)

    def _describe(self, report: Report) -> None:
        decision = self._decision
        if decision is None:
            return
        status = safety_to_message(decision, self._stop.emergency is not None)
        report.values.update({item.key: item.value for item in status.values})
        if decision.state is not SafetyState.CLEAR:
            level = ERROR if decision.state is SafetyState.STOP else WARN
            report.add(level, f'{decision.state.value}: {status.message}')


def main() -> int:
    """Run the node until it is told to end."""
    return spin_node(SafetyNode)
