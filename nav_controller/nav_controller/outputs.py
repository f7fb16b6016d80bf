"""What nav_controller publishes at each step: the wished velocity, the way ahead, the reasons."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Path as PathMessage
from rclpy.node import Node

from nav_controller.convert import plan_to_message
from nav_controller.params import NavNodeConfig
from nav_controller.trace import traces_to_message
from tablerunner.control import Path
from tablerunner.control.fuzzy import Trace
from tablerunner.types import Velocity
from tablerunner_ros.conversions.velocity import velocity_to_twist, velocity_to_twist_stamped
from tablerunner_ros.qos import qos_for

COMMAND, PLAN, TRACE = 'cmd_vel_nav', 'plan', 'fuzzy_trace'


class Outputs:
    """Publishes on behalf of a node.

    Parameters
    ----------
    node : Node
    config : NavNodeConfig
    """

    def __init__(self, node: Node, config: NavNodeConfig) -> None:
        self._config = config
        kind = TwistStamped if config.twist_stamped else Twist
        self._velocity = node.create_publisher(kind, COMMAND, qos_for(COMMAND))
        self._plan = node.create_publisher(PathMessage, PLAN, qos_for(PLAN))
        self._trace = node.create_publisher(DiagnosticArray, TRACE, qos_for(TRACE))
        self._shown: Path | None = None

    def drive(self, velocity: Velocity, stamp: int) -> None:
        """Publish what to drive from `stamp` [ns] on."""
        if self._config.twist_stamped:
            message = velocity_to_twist_stamped(velocity, stamp, self._config.base_frame)
        else:
            message = velocity_to_twist(velocity)
        self._velocity.publish(message)

    def plan(self, path: Path | None, stamp: int) -> None:
        """Publish the way ahead when it is another one."""
        if path is not self._shown:
            self._shown = path
            self._plan.publish(plan_to_message(path, stamp, self._config.map_frame))

    def explain(self, traces: tuple[Trace, ...], stamp: int) -> None:
        """Publish which rules decided, if any did."""
        if traces:
            self._trace.publish(traces_to_message(traces, stamp))
