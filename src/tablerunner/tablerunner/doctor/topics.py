"""Are the nodes up, do the topics live at their rates, and do the stamps fit the clock."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from tablerunner.doctor.facts import Facts, TopicFacts
from tablerunner.doctor.finding import Finding, error, ok, warning

NODES, TOPICS, CLOCKS = 'nodes', 'topics', 'clocks'

LOCALISATION = ('uwb_driver', 'odom_node', 'fusion_node')
DRIVING = ('safety_stop', 'nav_controller')

AHEAD_S = 0.1
"""Stamps may be ahead of the clock by so much: two machines that are kept in step."""

LATE_S = 0.5
"""Later measurements cost accuracy; after fusion_node's history, 1 s, they are refused."""

_ODD_S = 1e6
_PERIODS, _PATIENCE_S = 3.0, 0.5


@dataclass(frozen=True)
class Expected:
    """A topic that a working robot has.

    Attributes
    ----------
    name, type_ : str
    rate_hz : float
        Least rate; 0 for latched ones, of which one message is enough.
    node : str
        Of this stack, which publishes it; empty for drivers of the robot.
    advice : str
        What to do when nobody publishes it.
    """

    name: str
    type_: str
    rate_hz: float
    node: str = ''
    advice: str = ''


_LOCALISATION_TOPICS = (
    Expected(
        'joint_states',
        'sensor_msgs/msg/JointState',
        10.0,
        advice='start the driver of the wheels (joint_state_broadcaster), or remap its topic',
    ),
    Expected(
        'imu/data',
        'sensor_msgs/msg/Imu',
        20.0,
        advice='start the driver of the IMU, or remap its topic to imu/data; without an IMU set '
        'heading_source: wheels of odom_node',
    ),
    Expected(
        'uwb/ranges',
        'tablerunner_interfaces/msg/UwbRange',
        2.0,
        'uwb_driver',
        'look at the driver: its device and port, and the tag (powered, in ranging mode)',
    ),
    Expected(
        'uwb/anchors',
        'tablerunner_interfaces/msg/UwbAnchorArray',
        0.0,
        'uwb_driver',
        'uwb_driver says where the anchors hang; without it, publish it latched',
    ),
    Expected(
        'odom',
        'nav_msgs/msg/Odometry',
        10.0,
        'odom_node',
        'odom_node publishes one for each joint_states that it accepts: see its diagnostics',
    ),
    Expected(
        'odometry/filtered',
        'nav_msgs/msg/Odometry',
        10.0,
        'fusion_node',
        'fusion_node needs odom first, then ranges and anchors: see its diagnostics',
    ),
    Expected(
        'pose',
        'geometry_msgs/msg/PoseWithCovarianceStamped',
        10.0,
        'fusion_node',
        'as odometry/filtered',
    ),
)
_DRIVING_TOPICS = (
    Expected(
        'cmd_vel',
        '',
        5.0,
        'safety_stop',
        'safety_stop speaks twenty times a second, zeros too: is it running?',
    ),
)


def expected_topics(facts: Facts) -> tuple[Expected, ...]:
    """Return the topics that a robot must have, by what it is made of."""
    wheels = 'odom_node' in facts.discovery.nodes or not facts.topic('odom').publishers
    needed = [
        item
        for item in _LOCALISATION_TOPICS
        if wheels or item.name not in ('joint_states', 'imu/data')
    ]
    if facts.parameter('odom_node', 'heading_source', 'gyro') == 'wheels':
        needed = [item for item in needed if item.name != 'imu/data']
    if facts.localization_only:
        return tuple(needed)
    ultrasonics = facts.parameter('safety_stop', 'ultrasonic_frames', ())
    advice = 'start the driver of the ultrasonic sensors: safety_stop stands still without it'
    needed += [
        Expected(
            'ultrasonic/' + str(frame).removeprefix('ultrasonic_'),
            'sensor_msgs/msg/Range',
            2.0,
            advice=advice,
        )
        for frame in ultrasonics
    ]
    return (*needed, *_DRIVING_TOPICS)


def check_nodes(facts: Facts) -> Iterator[Finding]:
    """Yield whether the nodes of the stack run."""
    products = {'uwb_driver': 'uwb/ranges', 'odom_node': 'odom'}
    names = LOCALISATION if facts.localization_only else (*LOCALISATION, *DRIVING)
    for name in names:
        if name in facts.discovery.nodes:
            yield ok(NODES, name, 'runs')
            continue
        others = facts.topic(products.get(name, '')).publishers if name in products else ()
        if others:
            yield ok(NODES, name, f'does not run; {others[0]} publishes {products[name]}')
        else:
            yield error(
                NODES,
                name,
                'does not run',
                f'start it: tablerunner launch, or ros2 run; its log tells why it ended '
                f'(out/runs/.../logs/{name}.log)',
            )


def check_topics(facts: Facts) -> Iterator[Finding]:
    """Yield whether each topic that is needed lives."""
    own = next((item for item in facts.statuses if item.name == 'fusion_node'), None)
    searching = own is not None and own.values.get('state') in ('waiting', 'aligning')
    for item in expected_topics(facts):
        # Before the start is known fusion_node speaks as often as it has something to say.
        rare = searching and item.node == 'fusion_node'
        yield from _topic(replace(item, rate_hz=0.0) if rare else item, facts.topic(item.name))


def _topic(item: Expected, topic: TopicFacts) -> Iterator[Finding]:
    if len(topic.types) > 1:
        yield error(
            TOPICS,
            item.name,
            f'spoken of as {" and as ".join(topic.types)}',
            'publisher and subscriber need one type; for velocities: twist_stamped and nav_twist '
            'of safety_stop, twist_stamped of nav_controller',
        )
    elif item.type_ and topic.types and topic.types[0] != item.type_:
        yield error(
            TOPICS,
            item.name,
            f'is of type {topic.types[0]}, expected {item.type_}',
            'remap that publisher to another name',
        )
        return
    for words in topic.mismatches:
        advice = 'give the publisher the quality that the subscriber asks for (docs/nodes.md)'
        yield error(TOPICS, item.name, words, advice)
    if not topic.publishers:
        yield error(TOPICS, item.name, 'nobody publishes it', item.advice)
        return
    if item.node and len(topic.publishers) > 1:
        yield error(
            TOPICS,
            item.name,
            f'published by {", ".join(topic.publishers)}',
            'one publisher only: end the others or remap them (for odom: enable_odom_tf and odom '
            'of diff_drive_controller, docs/wiring.md)',
        )
    if not topic.count:
        yield error(
            TOPICS,
            item.name,
            f'silent for {topic.duration_s:.1f} s, although {topic.publishers[0]} publishes it',
            item.advice,
        )
    elif item.rate_hz and topic.silent_s > _PERIODS / item.rate_hz + _PATIENCE_S:
        yield error(TOPICS, item.name, f'silent for the last {topic.silent_s:.1f} s', item.advice)
    elif topic.rate_hz < item.rate_hz:
        yield warning(
            TOPICS,
            item.name,
            f'{topic.rate_hz:.1f} Hz, expected {item.rate_hz:g} Hz or more',
            f'let {topic.publishers[0]} publish faster, or look for a machine at its limit (top)',
        )
    else:
        words = f'{topic.rate_hz:.1f} Hz' if item.rate_hz else 'heard'
        yield ok(TOPICS, item.name, words)


def check_clocks(facts: Facts) -> Iterator[Finding]:
    """Yield whether stamps fit the clock that the robot goes by."""
    clock = facts.topic('clock')
    if facts.simulated and len(clock.publishers) > 1:
        names = ', '.join(clock.publishers)
        yield error(CLOCKS, 'clock', f'published by {names}', 'one /clock only: end the others')
    if facts.simulated and not facts.clock_moved:
        advice = 'is the simulation or the player paused? End what publishes /clock otherwise'
        yield error(CLOCKS, 'clock', '/clock stands still', advice)
    for node in sorted(facts.parameters):
        uses = bool(facts.parameter(node, 'use_sim_time', False))
        if uses and not facts.simulated:
            advice = 'use_sim_time: false on a real robot'
            yield error(CLOCKS, node, 'use_sim_time is true and there is no /clock', advice)
        elif facts.simulated and not uses and node != 'sim_bridge':
            advice = 'use_sim_time: true in simulation and with played bags'
            yield error(CLOCKS, node, 'there is a /clock and use_sim_time is false', advice)
    for name in sorted(facts.topics):
        yield from _stamps(name, facts.topics[name])


def _stamps(name: str, topic: TopicFacts) -> Iterator[Finding]:
    if topic.zero_stamps:
        yield error(
            CLOCKS,
            name,
            f'{topic.zero_stamps} of {topic.count} stamps are zero: they are refused',
            'let its driver fill header.stamp with the time of measurement',
        )
    if math.isnan(topic.age_s):
        return
    if abs(topic.age_s) > _ODD_S:
        yield error(
            CLOCKS,
            name,
            f'its stamps are {abs(topic.age_s):.0f} s off: another kind of time',
            'a driver that stamps with the time since its start, or simulated time beside real '
            'time: use_sim_time alike in all nodes',
        )
    elif topic.age_s < -AHEAD_S:
        yield error(
            CLOCKS,
            name,
            f'its stamps are {-topic.age_s:.2f} s ahead of the clock',
            'keep the clocks of both machines in step: chrony or PTP; a driver may also guess '
            'the time of its device wrongly',
        )
    elif topic.age_s > LATE_S:
        yield error(
            CLOCKS,
            name,
            f'its stamps are {topic.age_s:.2f} s old when they arrive',
            'keep the clocks of both machines in step (chrony, PTP), or look for a slow link or a '
            'machine at its limit; measurements older than history of fusion_node are refused',
        )
    elif not topic.zero_stamps:
        yield ok(CLOCKS, name, f'stamps arrive {1e3 * topic.age_s:.0f} ms after they were taken')
