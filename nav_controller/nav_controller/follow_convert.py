"""What the follower does, as a message; pure."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from tablerunner.control.person_follower import FollowState, FollowStep

_LEVELS = {FollowState.LOST: DiagnosticStatus.WARN, FollowState.GIVEN_UP: DiagnosticStatus.ERROR}


def follow_to_message(step: FollowStep, tag_id: str) -> DiagnosticStatus:
    """Return a step as on follow_state: its message is the state, and why where there is one."""
    values = {
        'state': step.state.value,
        'reason': step.reason,
        'tag': tag_id,
        'distance [m]': f'{step.distance_m:.2f}',
        'bearing [rad]': f'{step.bearing_rad:.2f}',
    }
    return DiagnosticStatus(
        level=_LEVELS.get(step.state, DiagnosticStatus.OK),
        name='follow',
        message=': '.join(part for part in (step.state.value, step.reason) if part),
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
