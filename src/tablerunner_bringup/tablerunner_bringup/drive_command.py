"""The command `tablerunner drive`."""

import math
from typing import Annotated, Optional

import typer

from tablerunner.cli.console import Progress
from tablerunner.cli.exits import DONE, FAILED
from tablerunner.errors import ConfigError


def drive(
    speed: Annotated[float, typer.Option(help='Forward speed [m/s], at most 0.5.')] = 0.0,
    turn: Annotated[
        float, typer.Option(help='Turn rate [rad/s], left positive, at most 1.')
    ] = 0.0,
    distance: Annotated[
        Optional[float], typer.Option(min=0.0, help='Until odometry has come so far [m].')
    ] = None,
    angle: Annotated[
        Optional[float], typer.Option(min=0.0, help='Until it has turned so far [degrees].')
    ] = None,
    seconds: Annotated[
        Optional[float],
        typer.Option(min=0.0, max=300.0, help='At most so long; 2, or 60 with one of those.'),
    ] = None,
    topic: Annotated[str, typer.Option(help='Where the base or safety_stop listens.')] = 'cmd_vel',
    namespace: Annotated[str, typer.Option(help='Namespace of the robot.')] = '',
    domain: Annotated[
        Optional[int], typer.Option(help='ROS domain; that of ROS_DOMAIN_ID when not given.')
    ] = None,
) -> None:
    """Drive by hand, for a time or a distance, and say what odometry makes of it.

    Nothing watches the way: wheels off the floor first, then a free one. Twist or TwistStamped, as
    the listener wants. It does not speak while another node drives.

    Example: tablerunner drive --speed 0.2 --distance 1
    """
    from tablerunner.types import Velocity
    from tablerunner_bringup.hand_driving import DriveOptions
    from tablerunner_bringup.hand_driving import drive as run

    for name, value, most in (('--speed', speed, 0.5), ('--turn', turn, 1.0)):
        if not abs(value) <= most:
            raise ConfigError(name, value, f'a number from {-most:g} to {most:g}', 'options')
    if seconds is None:
        seconds = 2.0 if distance is None and angle is None else 60.0
    options = DriveOptions(
        Velocity(speed, turn),
        seconds,
        math.inf if distance is None else distance,
        math.inf if angle is None else math.radians(angle),
        topic,
        namespace.strip('/'),
        domain,
    )
    driven = run(options, Progress())
    if math.isnan(driven.forward_m):
        typer.echo('odometry is silent: see tablerunner doctor')
        raise typer.Exit(FAILED)
    typer.echo(
        f'odometry: {driven.forward_m:.2f} m forward, {driven.left_m:.2f} m to the left, '
        f'turned {math.degrees(driven.turn_rad):.0f} degrees to the left'
    )
    raise typer.Exit(DONE)
