"""The services of fusion_node: set_pose, reset, toggle."""

from __future__ import annotations

from collections.abc import Callable

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from tablerunner.estimation import Localizer
from tablerunner_interfaces.srv import SetPose

SET_POSE, RESET, TOGGLE = 'set_pose', 'reset', 'toggle'


class FusionServices:
    """What users and other programs may ask of the localisation.

    Parameters
    ----------
    node : rclpy.node.Node
    localizer : Localizer
    start : callable
        Takes a pose and where it came from; returns why it cannot be used, or nothing.
    """

    def __init__(
        self,
        node: Node,
        localizer: Localizer,
        start: Callable[[str, PoseWithCovarianceStamped], str],
    ) -> None:
        self._localizer, self._start = localizer, start
        self._logger = node.get_logger()
        node.create_service(SetPose, SET_POSE, self._set_pose)
        node.create_service(Trigger, RESET, self._reset)
        node.create_service(SetBool, TOGGLE, self._toggle)

    def _set_pose(self, request: SetPose.Request, answer: SetPose.Response) -> SetPose.Response:
        reason = self._start(SET_POSE, request.pose)
        waits = not reason and self._localizer.estimate is None
        answer.success = not reason
        answer.message = reason or ('kept until odometry comes' if waits else 'started anew there')
        return answer

    def _reset(self, request: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:  # noqa: ARG002 (empty)
        self._localizer.reset()
        self._logger.info('reset: all that was believed is forgotten')
        answer.success, answer.message = True, self._localizer.status.words
        return answer

    def _toggle(self, request: SetBool.Request, answer: SetBool.Response) -> SetBool.Response:
        self._localizer.switch(request.data)
        answer.success = True
        answer.message = 'fusion is on' if request.data else 'fusion is off: odometry alone'
        self._logger.info(answer.message)
        return answer
