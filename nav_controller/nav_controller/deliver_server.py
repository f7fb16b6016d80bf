"""The deliver action without a blocking or waiting callback.

A goal is taken up when it is accepted, runs in the node's control timer and is finished from
there: a coroutine that awaits the end would keep rclpy's executor spinning at full load (it looks
at unfinished tasks again and again), a blocking one would hold up everything else.

A goal that cannot be used is accepted and aborted at once: a rejection could not carry the reason.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from nav_controller.convert import names_of_goal, result_from_tour
from tablerunner.control import Tour
from tablerunner_interfaces.action import Deliver


class _DeferringServer(ActionServer):
    """An action server that does nothing by itself once a goal is executing."""

    def notify_execute(
        self, goal_handle: ServerGoalHandle, execute_callback: Callable[..., Any] | None
    ) -> None:
        """Run what is given; what was registered stands only for the constructor's sake."""
        if execute_callback is not None:
            super().notify_execute(goal_handle, execute_callback)


class DeliverServer:
    """Serves `deliver` on behalf of a node.

    Parameters
    ----------
    node : Node
    begin : callable
        Takes a goal up, given its id; returns the reason why it cannot be, or ''.
    cancel : callable
        Ends what was begun under an id; `finish` is expected to follow.
    """

    def __init__(
        self,
        node: Node,
        begin: Callable[[Deliver.Goal, str], str],
        cancel: Callable[[str], bool],
    ) -> None:
        self._begin = begin
        self._cancel = cancel
        self._goals: dict[str, ServerGoalHandle] = {}
        self._server = _DeferringServer(
            node,
            Deliver,
            'deliver',
            execute_callback=lambda _goal: Deliver.Result(),
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
        )

    def destroy(self) -> None:
        """Take the action down."""
        self._server.destroy()

    def feedback(self, make: Callable[[str], Deliver.Feedback]) -> None:
        """Publish feedback of each goal, made from its id."""
        for name, goal in self._goals.items():
            goal.publish_feedback(make(name))

    def finish(self, name: str, tour: Tour) -> None:
        """End a goal with what became of its stops; one without a client is passed over."""
        goal = self._goals.pop(name, None)
        if goal is not None:
            self._end(goal, result_from_tour(tour))

    def _on_accepted(self, goal: ServerGoalHandle) -> None:
        name = _name_of(goal)
        reason = self._begin(goal.request, name)
        goal.execute()
        if not reason:
            self._goals[name] = goal
            return
        names = names_of_goal(goal.request)
        refused = Deliver.Result(
            success=False, missed=names, reasons=[reason] * len(names), message=reason
        )
        self._end(goal, refused)

    def _on_cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        name = _name_of(goal)
        if name not in self._goals or not self._cancel(name):
            return CancelResponse.REJECT
        return CancelResponse.ACCEPT

    def _end(self, goal: ServerGoalHandle, result: Deliver.Result) -> None:
        def end(handle: ServerGoalHandle) -> Deliver.Result:
            if handle.is_cancel_requested:
                handle.canceled()
            elif result.success:
                handle.succeed()
            else:
                handle.abort()
            return result

        self._server.notify_execute(goal, end)


def _name_of(goal: ServerGoalHandle) -> str:
    return bytes(goal.goal_id.uuid).hex()
