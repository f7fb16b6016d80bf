"""`tablerunner doctor` over DDS: a robot of stand-ins, whole and with its parts broken."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu, JointState, Range
from tf2_msgs.msg import TFMessage

from tablerunner.cli.console import Progress
from tablerunner.cli.main import main
from tablerunner.doctor import Facts, Finding, Level, diagnose
from tablerunner.geometry.frame_tree import Link
from tablerunner.geometry.rotation import rotation_of_rpy
from tablerunner_bringup.doctor.host import environment_facts, serial_facts
from tablerunner_bringup.doctor.robot import robot_facts
from tablerunner_bringup.polling import never_called
from tablerunner_interfaces.msg import UwbAnchorArray, UwbRange
from tablerunner_ros.conversions.stamp import fill_stamp
from tablerunner_ros.qos import qos_for
from tablerunner_ros.testing.fixtures import domain, probe, processes
from tablerunner_ros.testing.probe import Probe
from tablerunner_ros.transforms import link_to_message

__all__ = ['domain', 'probe', 'processes']

ANCHORS = ('A0', 'A1', 'A2', 'A3')
LISTEN_S = 1.5
PARAMETERS: dict[str, dict[str, Any]] = {
    'uwb_driver': {
        'anchor_ids': list(ANCHORS),
        'anchor_positions': [0.0, 0.0, 2.2, 8.0, 0.0, 2.2, 8.0, 5.0, 2.2, 0.0, 5.0, 2.2],
        'tag_height': 1.1,
        'serial.port': '/dev/nothing_here',
    },
    'odom_node': {
        'left_joints': ['left'],
        'right_joints': ['right'],
        'heading_source': 'gyro',
    },
    'fusion_node': {
        'tag_position': [0.0, 0.0, 1.1],
        'map_frame': 'map',
        'odom_frame': 'odom',
        'base_frame': 'base_link',
    },
    'safety_stop': {'ultrasonic_frames': ['ultrasonic_front']},
    'nav_controller': {},
}


class Robot:
    """Nodes of a robot that say what real ones say; `change` spoils the stamped messages."""

    def __init__(self, probe: Probe, **parameters: dict[str, Any]) -> None:
        self.probe = probe
        self.nodes: dict[str, Node] = {}
        self.heard = list(ANCHORS)
        self.delays_s: dict[str, float] = {}
        for name, values in {**PARAMETERS, **parameters}.items():
            node = probe.host(Node, node_name=name)
            for key, value in values.items():
                node.declare_parameter(key, value)
            self.nodes[name] = node
        self.nodes['drivers'] = probe.host(Node, node_name='drivers')

    def publish(
        self,
        node: str,
        topic: str,
        make: Callable[[], Any],
        rate_hz: float,
        profile: QoSProfile | None = None,
    ) -> None:
        """Let a node publish; messages with a header get the stamp of now."""
        publisher = self.nodes[node].create_publisher(
            type(make()), topic, profile or qos_for(topic)
        )

        def tick() -> None:
            message = make()
            if hasattr(message, 'header') and not isinstance(message, DiagnosticArray):
                delay_ns = round(1e9 * self.delays_s.get(topic, 0.0))
                fill_stamp(message.header.stamp, time.time_ns() - delay_ns)
            publisher.publish(message)

        if rate_hz:
            self.nodes[node].create_timer(1.0 / rate_hz, tick)
        else:
            tick()

    def start(self, *without: str, **replaced: Callable[[], Any]) -> None:
        """Publish everything but some topics."""
        turn = iter(range(10**9))

        def a_range() -> UwbRange:
            message = UwbRange(anchor_id=self.heard[next(turn) % len(self.heard)])
            message.header.frame_id = 'uwb_tag'
            return message

        table: list[tuple[str, str, Callable[[], Any], float]] = [
            ('drivers', 'joint_states', lambda: JointState(name=['left', 'right']), 50.0),
            ('drivers', 'imu/data', lambda: framed(Imu(), 'imu_link'), 50.0),
            ('drivers', 'ultrasonic/front', lambda: framed(Range(), 'ultrasonic_front'), 6.0),
            ('uwb_driver', 'uwb/ranges', a_range, 40.0),
            ('uwb_driver', 'uwb/anchors', UwbAnchorArray, 0.0),
            ('odom_node', 'odom', Odometry, 50.0),
            ('odom_node', 'tf', lambda: moving('odom', 'base_link'), 20.0),
            ('fusion_node', 'odometry/filtered', Odometry, 50.0),
            ('fusion_node', 'pose', PoseWithCovarianceStamped, 50.0),
            ('safety_stop', 'cmd_vel', Twist, 20.0),
            ('fusion_node', 'diagnostics', lambda: status('fusion_node', b'\x00', 'ok'), 5.0),
        ]
        for node, topic, make, rate in table:
            if topic not in without:
                self.publish(node, topic, replaced.get(topic, make), rate)
        sensors = [
            link_to_message(Link('base_link', frame, rotation_of_rpy(0.0, 0.0, 0.0), place))
            for frame, place in (
                ('imu_link', (0.0, 0.0, 0.1)),
                ('uwb_tag', (0.0, 0.0, 1.1)),
                ('ultrasonic_front', (0.2, 0.0, 0.3)),
            )
        ]
        self.publish('drivers', 'tf_static', lambda: TFMessage(transforms=sensors), 0.0)

    def locate(self) -> None:
        """Publish map to odom."""
        self.publish('fusion_node', 'tf', lambda: moving('map', 'odom'), 20.0)

    def examine(self, domain: int) -> tuple[Facts, dict[tuple[str, str], Finding]]:
        """Return the facts, and what is wrong by check and subject."""
        facts: list[Facts] = []

        def look() -> None:
            facts.append(robot_facts(domain, '', 'odom', LISTEN_S, Progress()))

        thread = threading.Thread(target=look, daemon=True)
        thread.start()
        self.probe.wait_for(lambda: not thread.is_alive(), 'the doctor', 30.0)
        whole = facts[0].with_host(environment_facts(), (), False)
        # On a machine without time to spare this robot speaks slowly; test_diagnose has that.
        slow = [item for item in diagnose(whole) if 'Hz, expected' not in item.words]
        return whole, wrong(tuple(slow))


def wrong(findings: tuple[Finding, ...]) -> dict[tuple[str, str], Finding]:
    """Return what is not as it should be, by check and subject."""
    return {(item.check, item.subject): item for item in findings if item.level is not Level.OK}


def framed(message: Any, frame: str) -> Any:
    """Return a message with a frame."""
    message.header.frame_id = frame
    return message


def moving(parent: str, child: str) -> TFMessage:
    """Return a transform of now."""
    link = Link(parent, child, rotation_of_rpy(0.0, 0.0, 0.0))
    return TFMessage(transforms=[link_to_message(link, time.time_ns())])


def status(name: str, level: bytes, message: str) -> DiagnosticArray:
    """Return a report of one status."""
    return DiagnosticArray(status=[DiagnosticStatus(name=name, level=level, message=message)])


def test_doctor_finds_nothing_wrong_with_a_whole_robot(probe: Probe, domain: int) -> None:
    """Rates, stamps, frames, parameters and anchors as they are; the serial port is asked for."""
    robot = Robot(probe)
    robot.start()
    robot.locate()
    facts, faults = robot.examine(domain)
    assert faults == {}
    assert 0.0 < facts.topic('joint_states').rate_hz < 60.0  # 50 on a machine with time to spare
    assert facts.topic('uwb/anchors').count == 1
    assert abs(facts.topic('imu/data').age_s) < 0.1
    assert facts.parameter('uwb_driver', 'serial.port', '') == '/dev/nothing_here'
    assert set(facts.anchors) == set(ANCHORS)


def test_doctor_finds_what_is_broken(probe: Probe, domain: int) -> None:
    """An anchor dark, a clock off, a topic silent, no map to odom, a tag moved, an error told."""
    robot = Robot(
        probe, fusion_node={**PARAMETERS['fusion_node'], 'tag_position': [0.3, 0.0, 1.1]}
    )
    robot.heard = ['A0', 'A1', 'A3', 'A9']
    robot.delays_s = {'imu/data': -2.0, 'uwb/ranges': 1.5}
    robot.start(
        'joint_states',
        diagnostics=lambda: status('fusion_node', b'\x01', 'heading unknown: drive'),
    )
    # Somebody publishes it, but has nothing to say; and somebody else wants it reliable.
    robot.nodes['drivers'].create_publisher(JointState, 'joint_states', qos_for('joint_states'))
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    robot.publish('drivers', 'odom', Odometry, 20.0, best_effort)
    robot.nodes['fusion_node'].create_subscription(Odometry, 'odom', never_called, qos_for('odom'))
    base = Probe(domain, 'base')  # one participant cannot have a topic under two types
    base.node.create_subscription(TwistStamped, 'cmd_vel', never_called, qos_for('cmd_vel'))
    _, faults = robot.examine(domain)
    base.close()
    assert set(faults) == {
        ('topics', 'joint_states'),
        ('topics', 'odom'),
        ('topics', 'cmd_vel'),
        ('clocks', 'imu/data'),
        ('clocks', 'uwb/ranges'),
        ('frames', 'map -> odom'),
        ('frames', 'uwb_tag'),
        ('anchors', 'A2'),
        ('anchors', 'A9'),
        ('diagnostics', 'fusion_node'),
    }
    assert 'silent' in faults['topics', 'joint_states'].words
    assert '2.00 s ahead' in faults['clocks', 'imu/data'].words
    assert '1.5' in faults['clocks', 'uwb/ranges'].words
    assert 'TwistStamped' in faults['topics', 'cmd_vel'].words
    assert 'heading unknown' in faults['diagnostics', 'fusion_node'].words


def test_doctor_command_of_a_silent_domain(domain: int, tmp_path, capsys, monkeypatch) -> None:
    """One error, what to do, exit code 1, and all of it in the JSON file."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    file = tmp_path / 'doctor.json'
    assert main(['doctor', '--seconds', '0.5', '--faults', '--json', str(file)]) == 1
    shown = capsys.readouterr().out
    assert f'domain {domain}: no node' in shown
    assert '-> ' in shown  # where else somebody speaks, or how to start
    findings = json.loads(file.read_text())['findings']
    assert [item['subject'] for item in findings if item['level'] == 'error'] == [
        f'domain {domain}'
    ]


def test_doctor_before_anything_runs(capsys, monkeypatch) -> None:
    """Machine and port only; a port that is there is right, one that is not is an error."""
    monkeypatch.delenv('ROS_LOCALHOST_ONLY', raising=False)
    monkeypatch.setenv('ROS_DOMAIN_ID', '7')
    monkeypatch.setattr('tablerunner_bringup.doctor.host.PORTS', ())  # not those of this machine
    main_end, other_end = os.openpty()
    try:
        arguments = ['doctor', '--check', 'environment', '--check', 'serial', '--port']
        path = os.ttyname(other_end)
        assert main([*arguments, path]) == 0
        assert f'{path}: can be used, open in python' in capsys.readouterr().out
        assert main([*arguments, '/dev/ttyUSB_none']) == 1
        assert '/dev/ttyUSB_none: is not there' in capsys.readouterr().out
    finally:
        os.close(main_end)
        os.close(other_end)


def test_doctor_unknown_check_is_bad_input(capsys) -> None:
    """The checks there are, are said."""
    assert main(['doctor', '--check', 'weather']) == 2
    assert 'environment, serial, discovery' in capsys.readouterr().err


def test_serial_facts_of_a_file_and_of_one_that_others_keep(tmp_path) -> None:
    """A path that is no device; a port asked for comes before those that are found."""
    file = tmp_path / 'port'
    file.write_text('')
    (found, *_) = serial_facts([str(file)])
    assert (found.exists, found.is_device, found.wanted) == (True, False, True)
    file.chmod(0)
    if os.getuid():  # root may read everything
        assert not serial_facts([str(file)])[0].accessible
