"""The services by which people and programs have a say in what is under way."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import Trigger

from tablerunner.control import Dispatcher
from tablerunner.errors import TablerunnerError


class Requests:
    """Offers them on behalf of a node; each answers with what was done, or why it was not.

    Parameters
    ----------
    node : Node
    dispatcher : Dispatcher
    """

    def __init__(self, node: Node, dispatcher: Dispatcher) -> None:
        self._node = node
        mission = dispatcher.mission
        self._offer('confirm', mission.confirm, 'confirmed')
        self._offer('pause', mission.pause, 'paused')
        self._offer('resume', mission.resume, 'resumed')
        self._offer('skip', mission.skip, 'skipped')
        self._offer('cancel_delivery', dispatcher.cancel_current, 'cancelled')
        self._offer('return_home', dispatcher.go_home, 'going home')

    def _offer(self, name: str, act: Callable[[], str | None], done: str) -> None:
        def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                what = act()
            except TablerunnerError as error:
                response.success, response.message = False, str(error)
            else:
                response.success, response.message = True, f'{done} {what or ""}'.rstrip()
            self._node.get_logger().info(f'{name}: {response.message}')
            return response

        self._node.create_service(Trigger, name, answer)
