"""Judge a recorded trip: errors.json and trip.png from its bag."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tablerunner.bags.reader import BagReader
from tablerunner.bags.trips import trip_of_bag
from tablerunner.cli.json_file import write_json
from tablerunner.errors import BagError
from tablerunner.evaluation.plots import draw_trip
from tablerunner.evaluation.trip import errors_table
from tablerunner.scenario import Scenario


def judge(
    bag: Path,
    scenario: Scenario,
    title: str,
    facts: dict[str, Any],
    errors_file: Path,
    picture: Path,
) -> dict[str, Any]:
    """Write errors and picture of a recorded trip; return the table of errors.

    Parameters
    ----------
    facts : dict
        What else is known of the trip; stands first in errors.json.

    Raises
    ------
    BagError
        The bag cannot be read or holds no estimate.
    """
    with BagReader(bag) as reader:
        trip = trip_of_bag(reader, title)
    if trip is None:
        raise BagError(f'{bag} holds no odometry/filtered: the robot never knew where it was')
    table = {**facts, **errors_table(trip)}
    write_json(errors_file, table)
    draw_trip(trip, scenario, picture)
    return table
