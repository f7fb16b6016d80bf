"""What is wrong with a robot, told from plain facts: pure functions from facts to findings.

The facts are gathered by `tablerunner_bringup.doctor`, which knows ROS; nothing here does.
"""

from tablerunner.doctor.diagnose import CHECKS, diagnose
from tablerunner.doctor.facts import (
    AnchorFacts,
    DiscoveryFacts,
    EnvironmentFacts,
    Facts,
    LinkFacts,
    SerialFacts,
    StatusFacts,
    TopicFacts,
)
from tablerunner.doctor.finding import Finding, Level

__all__ = [
    'CHECKS',
    'AnchorFacts',
    'DiscoveryFacts',
    'EnvironmentFacts',
    'Facts',
    'Finding',
    'Level',
    'LinkFacts',
    'SerialFacts',
    'StatusFacts',
    'TopicFacts',
    'diagnose',
]
