"""Facts of a robot that works, each broken in one way: what is found, and that nothing else is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tablerunner.doctor import (
    CHECKS,
    AnchorFacts,
    DiscoveryFacts,
    EnvironmentFacts,
    Facts,
    Level,
    LinkFacts,
    SerialFacts,
    StatusFacts,
    TopicFacts,
    diagnose,
)
from tablerunner.doctor.settings import spread_m
from tablerunner.geometry.frame_tree import Link
from tablerunner.geometry.rotation import rotation_of_rpy

NODES = ('uwb_driver', 'odom_node', 'fusion_node', 'safety_stop', 'nav_controller')
ULTRASONICS = ('ultrasonic_left', 'ultrasonic_front')


def topic(type_, publisher, rate=50.0, **more):
    return TopicFacts(
        **{
            'types': (type_,),
            'publishers': (publisher,),
            'count': round(5 * rate),
            'rate_hz': rate,
            'silent_s': 0.01,
            'duration_s': 5.0,
            'age_s': 0.004,
            **more,
        }
    )


def link(parent, child, place=(0.0, 0.0, 0.0), static=True, age=0.02):
    return LinkFacts(Link(parent, child, rotation_of_rpy(0.0, 0.0, 0.0), place), static, age)


TOPICS = {
    'joint_states': topic(
        'sensor_msgs/msg/JointState',
        'broadcaster',
        names=('left_wheel_joint', 'right_wheel_joint', 'arm'),
    ),
    'imu/data': topic('sensor_msgs/msg/Imu', 'imu_driver', 100.0, frames=('imu_link',)),
    'uwb/ranges': topic(
        'tablerunner_interfaces/msg/UwbRange', 'uwb_driver', 40.0, frames=('uwb_tag',)
    ),
    'uwb/anchors': topic(
        'tablerunner_interfaces/msg/UwbAnchorArray',
        'uwb_driver',
        0.0,
        count=1,
        silent_s=4.0,
        age_s=float('nan'),
    ),
    'odom': topic('nav_msgs/msg/Odometry', 'odom_node'),
    'odometry/filtered': topic('nav_msgs/msg/Odometry', 'fusion_node'),
    'pose': topic('geometry_msgs/msg/PoseWithCovarianceStamped', 'fusion_node'),
    'cmd_vel': topic('geometry_msgs/msg/Twist', 'safety_stop', 20.0, age_s=float('nan')),
    'ultrasonic/left': topic('sensor_msgs/msg/Range', 'sonar', 6.0, frames=('ultrasonic_left',)),
    'ultrasonic/front': topic('sensor_msgs/msg/Range', 'sonar', 6.0, frames=('ultrasonic_front',)),
}
PARAMETERS = {
    'uwb_driver': {
        'use_sim_time': False,
        'anchor_ids': ('A0', 'A1', 'A2', 'A3'),
        'anchor_positions': (0, 0, 2.2, 8, 0, 2.2, 8, 5, 2.2, 0, 5, 2.2),
        'tag_height': 1.1,
    },
    'odom_node': {
        'use_sim_time': False,
        'left_joints': ('left_wheel_joint',),
        'right_joints': ('right_wheel_joint',),
        'heading_source': 'gyro',
    },
    'fusion_node': {'use_sim_time': False, 'tag_position': (-0.05, 0.0, 1.1)},
    'safety_stop': {'use_sim_time': False, 'ultrasonic_frames': ULTRASONICS},
    'nav_controller': {'use_sim_time': False},
}
GOOD = Facts(
    environment=EnvironmentFacts(middleware='rmw_fastrtps_cpp'),
    serial=(SerialFacts('/dev/ttyACM0', wanted=True, holders=('uwb_driver (7)',)),),
    discovery=DiscoveryFacts(0, 0.1, NODES),
    topics=TOPICS,
    links=(
        link('map', 'odom', static=False),
        link('odom', 'base_link', static=False),
        link('base_link', 'imu_link'),
        link('base_link', 'uwb_tag', (-0.05, 0.0, 1.1)),
        *(link('base_link', frame) for frame in ULTRASONICS),
    ),
    parameters=PARAMETERS,
    statuses=(StatusFacts('fusion_node', 0, 'tracking', {'state': 'tracking'}),),
    anchors={f'A{k}': AnchorFacts(50, 0.1) for k in range(4)},
)


def with_topic(name, **changes):
    return replace(GOOD, topics={**TOPICS, name: replace(TOPICS[name], **changes)})


def without_topic(name):
    return replace(GOOD, topics={key: item for key, item in TOPICS.items() if key != name})


def with_parameter(node, **changes):
    return replace(GOOD, parameters={**PARAMETERS, node: {**PARAMETERS[node], **changes}})


def with_environment(**changes):
    return replace(GOOD, environment=replace(GOOD.environment, **changes))


def with_discovery(**changes):
    return replace(GOOD, discovery=replace(GOOD.discovery, **changes))


def with_port(**changes):
    return replace(GOOD, serial=(replace(GOOD.serial[0], **changes),))


def with_variables(**variables):
    return with_environment(variables=variables)


def without_link(child):
    return replace(GOOD, links=tuple(item for item in GOOD.links if item.link.child != child))


def with_links(*links):
    return replace(GOOD, links=(*GOOD.links, *links))


def with_anchors(**anchors):
    heard = {**GOOD.anchors, **anchors}
    return replace(GOOD, anchors={name: item for name, item in heard.items() if item is not None})


def with_status(name, level, message, **values):
    return replace(GOOD, statuses=(*GOOD.statuses, StatusFacts(name, level, message, values)))


def state(word):
    facts = without_link('odom')
    return replace(
        facts, statuses=(StatusFacts('fusion_node', 1, f'{word} now', {'state': word}),)
    )


def test_good_robot_has_nothing_wrong():
    """Every check looked at something, and no finding has advice."""
    findings = diagnose(GOOD)
    assert {item.check for item in findings} == set(CHECKS)
    assert [item for item in findings if item.level is not Level.OK or item.advice] == []


BROKEN = {
    'old python': (with_environment(python=(3, 8, 2)), 'environment', 'python', '3.10'),
    'package': (
        with_environment(missing_packages=('tf2_msgs',)),
        'environment',
        'packages',
        'source env.sh',
    ),
    'program': (
        with_environment(missing_programs=('safety_stop',)),
        'environment',
        'programs',
        'source env.sh',
    ),
    'middleware': (
        with_environment(middleware='', variables={'RMW_IMPLEMENTATION': 'rmw_x'}),
        'environment',
        'middleware',
        'RMW_IMPLEMENTATION',
    ),
    'year': (with_environment(year=1970), 'environment', 'clock', 'NTP'),
    'domain': (with_variables(ROS_DOMAIN_ID='300'), 'environment', 'ROS_DOMAIN_ID', '101'),
    'discovery off': (
        with_variables(ROS_AUTOMATIC_DISCOVERY_RANGE='OFF'),
        'environment',
        'ROS_AUTOMATIC_DISCOVERY_RANGE',
        'unset',
    ),
    'discovery misspelt': (
        with_variables(ROS_AUTOMATIC_DISCOVERY_RANGE='localhost'),
        'environment',
        'ROS_AUTOMATIC_DISCOVERY_RANGE',
        'LOCALHOST',
    ),
    'localhost only': (
        with_variables(ROS_LOCALHOST_ONLY='1'),
        'environment',
        'ROS_LOCALHOST_ONLY',
        'unset',
    ),
    'loopback': (
        with_discovery(loopback_s=float('nan')),
        'discovery',
        'loopback',
        'multicast',
    ),
    'twice': (
        with_discovery(nodes=(*NODES, 'odom_node')),
        'discovery',
        'odom_node',
        'all but one',
    ),
    'port gone': (
        with_port(exists=False, accessible=False),
        'serial',
        '/dev/ttyACM0',
        'by-id',
    ),
    'port is a file': (with_port(is_device=False), 'serial', '/dev/ttyACM0', 'tty'),
    'port forbidden': (with_port(accessible=False), 'serial', '/dev/ttyACM0', '-aG dialout'),
    'port held twice': (
        with_port(holders=('uwb_driver (7)', 'minicom (9)')),
        'serial',
        '/dev/ttyACM0',
        'end all but',
    ),
    'node gone': (with_discovery(nodes=NODES[:-1]), 'nodes', 'nav_controller', 'start it'),
    'nobody publishes': (without_topic('imu/data'), 'topics', 'imu/data', 'remap'),
    'silent': (
        with_topic('imu/data', count=0, rate_hz=0.0, silent_s=float('nan'), age_s=float('nan')),
        'topics',
        'imu/data',
        'driver of the IMU',
    ),
    'fell silent': (with_topic('joint_states', silent_s=2.0), 'topics', 'joint_states', 'driver'),
    'slow': (with_topic('imu/data', rate_hz=5.0), 'topics', 'imu/data', 'faster'),
    'wrong type': (
        with_topic('odom', types=('std_msgs/msg/String',)),
        'topics',
        'odom',
        'another name',
    ),
    'two types': (
        with_topic('cmd_vel', types=('geometry_msgs/msg/Twist', 'geometry_msgs/msg/TwistStamped')),
        'topics',
        'cmd_vel',
        'nav_twist',
    ),
    'two publishers': (
        with_topic('odom', publishers=('odom_node', 'diff_drive_controller')),
        'topics',
        'odom',
        'enable_odom_tf',
    ),
    'quality': (
        with_topic('odom', mismatches=('fusion_node asks for reliable messages',)),
        'topics',
        'odom',
        'quality',
    ),
    'ultrasonic silent': (
        without_topic('ultrasonic/front'),
        'topics',
        'ultrasonic/front',
        'stands still',
    ),
    'ahead': (with_topic('imu/data', age_s=-0.3), 'clocks', 'imu/data', 'chrony'),
    'late': (with_topic('uwb/ranges', age_s=0.8), 'clocks', 'uwb/ranges', 'history'),
    'another time': (with_topic('imu/data', age_s=1.7e9), 'clocks', 'imu/data', 'since its start'),
    'zero stamps': (with_topic('joint_states', zero_stamps=9), 'clocks', 'joint_states', 'header'),
    'sim time alone': (
        with_parameter('odom_node', use_sim_time=True),
        'clocks',
        'odom_node',
        'false',
    ),
    'base_link missing': (
        without_link('base_link'),
        'frames',
        'odom -> base_link',
        'publish_tf',
    ),
    'aligning': (state('aligning'), 'frames', 'map -> odom', 'in a curve'),
    'waiting': (state('waiting'), 'frames', 'map -> odom', 'waiting now'),
    'stale': (
        replace(
            GOOD,
            links=(link('map', 'odom', static=False, age=3.0), *GOOD.links[1:]),
        ),
        'frames',
        'map -> odom',
        'silent',
    ),
    'two parents': (
        with_links(link('wheel_odom', 'base_link', static=False)),
        'frames',
        'base_link',
        'one parent',
    ),
    'sensor missing': (
        without_link('imu_link'),
        'frames',
        'base_link -> imu_link',
        'sensor_frames',
    ),
    'no frame': (
        with_topic('imu/data', frames=('',)),
        'frames',
        'base_link -> (no name)',
        'frame_id',
    ),
    'tag elsewhere': (
        with_parameter('fusion_node', tag_position=(0.05, 0.0, 1.1)),
        'frames',
        'uwb_tag',
        'measure once more',
    ),
    'two anchors': (
        with_parameter('uwb_driver', anchor_ids=('A0',), anchor_positions=(0.0, 0.0, 2.0)),
        'parameters',
        'anchor_ids',
        'survey-anchors',
    ),
    'in one line': (
        with_parameter(
            'uwb_driver', anchor_positions=(0, 0, 2.2, 8, 0.1, 2.2, 4, 0, 2.2, 2, 0, 2.2)
        ),
        'parameters',
        'anchor_positions',
        'aside',
    ),
    'two heights': (
        with_parameter('uwb_driver', tag_height=0.9),
        'parameters',
        'tag_height',
        'measure',
    ),
    'joint names': (
        with_parameter('odom_node', left_joints=('wheel_left',)),
        'parameters',
        'left_joints, right_joints',
        'as joint_states does',
    ),
    'anchor not heard': (with_anchors(A2=None), 'anchors', 'A2', 'power'),
    'anchor weak': (with_anchors(A2=AnchorFacts(5)), 'anchors', 'A2', 'antenna'),
    'anchor hidden': (with_anchors(A2=AnchorFacts(50, 0.95)), 'anchors', 'A2', 'above heads'),
    'anchor unknown': (with_anchors(A7=AnchorFacts(50)), 'anchors', 'A7', 'anchor_ids'),
    'anchor refused': (
        with_status('uwb_driver: uwb/exchanges', 0, 'ok', **{'refused: unknown anchor (B1)': '7'}),
        'anchors',
        'B1',
        'anchor_ids',
    ),
    'no anchor': (replace(GOOD, anchors={}), 'anchors', 'all', 'channel'),
    'status': (
        with_status('odom_node: imu/data', 2, 'silent for 3.0 s'),
        'diagnostics',
        'odom_node: imu/data',
        'section odom_node',
    ),
}


@pytest.mark.parametrize('name', BROKEN)
def test_broken_in_one_way_is_found_and_said(name):
    """The finding, what to do about it, and no other finding than its direct consequences."""
    facts, check, subject, advice = BROKEN[name]
    wrong = [item for item in diagnose(facts) if item.level is not Level.OK]
    found = [item for item in wrong if (item.check, item.subject) == (check, subject)]
    assert len(found) == 1, wrong
    assert advice in found[0].advice
    assert all(item.advice for item in wrong)
    others = {(item.check, item.subject) for item in wrong} - {(check, subject)}
    assert others <= CONSEQUENCES.get(name, set())


CONSEQUENCES = {
    'two parents': {('frames', 'map -> odom'), ('frames', 'odom -> base_link')},
    'two anchors': {('anchors', name) for name in ('A1', 'A2', 'A3')},
    'aligning': {('diagnostics', 'fusion_node')},
    'waiting': {('diagnostics', 'fusion_node')},
}


def test_no_node_at_all_is_one_finding():
    """Everything else that is missing is its consequence; where to look is said."""
    facts = Facts(environment=GOOD.environment, discovery=DiscoveryFacts(0, 0.1))
    wrong = [item for item in diagnose(facts) if item.level is not Level.OK]
    assert [(item.check, item.subject) for item in wrong] == [('discovery', 'domain 0')]
    assert 'start the robot' in wrong[0].advice
    elsewhere = replace(facts, discovery=DiscoveryFacts(0, 0.1, elsewhere=('/two/odom_node',)))
    assert '--namespace' in diagnose(elsewhere, ('topics',))[-1].advice
    spoken = replace(facts, discovery=DiscoveryFacts(0, 0.1, other_domains=(42,)))
    assert '--domain 42' in diagnose(spoken)[-1].advice


def test_localization_only_wants_nobody_who_drives():
    """No safety_stop, no ultrasonic sensors, no cmd_vel."""
    facts = replace(
        GOOD,
        localization_only=True,
        discovery=replace(GOOD.discovery, nodes=NODES[:3]),
        topics={name: item for name, item in TOPICS.items() if name[:3] not in ('cmd', 'ult')},
    )
    assert [item for item in diagnose(facts) if item.level is not Level.OK] == []


def test_odometry_of_the_base_replaces_odom_node_and_its_sensors():
    """diff_drive_controller's own: neither joint_states nor an IMU are wanted then."""
    left_out = ('joint_states', 'imu/data')
    topics = {name: item for name, item in TOPICS.items() if name not in left_out}
    topics['odom'] = replace(TOPICS['odom'], publishers=('diff_drive_controller',))
    nodes = tuple(name for name in NODES if name != 'odom_node')
    parameters = {name: item for name, item in PARAMETERS.items() if name != 'odom_node'}
    facts = replace(
        GOOD,
        topics=topics,
        discovery=replace(GOOD.discovery, nodes=nodes),
        parameters=parameters,
    )
    assert [item for item in diagnose(facts) if item.level is not Level.OK] == []


def test_simulated_robot_wants_sim_time_everywhere():
    """With a /clock a node on system time is named, and a clock that stands."""
    nodes = {name: {**item, 'use_sim_time': True} for name, item in PARAMETERS.items()}
    clock = topic('rosgraph_msgs/msg/Clock', 'sim_bridge', age_s=float('nan'))
    facts = replace(GOOD, simulated=True, parameters=nodes, topics={**TOPICS, 'clock': clock})
    assert [item for item in diagnose(facts) if item.level is not Level.OK] == []
    nodes['odom_node']['use_sim_time'] = False
    stands = replace(facts, clock_moved=False)
    wrong = [item.subject for item in diagnose(stands) if item.level is not Level.OK]
    assert wrong == ['clock', 'odom_node']


def test_spread_is_the_distance_from_the_best_line():
    """A square of side 2: every corner is 1 m from the middle line; a line has none."""
    assert spread_m((0, 0, 9, 2, 0, 9, 2, 2, 9, 0, 2, 9)) == pytest.approx(1.0)
    assert spread_m((0, 0, 1, 1, 1, 5, 3, 3, 2)) == pytest.approx(0.0, abs=1e-9)
    assert spread_m((1.0, 2.0, 3.0)) == 0.0
