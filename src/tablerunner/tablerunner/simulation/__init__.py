"""The simulated robot, its sensors and the people around it.

It has its own physics of ranging, driving and turning and imports nothing of uwb, odometry,
estimation or control: a mistake in those cannot hide behind the same mistake here. The equations
are in docs/simulation.md.
"""

from tablerunner.simulation.robot import SimulatedRobot
from tablerunner.simulation.sample import Sample
from tablerunner.simulation.simulator import Simulator
from tablerunner.simulation.team import START_NS, STEP_NS, Team, TeamStep
from tablerunner.simulation.truth import Contact, PersonState, RangeTruth, RobotState, Truth

__all__ = [
    'START_NS',
    'STEP_NS',
    'Contact',
    'PersonState',
    'RangeTruth',
    'RobotState',
    'Sample',
    'SimulatedRobot',
    'Simulator',
    'Team',
    'TeamStep',
    'Truth',
]
