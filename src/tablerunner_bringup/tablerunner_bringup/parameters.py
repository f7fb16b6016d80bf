"""From a scenario to the parameters of each node: the only place where that is done.

What a node's Config has a default for and the scenario says nothing of is left to that default.
"""

from __future__ import annotations

import colorsys
from pathlib import Path
from typing import Any

import yaml

from tablerunner.scenario import PersonTag, Scenario
from tablerunner_bringup.run_options import RunOptions

Parameters = dict[str, Any]


def uwb_driver(scenario: Scenario, options: RunOptions) -> Parameters:
    """Return where the anchors hang."""
    return {
        **_common(options),
        'anchor_ids': [anchor.id for anchor in scenario.anchors],
        'anchor_positions': [
            float(number) for anchor in scenario.anchors for number in anchor.position
        ],
        'tag_height': float(scenario.robot.tag_position[2]),
    }


def person_driver(scenario: Scenario, options: RunOptions) -> Parameters:
    """Return where the anchors sit on the robot, and how high the person's tag hangs."""
    tag = worn_tag(scenario)
    return {
        **_common(options),
        'map_frame': 'base_link',
        'tag_frame': 'person_tag' if tag is None else tag.id,
        'anchor_ids': [anchor.id for anchor in scenario.robot.anchors],
        'anchor_positions': [
            float(number) for anchor in scenario.robot.anchors for number in anchor.position
        ],
        **({} if tag is None else {'tag_height': float(tag.position[2])}),
    }


def worn_tag(scenario: Scenario) -> PersonTag | None:
    """Return the tag of who is to be followed: the first who wears one."""
    return next((person.tag for person in scenario.people if person.tag is not None), None)


def odom_node(scenario: Scenario, options: RunOptions) -> Parameters:
    """Return the geometry of the drive."""
    return {
        **_common(options),
        'wheels': {
            'wheel_radius': float(scenario.robot.wheel_radius),
            'track': float(scenario.robot.track),
        },
    }


def sensor_frames(scenario: Scenario, options: RunOptions) -> Parameters:
    """Return where the sensors sit on the robot: no URDF says it, the scenario does."""
    robot = scenario.robot
    poses = {
        'imu_link': (*robot.imu_position, 0.0, 0.0, 0.0),
        'uwb_tag': (*robot.tag_position, 0.0, 0.0, 0.0),
    }
    for mount in robot.ultrasonics:
        place = (mount.x, mount.y, robot.ultrasonic_height)
        poses[mount.frame] = (*place, 0.0, 0.0, mount.heading)
    return {
        **_common(options),
        'frames': list(poses),
        'poses': [float(number) for pose in poses.values() for number in pose],
    }


def ceiling_camera(scenario: Scenario, options: RunOptions) -> Parameters:
    """Return where the camera was measured to hang, and the marker that the robot wears."""
    told: Parameters = _common(options)
    camera, marker = scenario.camera, scenario.robot.marker
    if camera is not None:
        told['mount'] = {
            'position': [float(number) for number in camera.position],
            'yaw': float(camera.yaw),
            'tilt': [float(number) for number in camera.tilt],
        }
    if marker is not None:
        red, green, blue = (number / 255.0 for number in marker.colour)
        told['marker'] = {
            'robots': ['robot'],
            'hues': [round(360.0 * colorsys.rgb_to_hsv(red, green, blue)[0], 1)],
            'heights': [float(marker.height)],
            'disc_x': float(marker.disc_x),
            'disc_radius': float(marker.disc_radius),
            'front_x': float(marker.front_x),
            'front_radius': float(marker.front_radius),
        }
    return told


def fusion_node(scenario: Scenario, options: RunOptions) -> Parameters:
    """Return the tag's place and, unless it is to be found, where the robot starts."""
    parameters = {
        **_common(options),
        'estimator': options.estimator,
        'tag_position': [float(number) for number in scenario.robot.tag_position],
    }
    if not options.unknown_start:
        start = scenario.start_pose
        parameters['initial_pose'] = [float(start.x), float(start.y), float(start.heading)]
    return parameters


def nav_controller(scenario: Scenario, options: RunOptions) -> Parameters:
    """Return the map, which the node reads from the scenario itself, and whom it may follow."""
    parameters: Parameters = {**_common(options), 'scenario': _path(options)}
    tag = worn_tag(scenario)
    if tag is not None:
        parameters['person'] = {'tag_id': tag.id, 'tag_height': float(tag.position[2])}
    return parameters


def safety_stop(_scenario: Scenario, options: RunOptions) -> Parameters:
    """Return the robot's body, which the node reads from the scenario itself."""
    return {**_common(options), 'scenario': _path(options)}


def sim_bridge(_scenario: Scenario, options: RunOptions) -> Parameters:
    """Return the room, the seed and the speed of simulated time."""
    return {
        'scenario': _path(options),
        'seed': int(options.seed),
        'real_time_factor': float(options.real_time_factor),
    }


def _common(options: RunOptions) -> Parameters:
    return {'use_sim_time': options.simulated}


def _path(options: RunOptions) -> str:
    # A node has a working directory of its own choosing.
    return str(options.scenario_path.resolve())


def write(path: Path, node: str, parameters: Parameters) -> None:
    """Write a ROS parameter file for one node, in whatever namespace it runs.

    Empty lists are left out: ROS cannot tell their type, and no node needs to be told of them.
    """
    told = flat(parameters)
    text = yaml.safe_dump({f'/**/{node}': {'ros__parameters': told}}, sort_keys=False)
    path.write_text(text, encoding='utf-8')


def flat(parameters: Parameters, prefix: str = '') -> Parameters:
    """Return parameters by their full dotted names, as ROS knows them, without empty lists."""
    found: Parameters = {}
    for name, value in parameters.items():
        if isinstance(value, dict):
            found.update(flat(value, f'{prefix}{name}.'))
        elif value != []:
            found[f'{prefix}{name}'] = value
    return found
