"""From a scenario to ROS parameters."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tablerunner.config import Document, build
from tablerunner.errors import ConfigError
from tablerunner.estimation import LocalizerConfig
from tablerunner.odometry import OdometerConfig
from tablerunner.scenario import Scenario, load_scenario
from tablerunner.uwb import PositionerConfig, RangerConfig
from tablerunner.vision import LocatorConfig
from tablerunner_bringup import parameters
from tablerunner_bringup.nodes import COMMANDING, NODES, nodes_of, run_nodes
from tablerunner_bringup.parameter_files import CONFIGS
from tablerunner_bringup.parameters import flat
from tablerunner_bringup.run_options import RunOptions
from tablerunner_ros.parameters import fields_of

RESTAURANT = Path(__file__).parents[1] / 'scenarios' / 'restaurant.yaml'
BRASSERIE = RESTAURANT.with_name('brasserie.yaml')
ODD = """\
name: odd
start: [1, 2, 3]
anchors:
  - {id: north, position: [0, 4, 2]}
  - {id: south, position: [3, 0, 2]}
robot: {wheel_radius: 0.1, track: 0.4, tag_position: [0, 0, 1]}
"""


@pytest.fixture
def odd(tmp_path: Path) -> tuple[Scenario, RunOptions]:
    """Return a scenario in which whole numbers stand where lengths are meant."""
    path = tmp_path / 'odd.yaml'
    path.write_text(ODD, encoding='utf-8')
    return load_scenario(path), RunOptions(scenario=str(path), seed=7)


@pytest.mark.parametrize('spec', NODES, ids=lambda spec: spec.name)
def test_parameters_of_scenario_are_what_the_node_declares(spec, odd, tmp_path):
    """Each name is declared by the node, and its type survives the way through YAML."""
    scenario, options = odd
    file = tmp_path / 'node.yaml'
    parameters.write(file, spec.name, spec.parameters(scenario, options))
    told = yaml.safe_load(file.read_text(encoding='utf-8'))[f'/**/{spec.name}']['ros__parameters']
    assert told.pop('use_sim_time', True) is True
    known = {field.name: field.type_ for cls in CONFIGS[spec.name] for field in fields_of(cls)}
    wanted = {'DOUBLE': float, 'INTEGER': int, 'BOOL': bool, 'STRING': str}
    for name, value in told.items():
        kinds = {type(item) for item in (value if isinstance(value, list) else [value])}
        assert kinds == {wanted[known[name].name.removesuffix('_ARRAY')]}, name


def test_parameters_of_scenario_carry_its_values(odd):
    """Anchors, wheels, tag and start are those of the scenario."""
    scenario, options = odd
    driver = flat(parameters.uwb_driver(scenario, options))
    assert driver['anchor_ids'] == ['north', 'south']
    assert driver['anchor_positions'] == [0.0, 4.0, 2.0, 3.0, 0.0, 2.0]
    assert driver['tag_height'] == 1.0
    odometry = flat(parameters.odom_node(scenario, options))
    assert (odometry['wheels.wheel_radius'], odometry['wheels.track']) == (0.1, 0.4)
    fusion = flat(parameters.fusion_node(scenario, options))
    assert fusion['initial_pose'] == [1.0, 2.0, 3.0]
    assert fusion['tag_position'] == [0.0, 0.0, 1.0]
    assert flat(parameters.sim_bridge(scenario, options))['seed'] == 7


def test_parameters_of_restaurant_make_configs():
    """The core accepts them: no value is out of its bounds."""
    scenario, options = load_scenario(RESTAURANT), RunOptions(scenario=str(RESTAURANT))
    driver = parameters.uwb_driver(scenario, options)
    build(RangerConfig, Document({n: driver[n] for n in ('anchor_ids', 'anchor_positions')}))
    build(PositionerConfig, Document({'tag_height': driver['tag_height']}))
    odometry = parameters.odom_node(scenario, options)
    build(OdometerConfig, Document({'wheels': odometry['wheels']}))
    fusion = parameters.fusion_node(scenario, options)
    del fusion['use_sim_time']
    build(LocalizerConfig, Document(fusion))


def test_parameters_unknown_start_tells_no_pose(odd):
    """A robot that is to find itself is not told where it is."""
    scenario, options = odd
    found = parameters.fusion_node(scenario, options.replace(unknown_start=True))
    assert 'initial_pose' not in found


def test_parameters_real_robot_uses_system_time(odd):
    """Without a simulation there is no /clock to wait for, and no sim_bridge."""
    scenario, options = odd
    real = options.replace(simulated=False)
    specs = nodes_of(real, scenario)
    assert 'sim_bridge' not in {spec.name for spec in specs}
    assert COMMANDING in {spec.name for spec in specs}
    assert not any(spec.parameters(scenario, real)['use_sim_time'] for spec in specs)


CARRIED = """
people: [{name: host, route: [[5, 5]], tag: {id: host_tag, position: [-0.25, 0, 1]}}]
"""
RING = (
    'anchors: [{id: R0, position: [0, 1, 1]}, {id: R1, position: [1, 0, 1]}, '
    '{id: R2, position: [0, 0, 1]}]'
)


def test_parameters_robot_with_anchors_has_a_driver_for_them(tmp_path):
    """A second uwb_driver under names of its own, which knows only the anchors on the robot."""
    path = tmp_path / 'carried.yaml'
    path.write_text(ODD.replace('robot: {', 'robot: {' + RING + ', ') + CARRIED, encoding='utf-8')
    scenario, options = load_scenario(path), RunOptions(scenario=str(path))
    spec = nodes_of(options, scenario)[-1]
    assert (spec.name, spec.executable) == ('person_driver', 'uwb_driver')
    assert ('uwb/ranges', 'person/ranges') in spec.remap
    told = spec.parameters(scenario, options)
    assert told['anchor_ids'] == ['R0', 'R1', 'R2']
    assert told['map_frame'] == 'base_link'
    known = {field.name for cls in CONFIGS['uwb_driver'] for field in fields_of(cls)}
    assert set(told) - {'use_sim_time'} <= known
    build(RangerConfig, Document({n: told[n] for n in ('anchor_ids', 'anchor_positions')}))
    person = parameters.nav_controller(scenario, options)['person']
    assert person == {'tag_id': 'host_tag', 'tag_height': 1.0}
    assert all(
        item.name != 'person_driver' for item in nodes_of(options, load_scenario(RESTAURANT))
    )


def test_parameters_empty_list_is_left_out(tmp_path):
    """ROS cannot tell the type of an empty list in a file."""
    file = tmp_path / 'node.yaml'
    parameters.write(file, 'node', {'anchors': [], 'wheels': {'names': [], 'radius': 0.1}})
    told = yaml.safe_load(file.read_text(encoding='utf-8'))
    assert told == {'/**/node': {'ros__parameters': {'wheels.radius': 0.1}}}


def test_parameters_of_several_robots(tmp_path):
    """Each stack is told of its own start; the camera of all colours; the bridge how many."""
    scenario, options = load_scenario(BRASSERIE), RunOptions(scenario=str(BRASSERIE), robots=2)
    found = {node.label: node for node in run_nodes(options, scenario)}
    own = {'uwb_driver', 'odom_node', 'fusion_node', 'safety_stop', 'nav_controller'}
    assert set(found) == {'ceiling_camera', 'sim_bridge'} | {
        f'robot_{number}/{name}' for number in (1, 2) for name in own
    }
    for number, start in ((1, [1.0, 4.5, 0.0]), (2, [1.0, 3.3, 0.0])):
        fusion = found[f'robot_{number}/fusion_node']
        assert fusion.options.namespace == f'robot_{number}'
        assert fusion.parameters['initial_pose'] == start
        assert found[f'robot_{number}/nav_controller'].parameters['robot'] == f'robot_{number}'
    # Two tags share 10 rounds of the anchors a second: one round takes each 0.2 s.
    driver = found['robot_1/uwb_driver'].parameters
    assert driver['epoch'] == 0.3
    build(PositionerConfig, Document({'epoch': driver['epoch']}))
    camera = found['ceiling_camera']
    assert camera.options.namespace == ''
    assert camera.parameters['pose_topics'] == ['robot_1/camera/pose', 'robot_2/camera/pose']
    told = camera.parameters['marker']
    assert told['robots'] == ['robot_1', 'robot_2']
    # (235, 40, 140) and (30, 190, 60) by hand: 60 (6 - 100/195) and 60 (2 + 30/160).
    assert told['hues'] == [329.2, 131.2]
    assert told['heights'] == [1.15, 1.15]
    given = {
        name: value for name, value in camera.parameters.items() if name in {'mount', 'marker'}
    }
    build(LocatorConfig, Document(given))
    assert found['sim_bridge'].parameters['robots'] == 2
    for node in found.values():
        known = {f.name for cls in CONFIGS[node.spec.name] for f in fields_of(cls)}
        assert set(flat(node.parameters)) - {'use_sim_time'} <= known


def test_parameters_of_one_named_robot_keep_its_topic():
    """With --robots 1 the camera's pose is in the robot's namespace all the same."""
    scenario, options = load_scenario(BRASSERIE), RunOptions(scenario=str(BRASSERIE), robots=1)
    camera = next(n for n in run_nodes(options, scenario) if n.label == 'ceiling_camera')
    assert camera.parameters['pose_topics'] == ['robot_1/camera/pose']


def test_parameters_robots_stand_in_the_namespace_of_the_run():
    scenario = load_scenario(BRASSERIE)
    options = RunOptions(scenario=str(BRASSERIE), robots=3, namespace='hall')
    spaces = {node.label: node.options.namespace for node in run_nodes(options, scenario)}
    assert spaces['robot_3/odom_node'] == 'hall/robot_3'
    assert spaces['sim_bridge'] == spaces['ceiling_camera'] == 'hall'


def test_parameters_more_robots_than_there_are_is_refused():
    scenario = load_scenario(BRASSERIE)
    with pytest.raises(ConfigError, match='robots: got 4, expected at most 3'):
        run_nodes(RunOptions(scenario=str(BRASSERIE), robots=4), scenario)


def test_parameters_without_robots_are_those_of_one(odd):
    scenario, options = odd
    assert [node.label for node in run_nodes(options, scenario)] == [
        spec.name for spec in nodes_of(options, scenario)
    ]
    bistro = load_scenario(RESTAURANT.with_name('bistro.yaml'))
    told = parameters.ceiling_camera(bistro, options)
    assert told['marker']['robots'] == ['robot']
    assert 'pose_topics' not in told
    assert 'epoch' not in parameters.uwb_driver(bistro, options)
