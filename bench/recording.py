"""A bag of simulated raw data at the contract's rates, written without DDS."""

from __future__ import annotations

import math
from pathlib import Path

from tablerunner.bags.contract import CONTRACT
from tablerunner.bags.messages import exchange_message, imu_message, wheels_message
from tablerunner.bags.writer import BagWriter
from tablerunner.geometry.angles import wrap
from tablerunner.scenario import load_scenario
from tablerunner.simulation import Simulator
from tablerunner.types import ExchangeSample, ImuSample, Velocity, WheelSample

RESTAURANT = (
    Path(__file__).parents[1] / 'src' / 'tablerunner_bringup' / 'scenarios' / 'restaurant.yaml'
)
ROUTE = [(7.8, 11.0), (5.2, 10.9), (5.2, 1.2), (9.9, 1.2), (9.9, 10.9)]


def record(path: Path, duration_s: float, seed: int = 1) -> None:
    """Drive round the restaurant's tables and write what the sensors say."""
    simulator = Simulator(load_scenario(RESTAURANT), seed)
    target = 0
    with BagWriter(path) as bag:
        for topic in ('joint_states', 'imu/data', 'uwb/exchanges'):
            bag.add_topic(topic, CONTRACT[topic].msgtype, CONTRACT[topic].quality)
        for _ in range(round(duration_s * 100)):
            pose = simulator.truth.pose
            x, y = ROUTE[target]
            if math.hypot(x - pose.x, y - pose.y) < 0.2:
                target = (target + 1) % len(ROUTE)
            turn = wrap(math.atan2(y - pose.y, x - pose.x) - pose.heading)
            speed = 0.5 if abs(turn) < 0.4 else 0.0
            command = Velocity(speed, max(-1.0, min(1.0, 2.0 * turn)))
            for sample in simulator.step(command):
                if isinstance(sample, WheelSample):
                    message = wheels_message(sample, 'left_wheel_joint', 'right_wheel_joint')
                    bag.write('joint_states', sample.stamp, message)
                elif isinstance(sample, ImuSample):
                    bag.write('imu/data', sample.stamp, imu_message(sample, 'imu_link'))
                elif isinstance(sample, ExchangeSample):
                    bag.write('uwb/exchanges', sample.stamp, exchange_message(sample, 'uwb_tag'))
