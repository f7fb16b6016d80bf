"""Which nodes a run has: simulated or real, whole or localisation only, with whose odometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tf2_msgs.msg import TFMessage

from odom_node.frames_params import SensorFramesConfig
from sim_bridge.convert import mounts_to_transforms
from tablerunner.cli.main import main
from tablerunner.messages.transforms import links_from_message
from tablerunner.scenario import load_scenario
from tablerunner_bringup import parameters
from tablerunner_bringup.nodes import nodes_of
from tablerunner_bringup.run_options import RunOptions

SCENARIOS = Path(__file__).parents[1] / 'scenarios'
ROOM = load_scenario(SCENARIOS / 'restaurant.yaml')
LOCALISATION = ['uwb_driver', 'odom_node', 'fusion_node']
DRIVING = ['safety_stop', 'nav_controller']


@pytest.mark.parametrize(
    ('options', 'names'),
    [
        (RunOptions(), [*LOCALISATION, *DRIVING, 'sim_bridge']),
        (RunOptions(simulated=False), [*LOCALISATION, 'sensor_frames', *DRIVING]),
        (RunOptions(localization_only=True), [*LOCALISATION, 'sim_bridge']),
        (
            RunOptions(simulated=False, localization_only=True, robot_description=True),
            LOCALISATION,
        ),
        (
            RunOptions(simulated=False, localization_only=True, odom_topic='/base/odom'),
            ['uwb_driver', 'fusion_node', 'sensor_frames'],
        ),
    ],
)
def test_nodes_of_a_run(options, names):
    """Nobody drives where somebody else does, and each transform has one publisher."""
    assert [spec.name for spec in nodes_of(options, ROOM)] == names


def test_person_driver_belongs_to_driving():
    """Following a person is driving."""
    room = load_scenario(SCENARIOS / 'following.yaml')
    assert 'person_driver' in [spec.name for spec in nodes_of(RunOptions(), room)]
    options = RunOptions(localization_only=True)
    assert 'person_driver' not in [spec.name for spec in nodes_of(options, room)]


def test_odometry_of_somebody_else_reaches_all_who_listen():
    """By remapping; others keep theirs."""
    options = RunOptions(odom_topic='/diff_drive_controller/odom')
    remaps = {spec.name: spec.remap for spec in nodes_of(options, ROOM)}
    told = ('odom', '/diff_drive_controller/odom')
    assert remaps['fusion_node'] == remaps['nav_controller'] == (told,)
    assert remaps['sim_bridge'] == (('clock', '/clock'),)
    assert remaps['safety_stop'] == remaps['uwb_driver'] == ()


def test_sensor_frames_are_those_that_the_simulation_publishes():
    """One robot, two publishers of its frames, never at once: they must not differ."""
    told = parameters.sensor_frames(ROOM, RunOptions())
    config = SensorFramesConfig(frames=tuple(told['frames']), poses=tuple(told['poses']))
    simulated = mounts_to_transforms(ROOM.robot, 'base_link', 'imu_link', 'uwb_tag', 0)
    wanted = links_from_message(TFMessage(transforms=simulated))
    assert len(wanted) == len(config.links) == 7
    for one, other in zip(config.links, wanted, strict=True):
        assert (one.parent, one.child) == (other.parent, other.child)
        np.testing.assert_allclose(one.translation, other.translation, atol=1e-12)
        np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-12)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['--localization-only', '--deliver', 'table_1'], 'nobody drives then'),
        (['--remap', 'odom=/base/odom'], 'expected OLD:=NEW'),
    ],
)
def test_launch_options_that_contradict_are_bad_input(capsys, arguments, words):
    """Before anything is started."""
    assert main(['launch', *arguments]) == 2
    assert words in capsys.readouterr().err
