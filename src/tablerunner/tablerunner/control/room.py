"""What control takes from a scenario: the floor, the limits, the sensors, the stops."""

from __future__ import annotations

from tablerunner.control.destination import Destination
from tablerunner.control.floor_map import FloorMap
from tablerunner.control.fuzzy.readings import FRAMES
from tablerunner.control.limits import VelocityLimits
from tablerunner.control.planner import Planner, PlannerConfig
from tablerunner.control.surroundings import Surroundings, SurroundingsConfig
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import DriveLimits, RobotGeometry, Scenario


def floor_map(scenario: Scenario, resolution: float = 0.05) -> FloorMap:
    """Return the floor of a room as its map has it; people are not on it."""
    known = scenario.mapped
    solids = tuple(outline.corners for outline in known.outlines if outline.is_solid)
    return FloorMap.build(known.obstacle_segments(), solids, (), resolution)


def make_planner(scenario: Scenario, config: PlannerConfig | None = None) -> Planner:
    """Return a planner for a room and its robot."""
    chosen = PlannerConfig() if config is None else config
    floor = floor_map(scenario, chosen.resolution)
    return Planner(floor, scenario.robot.footprint_radius, chosen)


def make_surroundings(
    scenario: Scenario,
    planner: Planner,
    config: SurroundingsConfig | None = None,
    frames: tuple[str, ...] = FRAMES,
) -> Surroundings | None:
    """Return an empty memory of what is not on the map; None without the five sensors."""
    mounts = sensor_mounts(scenario.robot)
    if any(frame not in mounts for frame in frames):
        return None
    return Surroundings(planner.floor, tuple(mounts[frame] for frame in frames), config)


def limits_within(limits: VelocityLimits, base: DriveLimits) -> VelocityLimits:
    """Return `limits`, none of them beyond what the base can do."""
    return VelocityLimits(
        max_speed=min(limits.max_speed, base.speed),
        max_reverse_speed=min(limits.max_reverse_speed, base.reverse_speed),
        max_acceleration=min(limits.max_acceleration, base.acceleration),
        max_deceleration=min(limits.max_deceleration, base.deceleration),
        max_turn_rate=min(limits.max_turn_rate, base.turn_rate),
        max_turn_acceleration=min(limits.max_turn_acceleration, base.turn_acceleration),
    )


def sensor_mounts(robot: RobotGeometry) -> dict[str, Pose2]:
    """Return the pose of each ultrasonic sensor in base_link by frame."""
    return {mount.frame: mount.pose for mount in robot.ultrasonics}


def table_stop(scenario: Scenario, name: str, wait_s: float = 0.0) -> Destination:
    """Return the stop of a table (or of the kitchen) by name.

    Raises
    ------
    ConfigError
        There is no such place; the message lists those there are.
    """
    return Destination(name, scenario.stop_pose(name), wait_s)


def home_of(scenario: Scenario) -> Destination:
    """Return where the robot lives: the kitchen, or where it starts when there is none."""
    if scenario.kitchen is not None:
        return Destination(scenario.kitchen.name, scenario.kitchen.stop_pose)
    return Destination('home', scenario.start_pose)
