"""The command `tablerunner emulate`."""

from pathlib import Path
from typing import Annotated, Optional

import typer

from tablerunner.cli.console import Progress
from tablerunner.errors import ConfigError

RADIOS = ('dwm1001', 'exchanges')


def emulate(
    scenario: Annotated[
        Optional[Path], typer.Option('--scenario', help='Scenario file; the workshop else.')
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help='Seed of everything that is drawn.')] = 1,
    uwb: Annotated[
        str,
        typer.Option(help='UWB module: dwm1001 at a port, or exchanges (a topic).'),
    ] = RADIOS[0],
    port: Annotated[Path, typer.Option(help='Where the port of the module appears.')] = Path('out')
    / 'emulated'
    / 'dwm1001',
    twist_stamped: Annotated[
        bool, typer.Option('--twist-stamped', help='The base takes TwistStamped.')
    ] = False,
    namespace: Annotated[str, typer.Option(help='Namespace of the robot.')] = '',
    domain: Annotated[
        Optional[int], typer.Option(help='ROS domain; that of ROS_DOMAIN_ID when not given.')
    ] = None,
    duration: Annotated[
        float, typer.Option(min=0.0, help='End after so many seconds; 0: never.')
    ] = 0.0,
) -> None:
    """Be the devices of a robot: wheels, IMU, ultrasonic sensors, a UWB module; until Ctrl-C.

    For rehearsing without a robot: it speaks as drivers do, in host time, and obeys cmd_vel. The
    nodes are those of a real robot: tablerunner launch --no-sim.

    Example: tablerunner emulate --scenario room.yaml --port out/dwm1001
    """
    from tablerunner_bringup.emulator.running import EmulationOptions, run
    from tablerunner_bringup.launching import default_scenario

    if uwb not in RADIOS:
        raise ConfigError('--uwb', uwb, f'one of {", ".join(RADIOS)}', 'options')
    options = EmulationOptions(
        scenario or default_scenario('workshop'),
        seed,
        port if uwb == 'dwm1001' else None,
        twist_stamped,
        namespace.strip('/'),
        domain,
        duration or float('inf'),
    )
    told = run(options, Progress())
    typer.echo(f'{told.commands} commands obeyed, {told.touches} touches')
    if told.lost_s:
        typer.echo(f'this machine was too slow: {told.lost_s:.1f} s of real time are lost')
