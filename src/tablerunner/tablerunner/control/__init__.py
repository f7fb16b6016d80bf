"""Driving: planning, following a path, missions, and the safety stop; free of estimation."""

from tablerunner.control.battery import Battery, BatteryConfig
from tablerunner.control.blockades import BlockadeConfig
from tablerunner.control.braking import largest_speed, stopping_distance
from tablerunner.control.caution import CautionConfig
from tablerunner.control.controller import Controller, Drive
from tablerunner.control.delivery_queue import Delivery, DeliveryQueue
from tablerunner.control.delivery_store import DeliveryStore
from tablerunner.control.destination import Destination, MissionState, MissionStatus, Situation
from tablerunner.control.dispatcher import Dispatcher, DispatchStep, Ended
from tablerunner.control.floor_map import Disc, FloorMap
from tablerunner.control.follower import PurePursuit
from tablerunner.control.follower_config import FollowerConfig
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.mission import Mission
from tablerunner.control.mission_config import MissionConfig
from tablerunner.control.path import Path
from tablerunner.control.planner import Planner, PlannerConfig
from tablerunner.control.registry import (
    CONTROLLERS,
    ControllerSettings,
    configure_controller,
    make_controller,
)
from tablerunner.control.room import (
    floor_map,
    home_of,
    limits_within,
    make_planner,
    make_surroundings,
    sensor_mounts,
    table_stop,
)
from tablerunner.control.safety import (
    Localisation,
    SafetyDecision,
    SafetyState,
    SafetyStop,
)
from tablerunner.control.safety_config import SafetyConfig
from tablerunner.control.surroundings import Surroundings, SurroundingsConfig
from tablerunner.control.tour import Tour

__all__ = [
    'CONTROLLERS',
    'Battery',
    'BatteryConfig',
    'BlockadeConfig',
    'CautionConfig',
    'Controller',
    'ControllerSettings',
    'Delivery',
    'DeliveryQueue',
    'DeliveryStore',
    'Destination',
    'Disc',
    'DispatchStep',
    'Dispatcher',
    'Drive',
    'Ended',
    'FloorMap',
    'FollowerConfig',
    'Localisation',
    'Mission',
    'MissionConfig',
    'MissionState',
    'MissionStatus',
    'Path',
    'Planner',
    'PlannerConfig',
    'PurePursuit',
    'SafetyConfig',
    'SafetyDecision',
    'SafetyState',
    'SafetyStop',
    'Situation',
    'Surroundings',
    'SurroundingsConfig',
    'Tour',
    'VelocityLimits',
    'configure_controller',
    'floor_map',
    'home_of',
    'largest_speed',
    'limits_within',
    'make_controller',
    'make_planner',
    'make_surroundings',
    'sensor_mounts',
    'stopping_distance',
    'table_stop',
]
