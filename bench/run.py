"""`make bench`: how fast it is, as ratios measured in one run; a table, and out/bench.json."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import camera
import device
import drive_rooms
import filter_step
import fuzzy
import latency
import memory
import monte_carlo
import offline
import particles
import processor
import protocols
import safety
import solvers
from result import Result
from rich.console import Console
from rich.table import Table

BENCHES: dict[str, Callable[[], Iterable[Result]]] = {
    'filter': filter_step.measure,
    'monte_carlo': monte_carlo.measure,
    'solvers': solvers.measure,
    'offline': offline.measure,
    'latency': latency.measure,
    'safety': safety.measure,
    'device': device.measure,
    'processor': processor.measure,
    'memory': memory.measure,
    'fuzzy': fuzzy.measure,
    'protocols': protocols.measure,
    'drive_rooms': drive_rooms.measure,
    'particles': particles.measure,
    'camera': camera.measure,
}
WITH_BAR = {'solvers', 'monte_carlo'}
"""Those that show a bar of their own, with which a spinner would fight for the line."""


def main() -> int:
    """Run the benches that were asked for, all by default."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('only', nargs='*', help='of: ' + ', '.join(BENCHES))
    parser.add_argument('--json', type=Path, default=Path('out/bench.json'))
    arguments = parser.parse_args()
    unknown = [name for name in arguments.only if name not in BENCHES]
    if unknown:
        print(
            f'no such bench: {", ".join(unknown)}; there are {", ".join(BENCHES)}', file=sys.stderr
        )
        return 2
    console = Console(stderr=True)
    results: list[Result] = []
    for name in arguments.only or BENCHES:
        if name in WITH_BAR:
            console.print(f'measuring {name} ...', highlight=False)
            found = list(BENCHES[name]())
        else:
            with console.status(f'measuring {name} ...'):
                found = list(BENCHES[name]())
        for result in found:
            console.print(f'  {result.name}: {result.ratio:.3g} ({result.what})', highlight=False)
        results += found
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(
        json.dumps([result.to_dict() for result in results], indent=2) + '\n'
    )
    Console(width=None if sys.stdout.isatty() else 140).print(table(results))
    print(f'written: {arguments.json}')
    return 0


def table(results: list[Result]) -> Table:
    """Return the results as a table."""
    grid = Table('name', 'ours', 'reference', 'ratio', 'unit', 'bound', 'what')
    for item in results:
        bound = (
            '' if item.bound is None else ('<= ' if item.at_most else '>= ') + f'{item.bound:g}'
        )
        grid.add_row(
            item.name,
            f'{item.ours:.4g}',
            f'{item.reference:.4g}',
            f'{item.ratio:.3g}',
            item.unit,
            bound + ('' if item.kept else ' MISSED'),
            item.what,
        )
    return grid


if __name__ == '__main__':
    sys.exit(main())
