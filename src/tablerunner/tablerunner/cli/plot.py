"""`tablerunner plot`: the picture of a trip."""

from pathlib import Path
from typing import Annotated, Optional

import typer


def plot(
    bag: Annotated[
        Path, typer.Argument(metavar='BAG', help='Bag folder, an .mcap or a .db3 file.')
    ],
    output: Annotated[
        Path, typer.Option('-o', '--output', metavar='FILE', help='The PNG to write.')
    ] = Path('out/trip.png'),
    scenario: Annotated[
        Optional[Path],
        typer.Option(metavar='F', help='The room; scenario.yaml in or beside BAG if not given.'),
    ] = None,
    title: Annotated[str, typer.Option(help='Title of the picture.')] = '',
    namespace: Annotated[str, typer.Option(help='Namespace of the robot in the bag.')] = '',
) -> None:
    """Draw the trip that a bag holds: as published in it, else as a replay by ekf finds it.

    Example: tablerunner plot out/demo/bag -o out/trip.png
    """
    from dataclasses import replace as changed

    from tablerunner.bags.reader import BagReader
    from tablerunner.bags.replay import replay
    from tablerunner.bags.trips import trip_of_bag, trip_of_replay
    from tablerunner.cli.console import Progress
    from tablerunner.cli.replay_options import find_scenario, replay_config
    from tablerunner.evaluation.plots import draw_trip

    room = find_scenario(bag, scenario)
    with Progress() as progress, BagReader(bag) as reader:
        progress.show(f'reading {bag}')
        name = title or bag.resolve().name
        trip = trip_of_bag(reader, name, namespace)
        if trip is None or not len(trip.stamps):
            progress.show(f'replaying {bag}')
            config = changed(replay_config(room, 'ekf', '', namespace), fixes=True)
            trip = trip_of_replay(replay(reader, config), name)
        for item in reader.damage:
            progress.say(f'damaged: {item}', 'yellow')
        progress.show(f'drawing {output}')
        draw_trip(trip, room, output)
    typer.echo(str(output))
