"""A robot's own ROS parameter files as settings of a replay."""

from __future__ import annotations

import pytest

from tablerunner.bags.node_parameters import node_parameters, with_node_parameters
from tablerunner.bags.replay_config import ReplayConfig
from tablerunner.errors import ConfigError

ROBOT = """\
/**/uwb_driver:
  ros__parameters:
    anchor_ids: [A0, A1, A2]
    anchor_positions: [0, 0, 2.2, 8, 0, 2.2, 8, 5, 2.2]
    tag_height: 0.9
    serial.port: /dev/ttyACM0
/**/odom_node:
  ros__parameters:
    left_joints: [front_left, rear_left]
    right_joints: [front_right, rear_right]
    imu_tilt: [3.14159, 0.0]
    wheels.track: 0.5
    wheels: {wheel_radius: 0.1, wrap: 6.2832}
    silence: 2.0
fusion_node:
  ros__parameters: {tag_position: [0.1, 0.0, 0.9], filter: {huber: 2.0}, initial_pose: [1, 2, 0]}
/**/safety_stop:
  ros__parameters: {twist_stamped: true}
"""


def settings(tmp_path, *texts):
    files = []
    for index, text in enumerate(texts):
        files.append(tmp_path / f'{index}.yaml')
        files[-1].write_text(text, encoding='utf-8')
    return with_node_parameters(ReplayConfig(), files)


def test_parameters_reach_their_settings(tmp_path):
    """Dotted and nested names, lists, whole numbers; what is for others is passed over."""
    config = settings(tmp_path, ROBOT)
    assert config.ranger.anchor_ids == ('A0', 'A1', 'A2')
    assert config.ranger.anchor_positions[3:6] == (8.0, 0.0, 2.2)
    assert config.positioner.tag_height == 0.9
    wheels = config.odometer.wheels
    assert (wheels.track, wheels.wheel_radius, wheels.wrap) == (0.5, 0.1, 6.2832)
    assert config.left_joints == ('front_left', 'rear_left')
    assert config.imu_tilt == (3.14159, 0.0)
    assert config.localizer.tag_position == (0.1, 0.0, 0.9)
    assert config.localizer.filter.huber == 2.0
    assert config.localizer.initial_pose == (1.0, 2.0, 0.0)
    untouched = ReplayConfig()
    assert config.odometer.gyro == untouched.odometer.gyro
    assert config.localizer.health == untouched.localizer.health


def test_later_files_go_over_earlier_ones(tmp_path):
    """As of ROS: the last file wins, name by name; /** is for every node."""
    later = '/**:\n  ros__parameters:\n    wheels.track: 0.6\n'
    config = settings(tmp_path, ROBOT, later)
    assert (config.odometer.wheels.track, config.odometer.wheels.wheel_radius) == (0.6, 0.1)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('/**/odom_node:\n  ros__parameters: {wheels.track: -1.0}\n', r'wheels\.track.*-1'),
        ('/**/odom_node:\n  wheels.track: 1.0\n', 'ros__parameters with a mapping'),
        ('[1, 2]\n', 'nodes with ros__parameters'),
    ],
)
def test_bad_files_are_named(tmp_path, text, words):
    """File, parameter and value."""
    with pytest.raises(ConfigError, match=words) as caught:
        settings(tmp_path, text)
    assert '0.yaml' in str(caught.value)


@pytest.mark.parametrize('name', ['/two/odom_node', 'odom_node', '/**/odom_node', '/**', '/*'])
def test_nodes_are_known_by_their_last_name(name):
    """With or without namespace, and by wildcards."""
    data = {name: {'ros__parameters': {'a': {'b': 1}}}}
    assert node_parameters(data, 'odom_node', 'x') == {'a.b': 1}
    assert node_parameters({'other': data[name]}, 'odom_node', 'x') == {}
