"""The nodes of a run: the one list that launcher and launch file are made from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from tablerunner.scenario import Scenario
from tablerunner_bringup import parameters
from tablerunner_bringup.run_options import RunOptions


@dataclass(frozen=True)
class NodeSpec:
    """One node: where its program is, what it is called, how a run becomes its parameters.

    `drives` marks what is not started where only localisation is wanted.
    """

    name: str
    package: str
    executable: str
    parameters: Callable[[Scenario, RunOptions], dict[str, Any]]
    simulation_only: bool = False
    hardware_only: bool = False
    drives: bool = False
    needed: Callable[[Scenario], bool] = lambda scenario: True
    remap: tuple[tuple[str, str], ...] = ()


NODES: tuple[NodeSpec, ...] = (
    NodeSpec('uwb_driver', 'uwb_driver', 'uwb_driver', parameters.uwb_driver),
    NodeSpec('odom_node', 'odom_node', 'odom_node', parameters.odom_node),
    NodeSpec(
        'ceiling_camera',
        'ceiling_camera',
        'ceiling_camera',
        parameters.ceiling_camera,
        needed=lambda scenario: scenario.camera is not None,
    ),
    NodeSpec('fusion_node', 'fusion_node', 'fusion_node', parameters.fusion_node),
    NodeSpec(
        'sensor_frames',
        'odom_node',
        'sensor_frames',
        parameters.sensor_frames,
        hardware_only=True,  # sim_bridge publishes those of the simulated robot
    ),
    NodeSpec('safety_stop', 'nav_controller', 'safety_stop', parameters.safety_stop, drives=True),
    NodeSpec(
        'nav_controller',
        'nav_controller',
        'nav_controller',
        parameters.nav_controller,
        drives=True,
    ),
    NodeSpec(
        'sim_bridge',
        'sim_bridge',
        'sim_bridge',
        parameters.sim_bridge,
        simulation_only=True,
        # In a namespace too: every node of ROS listens to the clock there and nowhere else.
        remap=(('clock', '/clock'),),
    ),
)
"""All nodes; they may be started in any order, and side by side."""

PERSON_DRIVER = NodeSpec(
    'person_driver',
    'uwb_driver',
    'uwb_driver',
    parameters.person_driver,
    remap=tuple(
        (f'uwb/{name}', f'person/{name}') for name in ('exchanges', 'ranges', 'anchors', 'pose')
    ),
    needed=lambda scenario: bool(scenario.robot.anchors),
    drives=True,
)
"""uwb_driver once more, for the anchors that a robot carries and the tags that people wear."""

COMMANDING = 'nav_controller'
"""The node whose end takes the command away: the safety stop behind it goes to zero on silence."""


ODOM_LISTENERS = ('fusion_node', 'nav_controller')
"""The nodes that hear of wheel odometry."""


def nodes_of(options: RunOptions, scenario: Scenario) -> tuple[NodeSpec, ...]:
    """Return the nodes of a run: on a real robot none that simulates, and what the room needs.

    With an odometry of somebody else there is no odom_node, and who listens to odom hears that.
    """
    return tuple(
        _rewired(spec, options)
        for spec in (*NODES, PERSON_DRIVER)
        if _wanted(spec, options) and spec.needed(scenario)
    )


def _wanted(spec: NodeSpec, options: RunOptions) -> bool:
    if spec.simulation_only and not options.simulated:
        return False
    if spec.hardware_only and (options.simulated or options.robot_description):
        return False
    if spec.name == 'odom_node' and options.odom_topic:
        return False
    return not (spec.drives and options.localization_only)


def _rewired(spec: NodeSpec, options: RunOptions) -> NodeSpec:
    if not options.odom_topic or spec.name not in ODOM_LISTENERS:
        return spec
    return replace(spec, remap=(*spec.remap, ('odom', options.odom_topic)))
