"""Ask the robot for a delivery through the `deliver` action, and follow it."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatus
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from tablerunner_bringup.nodes import COMMANDING
from tablerunner_interfaces.action import Deliver
from tablerunner_interfaces.msg import Stop

_ASK_AGAIN_S = 0.5


@dataclass(frozen=True)
class Outcome:
    """How a delivery ended."""

    success: bool
    message: str
    reached: tuple[str, ...] = ()
    missed: tuple[tuple[str, str], ...] = ()  # stop and reason


class Delivery:
    """One goal of the action; `spin` moves it on and never blocks.

    Parameters
    ----------
    node : Node
        For this action alone: an executor of its own spins it.
    """

    def __init__(self, node: Node, stops: Sequence[str], wait_s: float, return_home: bool) -> None:
        self._goal = Deliver.Goal(
            stops=[Stop(table=name, wait=wait_s) for name in stops], return_home=return_home
        )
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._client = ActionClient(node, Deliver, 'deliver')
        # Made after the action's client: see `is_ready`.
        self._echo = node.create_client(GetParameters, f'{COMMANDING}/get_parameters')
        self._ask_at = 0.0
        self._known = False
        self._handle: Any = None
        self._sent = False
        self.feedback: Any = None
        self.outcome: Outcome | None = None

    @property
    def is_ready(self) -> bool:
        """Whether the action's server is there and has found this client.

        A server that has not found its client yet loses the answer to a goal. Discovery keeps the
        order: once a service client that was made after the action's gets an answer from the same
        node, the action's client is known there too.
        """
        if self._known or not (self._client.server_is_ready() and self._echo.service_is_ready()):
            return self._known
        if time.monotonic() >= self._ask_at:
            self._ask_at = time.monotonic() + _ASK_AGAIN_S
            request = GetParameters.Request(names=['use_sim_time'])
            self._echo.call_async(request).add_done_callback(self._on_echo)
        self.spin(0.0)
        return self._known

    def send(self) -> None:
        """Send the goal."""
        self._sent = True
        future = self._client.send_goal_async(self._goal, feedback_callback=self._on_feedback)
        future.add_done_callback(self._on_answer)

    def spin(self, limit_s: float) -> None:
        """Handle what has come, for at most `limit_s` when nothing has."""
        self._executor.spin_once(timeout_sec=limit_s)

    def cancel(self) -> None:
        """Ask the robot to give the delivery up; the answer comes by `outcome`."""
        if self._handle is not None and self.outcome is None:
            self._handle.cancel_goal_async()

    def close(self) -> None:
        """Let go of the action."""
        self._client.destroy()
        self._executor.shutdown()

    def _on_echo(self, _future: Any) -> None:
        self._known = True

    def _on_feedback(self, message: Any) -> None:
        self.feedback = message.feedback

    def _on_answer(self, future: Any) -> None:
        handle = future.result()
        if not handle.accepted:
            stops = ', '.join(stop.table for stop in self._goal.stops)
            self.outcome = Outcome(False, f'nav_controller refused the delivery to {stops}')
            return
        self._handle = handle
        handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future: Any) -> None:
        response = future.result()
        result = response.result
        success = result.success and response.status == GoalStatus.STATUS_SUCCEEDED
        self.outcome = Outcome(
            success,
            result.message or ('delivered' if success else 'not delivered'),
            tuple(result.reached),
            tuple(zip(result.missed, result.reasons, strict=False)),
        )


def activity(feedback: Any) -> str:
    """Return what a robot on a delivery does, from its feedback."""
    left = feedback.distance_left
    way = f', {left:.1f} m to go' if math.isfinite(left) and left > 0.0 else ''
    return f'{feedback.state} ({feedback.stop}{way})'
