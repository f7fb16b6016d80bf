"""Many simulated robots at once, as arrays: what `Simulator` does, for all seeds in one loop.

Runs share their room, route and clock and nothing else. Each run draws from streams of its own
seed, so that what it measures does not depend on which other runs there are.
"""

from tablerunner.simulation.fleet.fleet import Fleet
from tablerunner.simulation.fleet.record import FleetRecord

__all__ = ['Fleet', 'FleetRecord']
