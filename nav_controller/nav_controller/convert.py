"""Messages of nav_controller and records of the core; pure."""

from __future__ import annotations

import math
from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from nav_msgs.msg import Path as PathMessage

from tablerunner.control import (
    Destination,
    Localisation,
    MissionState,
    MissionStatus,
    Path,
    SafetyDecision,
    SafetyState,
    Situation,
    Tour,
    table_stop,
)
from tablerunner.errors import ConfigError, MissionError
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.types import Matrix, OdometrySample, Refusal
from tablerunner_interfaces.action import Deliver
from tablerunner_ros.conversions.pose import goal_from_message, goal_to_message, path_to_message

_LEVELS = {
    SafetyState.CLEAR: DiagnosticStatus.OK,
    SafetyState.SLOW: DiagnosticStatus.WARN,
    SafetyState.STOP: DiagnosticStatus.ERROR,
}
_PLAN_SPACING_M = 0.1


def destinations_from_goal(
    goal: Deliver.Goal, scenario: Scenario, frame: str
) -> tuple[Destination, ...]:
    """Return the stops of a delivery.

    Raises
    ------
    MissionError
        A table is not known or a pose is not usable; which stop and why.
    """
    stops = []
    for number, stop in enumerate(goal.stops, start=1):
        if stop.table:
            try:
                place = table_stop(scenario, stop.table, stop.wait)
                stops.append(replace(place, confirm_s=stop.confirm_within))
            except ConfigError as error:
                raise MissionError(
                    f'stop {number}: no table {stop.table!r}; known are {error.expected}'
                ) from None
            continue
        pose = goal_from_message(stop.pose, frame, 'deliver')
        if isinstance(pose, Refusal):
            raise MissionError(f'stop {number}: {pose.reason}')
        stops.append(Destination(f'stop {number}', pose, stop.wait, stop.confirm_within))
    return tuple(stops)


def names_of_goal(goal: Deliver.Goal) -> list[str]:
    """Return what the stops of a delivery are called in its result."""
    return [stop.table or f'stop {number}' for number, stop in enumerate(goal.stops, start=1)]


def situation_of(
    stamp: int,
    sample: OdometrySample | None,
    blocked: bool,
    held: bool,
    obstacle: tuple[float, float] | None,
) -> Situation:
    """Return what a mission knows at `stamp` [ns] from the newest pose and the safety stop."""
    if sample is None:
        return Situation(stamp, blocked=blocked, obstacle=obstacle, held=held)
    position, heading = deviations(sample.pose_covariance)
    return Situation(stamp, sample.pose, sample.stamp, position, heading, blocked, obstacle, held)


def feedback_from_status(
    status: MissionStatus, situation: Situation, frame: str
) -> Deliver.Feedback:
    """Return the feedback of a delivery under way."""
    moving = status.state in (MissionState.DRIVING, MissionState.RETURNING)
    feedback = Deliver.Feedback()
    feedback.state = status.state.value
    if moving and situation.blocked:
        feedback.state = 'stopped for something in the way'
    feedback.stop_index = status.stop_index
    feedback.stop = status.stop
    feedback.distance_left = status.distance_left
    feedback.pose = goal_to_message(situation.pose or Pose2(), situation.stamp, frame)
    return feedback


def feedback_from_queue(place: int, situation: Situation, frame: str) -> Deliver.Feedback:
    """Return the feedback of a delivery that waits for its turn."""
    feedback = Deliver.Feedback(state='queued', queue_place=place, distance_left=math.nan)
    feedback.pose = goal_to_message(situation.pose or Pose2(), situation.stamp, frame)
    return feedback


def result_from_tour(tour: Tour) -> Deliver.Result:
    """Return the result of a delivery that has ended."""
    return Deliver.Result(
        success=tour.is_success,
        reached=list(tour.reached),
        missed=[name for name, _ in tour.missed],
        reasons=[reason for _, reason in tour.missed],
        unconfirmed=list(tour.unconfirmed),
        message=tour.message,
    )


def plan_to_message(path: Path | None, stamp: int, frame: str) -> PathMessage:
    """Return a planned path, each pose looking along it; empty for none."""
    if path is None:
        return path_to_message((), stamp, frame)
    points = path.resampled(_PLAN_SPACING_M)
    poses = []
    for index, (x, y) in enumerate(points):
        ahead = points[min(index + 1, len(points) - 1)] - points[max(index - 1, 0)]
        heading = math.atan2(ahead[1], ahead[0])
        poses.append(Pose2(float(x), float(y), heading))
    if path.heading is not None:
        poses[-1] = Pose2(poses[-1].x, poses[-1].y, path.heading)
    return path_to_message(poses, stamp, frame)


def deviations(covariance: Matrix) -> tuple[float, float]:
    """Return the largest standard deviations of position [m] and of heading [rad]."""
    mean = (covariance[0, 0] + covariance[1, 1]) / 2
    half = (covariance[0, 0] - covariance[1, 1]) / 2
    largest = mean + math.hypot(half, covariance[0, 1])
    return math.sqrt(max(largest, 0.0)), math.sqrt(max(covariance[2, 2], 0.0))


def localisation_of(sample: OdometrySample) -> Localisation:
    """Return how well the robot knows where it is."""
    position, heading = deviations(sample.pose_covariance)
    return Localisation(sample.stamp, position, heading)


def is_lost(message: DiagnosticStatus) -> bool:
    """Return whether localisation says on fusion_state that it is lost."""
    return any(item.key == 'state' and item.value == 'lost' for item in message.values)


def safety_to_message(decision: SafetyDecision, emergency: bool) -> DiagnosticStatus:
    """Return what the safety stop does and why, as on safety_state."""
    values = {
        'state': decision.state.value,
        'blocked': 'true' if decision.blocked else 'false',
        'emergency': 'true' if emergency else 'false',
        'free way [m]': f'{decision.free_way_m:.2f}',
        'stopping distance [m]': f'{decision.stopping_distance_m:.2f}',
        'speed [m/s]': f'{decision.velocity.linear_m_s:.2f}',
    }
    if decision.obstacle is not None:
        values['obstacle x [m]'] = f'{decision.obstacle[0]:.2f}'
        values['obstacle y [m]'] = f'{decision.obstacle[1]:.2f}'
    return DiagnosticStatus(
        level=_LEVELS[decision.state],
        name='safety_stop',
        message='; '.join(decision.reasons) or 'clear',
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def safety_from_message(
    message: DiagnosticStatus,
) -> tuple[bool, bool, tuple[float, float] | None]:
    """Return whether something blocks the way, whether another reason holds, and where it is."""
    values = {item.key: item.value for item in message.values}
    stopped = values.get('state') == SafetyState.STOP.value
    blocked = stopped and values.get('blocked') == 'true'
    try:
        obstacle = (float(values['obstacle x [m]']), float(values['obstacle y [m]']))
    except (KeyError, ValueError):
        return blocked, stopped and not blocked, None
    return blocked, stopped and not blocked, obstacle
