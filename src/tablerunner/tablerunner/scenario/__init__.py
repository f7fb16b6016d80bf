"""The room as people describe it: walls, tables, anchors, people, the robot and its sensors.

`load_scenario` reads a YAML file into a `Scenario` and refuses, with file, line, field and value,
what cannot be.
"""

from tablerunner.scenario.anchor import AnchorPlace
from tablerunner.scenario.box import Box
from tablerunner.scenario.camera import Camera, Light
from tablerunner.scenario.kitchen import Kitchen
from tablerunner.scenario.member import Member, hue_of
from tablerunner.scenario.outline import Outline
from tablerunner.scenario.person import Person, PersonTag
from tablerunner.scenario.robot import (
    AnchorMount,
    DriveLimits,
    Marker,
    RobotGeometry,
    UltrasonicMount,
)
from tablerunner.scenario.scenario import Scenario, load_scenario
from tablerunner.scenario.sensors import (
    ImuErrors,
    MagneticErrors,
    SensorErrors,
    UltrasonicErrors,
    UwbErrors,
    WheelErrors,
)
from tablerunner.scenario.table import Table
from tablerunner.scenario.wall import Wall

__all__ = [
    'AnchorMount',
    'AnchorPlace',
    'Box',
    'Camera',
    'DriveLimits',
    'ImuErrors',
    'Kitchen',
    'Light',
    'MagneticErrors',
    'Marker',
    'Member',
    'Outline',
    'Person',
    'PersonTag',
    'RobotGeometry',
    'Scenario',
    'SensorErrors',
    'Table',
    'UltrasonicErrors',
    'UltrasonicMount',
    'UwbErrors',
    'Wall',
    'WheelErrors',
    'hue_of',
    'load_scenario',
]
