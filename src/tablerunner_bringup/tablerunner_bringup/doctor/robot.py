"""Facts of a running robot: listen first, then ask."""

from __future__ import annotations

from tablerunner.cli.console import Progress
from tablerunner.doctor import Facts
from tablerunner_bringup.doctor.asking import discovery_facts, loopback_s, parameters_of
from tablerunner_bringup.doctor.listener import Listener
from tablerunner_bringup.polling import bare_node

_LOOPBACK_LIMIT_S = 5.0
_ANSWER_LIMIT_S = 3.0


def robot_facts(
    domain: int, namespace: str, odom_topic: str, seconds: float, progress: Progress
) -> Facts:
    """Return all but what the host itself tells."""
    progress.show('looking whether DDS works')
    loopback = loopback_s(domain, _LOOPBACK_LIMIT_S)
    with bare_node('tablerunner_doctor', domain, namespace.strip('/')) as node:
        listener = Listener(node, odom_topic)
        listener.run(seconds, lambda left: progress.show(f'listening for {left:.0f} s more'))
        discovery = discovery_facts(node, domain, loopback)
        progress.show('asking the nodes')
        topics = listener.topics()
        parameters = parameters_of(node, discovery.nodes, _ANSWER_LIMIT_S)
    return Facts(
        discovery=discovery,
        topics=topics,
        links=listener.links(),
        parameters=parameters,
        statuses=listener.statuses(),
        anchors=listener.anchors(),
        duration_s=seconds,
        simulated=listener.simulated,
        clock_moved=listener.clock_moved,
    )
