"""Parameters of following a person."""

from __future__ import annotations

from tablerunner.control.follow_config import FollowConfig, least_distance
from tablerunner.control.safety_config import SafetyConfig
from tablerunner.errors import ConfigError
from tablerunner.estimation.person_config import PersonLocatorConfig
from tablerunner.scenario import RobotGeometry

__all__ = ['FollowConfig', 'PersonLocatorConfig', 'check_follow', 'person_of']


def check_follow(config: FollowConfig) -> None:
    """Refuse a set distance at which the safety stop would hold the robot for the person."""
    least = least_distance(SafetyConfig(), config.person_radius)
    if config.distance < least:
        raise ConfigError(
            'follow.distance', config.distance, f'at least {least:.2f} m, for the safety stop'
        )


def person_of(config: PersonLocatorConfig, robot: RobotGeometry) -> PersonLocatorConfig:
    """Return the anchors that were given, or those of the scenario's robot where none were."""
    if config.anchor_ids or not robot.anchors:
        return config
    return config.replace(
        anchor_ids=tuple(anchor.id for anchor in robot.anchors),
        anchor_positions=tuple(value for anchor in robot.anchors for value in anchor.position),
    )
