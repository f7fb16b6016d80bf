"""The simulated robot, its sensors and the people around it.

It has its own physics of ranging, driving and turning and imports nothing of uwb, odometry,
estimation or control: a mistake in those cannot hide behind the same mistake here. The equations
are in docs/simulation.md.
"""

from tablerunner.simulation.simulator import START_NS, STEP_NS, Sample, Simulator
from tablerunner.simulation.truth import Contact, PersonState, RangeTruth, Truth

__all__ = [
    'START_NS',
    'STEP_NS',
    'Contact',
    'PersonState',
    'RangeTruth',
    'Sample',
    'Simulator',
    'Truth',
]
