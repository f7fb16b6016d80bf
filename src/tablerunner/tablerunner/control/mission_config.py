"""How patient a mission is."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter


@dataclass(frozen=True)
class MissionConfig(Config):
    """How patient a mission is."""

    pose_timeout: float = parameter(
        1.0, description='Stand still when the pose is older', unit='s', above=0.0, dynamic=True
    )
    position_std_limit: float = parameter(
        0.8,
        description='Stand still when the position is less certain (standard deviation)',
        unit='m',
        above=0.0,
        dynamic=True,
    )
    heading_std_lost: float = parameter(
        0.6,
        description='The heading counts as unknown above this standard deviation',
        unit='rad',
        above=0.0,
        dynamic=True,
    )
    heading_std_found: float = parameter(
        0.2,
        description='Finding the heading ends at this standard deviation',
        unit='rad',
        above=0.0,
        dynamic=True,
    )
    align_after: float = parameter(
        2.0, description='Wait before driving to find the heading', unit='s', low=0.0, dynamic=True
    )
    align_speed: float = parameter(
        0.2, description='Speed while finding the heading', unit='m/s', above=0.0, dynamic=True
    )
    align_turn_rate: float = parameter(
        0.25, description='Turn rate while finding the heading', unit='rad/s', dynamic=True
    )
    localise_limit: float = parameter(
        120.0,
        description='Give the mission up when not localised for longer',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    blocked_after: float = parameter(
        2.5,
        description='No progress for longer counts as blocked',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    look_after: float = parameter(
        4.0,
        description='Blocked for longer: turn a little to both sides to look around',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    replan_after: float = parameter(
        9.0,
        description='Blocked for longer: look for a way around',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    give_up_after: float = parameter(
        240.0,
        description='Time blocked on the way to one stop, in all, until it is missed',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    mark_time: float = parameter(
        20.0,
        description='How long a place counts as blocked after a plan around it, the first time',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    stop_limit: float = parameter(
        600.0,
        description='Time for the way to one stop',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    tour_limit: float = parameter(
        320.0,
        description='Time for all ways of a tour, for each of its stops and home',
        unit='s',
        above=0.0,
        dynamic=True,
    )
    off_path: float = parameter(
        0.5, description='Plan anew when farther from the path', unit='m', above=0.0, dynamic=True
    )
    home_after_cancel: bool = parameter(
        False, description='Whether the robot goes home after a cancelled delivery', dynamic=True
    )
