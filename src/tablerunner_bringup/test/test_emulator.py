"""The emulated robot: its UWB module, its port, what its drivers publish, and driving by hand."""

from __future__ import annotations

import math
import os
import stat
import time
from pathlib import Path

import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState

from tablerunner.cli.main import main
from tablerunner.errors import ConfigError
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import load_scenario
from tablerunner.uwb.protocol import Dwm1001Shell
from tablerunner_bringup.doctor.host import serial_facts
from tablerunner_bringup.emulator.dwm1001 import PROMPT, Dwm1001
from tablerunner_bringup.emulator.robot import EmulatedRobot, address_of
from tablerunner_bringup.emulator.wire import Wire
from tablerunner_bringup.hand_driving import Log
from tablerunner_bringup.polling import bare_node
from tablerunner_ros.conversions.stamp import stamp_from_message
from tablerunner_ros.qos import qos_for
from tablerunner_ros.testing.fixtures import domain, probe
from tablerunner_ros.testing.probe import Probe

__all__ = ['domain', 'probe']

WORKSHOP = Path(__file__).parents[1] / 'scenarios' / 'workshop.yaml'
ANCHORS = {'DA00': (0.2, 0.2, 2.2), '022E': (8.0, 0.0, 2.5)}


def opened() -> Dwm1001:
    """Return a module in its shell, with a range of each anchor."""
    module = Dwm1001(ANCHORS)
    assert module.hear(b'\r\r', 0.0).endswith(PROMPT)
    module.measure('DA00', 3.456, 0.0)
    module.measure('022E', 7.1, 0.0)
    return module


def test_module_opens_by_two_returns_within_a_second() -> None:
    """One alone, or two that are too far apart, do nothing."""
    module = Dwm1001(ANCHORS)
    assert module.hear(b'\r', 0.0) == b''
    assert module.hear(b'\r', 1.5) == b''
    assert module.hear(b'\r', 2.0).endswith(PROMPT)


def test_module_says_lines_that_the_parser_reads() -> None:
    """`lec` begins them and ends them; each comes a tenth of a second after the last."""
    module = opened()
    assert module.tick(0.5) == b''
    assert module.hear(b'lec\r', 0.5) == b'lec\r\n' + PROMPT
    said = [module.tick(0.5 + 0.01 * step) for step in range(40)]
    parser = Dwm1001Shell()
    found = [item for line in said for item in parser.feed(line, 1).ranges]
    # The first line of a set of anchors is kept back by the parser: there is no position in it.
    ranges = {(item.anchor, item.range_m) for item in found}
    assert ranges == {('DA00', 3.46), ('022E', 7.1)}
    assert sum(line != b'' for line in said) == 4
    assert module.hear(b'\r', 1.0) == b'\r\n' + PROMPT  # a return alone repeats lec
    assert module.tick(2.0) == b''


def test_module_forgets_anchors_that_fell_silent() -> None:
    """A range of a second ago is none any more."""
    module = opened()
    module.hear(b'lec\r', 0.1)
    module.measure('022E', 7.2, 0.9)
    assert module.tick(1.2).startswith(b'DIST,1,AN0,022E,')
    assert module.tick(2.5) == b''


def test_module_answers_what_it_does_not_know() -> None:
    """And `quit` leaves the shell."""
    module = opened()
    assert b'unknown command' in module.hear(b'what\r', 0.1)
    assert b'upd_rate_norm=1' in module.hear(b'si\r', 0.1)
    module.hear(b'quit\r', 0.1)
    assert module.hear(b'si\r', 3.0) == b''


def test_addresses_are_names_that_look_like_one_or_are_given() -> None:
    """As uwb_driver's device_ids has to name them."""
    assert [address_of(name, 2) for name in ('022e', 'A2', 'north')] == ['022E', 'DA02', 'DA02']


def test_wire_is_a_serial_port_while_it_lasts(tmp_path: Path) -> None:
    """Bytes both ways; nothing is left behind, and nothing of others overwritten."""
    path = tmp_path / 'ports' / 'tag'
    with Wire(path) as wire:
        assert stat.S_ISCHR(path.stat().st_mode)
        port = os.open(path, os.O_RDWR | os.O_NOCTTY)
        os.write(port, b'lec\r')
        wire.write(b'DIST\r\n')
        assert os.read(port, 100) == b'DIST\r\n'
        assert wire.read() == b'lec\r'
        for _ in range(1000):
            wire.write(bytes(1000))  # nobody reads: lost, not waited for
        assert len(serial_facts([str(path)])[0].holders) == 1  # who opened it, twice not
        os.close(port)
        assert wire.read() == b''
        wire.write(b'unheard')
        again = os.open(path, os.O_RDWR | os.O_NOCTTY)
        os.write(again, b'si\r')
        assert wire.read() == b'si\r'
        os.close(again)
    assert not path.exists()
    path.write_text('mine')
    with pytest.raises(ConfigError, match='a path at which nothing is'), Wire(path):
        pass
    assert path.read_text() == 'mine'


def test_robot_speaks_as_drivers_do_and_obeys(probe: Probe, domain: int) -> None:
    """Host time, a gyroscope without orientation, reliable joint_states; it drives."""
    joints, imus = probe.listen(JointState, 'joint_states'), probe.listen(Imu, 'imu/data')
    truth = probe.listen(Odometry, 'ground_truth')
    with bare_node('base', domain) as node:
        robot = EmulatedRobot(node, load_scenario(WORKSHOP), 1)
        assert node.get_publishers_info_by_topic('/joint_states')[0].qos_profile.reliability == 1
        publisher = probe.node.create_publisher(Twist, 'cmd_vel', qos_for('cmd_vel'))

        def step() -> bool:
            robot.advance()
            command = Twist()
            command.linear.x = 0.3
            publisher.publish(command)
            return bool(truth and truth[-1].twist.twist.linear.x > 0.2)

        probe.wait_for(step, 'the robot to drive')
        probe.wait_for(lambda: bool(imus and joints), 'its sensors')
    assert imus[-1].orientation_covariance[0] == -1.0
    assert joints[-1].name == ['left_wheel_joint', 'right_wheel_joint']
    late_s = time.time() - 1e-9 * stamp_from_message(joints[-1].header.stamp)
    assert 0.0 <= late_s < 5.0
    assert robot.told.commands > 0
    assert math.isfinite(robot.truth.pose.x)


def test_drive_without_a_listener_or_beside_another_driver_is_refused(
    probe: Probe, domain: int, capsys, monkeypatch
) -> None:
    """Nothing is sent, and the reason is said."""
    monkeypatch.setattr('tablerunner_bringup.hand_driving._FIND_S', 0.5)
    command = ['drive', '--speed', '0.1', '--seconds', '0.1', '--domain', str(domain)]
    assert main(command) == 1
    assert 'nobody listens to /cmd_vel' in capsys.readouterr().err
    monkeypatch.setattr('tablerunner_bringup.hand_driving._FIND_S', 10.0)
    heard = probe.listen(Twist, 'cmd_vel')
    probe.speak(Twist, 'cmd_vel')
    assert main(command) == 1
    assert 'probe drives on /cmd_vel already' in capsys.readouterr().err
    assert heard == []


def test_log_adds_up_way_and_turns_over_the_end_of_the_circle() -> None:
    """A circle and a half to the left with radius 1 m, from a pose that is none."""
    log = Log()
    assert math.isnan(log.driven.forward_m)
    start = Pose2(3.0, -2.0, 2.5)
    steps = 300
    for step in range(steps + 1):
        angle = 3.0 * math.pi * step / steps
        log.take(start @ Pose2(math.sin(angle), 1.0 - math.cos(angle), angle))
        log.take(None)  # silent meanwhile
    assert log.way_m == pytest.approx(3.0 * math.pi, rel=1e-3)
    assert log.turn_rad == pytest.approx(3.0 * math.pi)
    assert (log.driven.forward_m, log.driven.left_m) == pytest.approx((0.0, 2.0), abs=1e-9)


def test_drive_too_fast_is_bad_input(capsys) -> None:
    """Half a metre a second is enough for hands."""
    assert main(['drive', '--speed', '2.0']) == 2
    assert '--speed' in capsys.readouterr().err
