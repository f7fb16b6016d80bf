"""Simulated UWB two-way ranging: the timestamps and powers that the devices would show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import ndtr

from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario, UwbErrors
from tablerunner.simulation.clock import TICKS_PER_SECOND, DeviceClock, wrap_counter
from tablerunner.simulation.sight import Sight, person_blocks
from tablerunner.simulation.streams import stream
from tablerunner.simulation.truth import PersonState, RangeTruth
from tablerunner.types import ExchangeSample, seconds

LIGHT_M_S = 299_792_458.0
_SEND_GRID = 512  # delayed sending takes the nine lowest bits as zero
_SEQUENCES = 1 << 32
POWER_AT_1M_DBM = -63.0  # -14.3 dBm sent, less 48.7 dB of free space at 6.5 GHz

# How far the first path lies under the whole signal, for the least and the most detour, and how
# much of the signal is lost [dB]. Less than about 6 dB tells of a line of sight, more than 10 dB
# of none (the rule of the radios' maker); a thin obstacle lies between.
GAP_DB = {'': (3.0, 3.0), 'person': (7.5, 13.0), 'thing': (9.0, 17.0)}
LOSS_DB = {'': 0.0, 'person': 5.0, 'thing': 8.0}


class Links:
    """What flies between one tag and some anchors, whoever carries which.

    The signal flies ``distance / c``; each of the three receptions is late by the link's bias
    (constant + in proportion to the distance), by the detour where something blocks the way, and
    by noise. The noise of each reception is such that the range of a symmetric exchange has
    standard deviation ``range_std`` (a range weighs the three receptions 1/4, 1/2, 1/4).

    Parameters
    ----------
    errors : UwbErrors
    tag_id : str
    tag_clock : DeviceClock
    clocks : mapping of str to DeviceClock
        Of the anchors.
    randoms : mapping of str to Generator
        The random stream of the link to each anchor.

    Attributes
    ----------
    bias_m, scale : dict of str to float
        Constant and proportional error of the link to each anchor, drawn once.
    lost : dict of str to int
        Exchanges lost so far, by anchor.
    """

    def __init__(
        self,
        errors: UwbErrors,
        tag_id: str,
        tag_clock: DeviceClock,
        clocks: Mapping[str, DeviceClock],
        randoms: Mapping[str, np.random.Generator],
    ) -> None:
        self._errors = errors
        self._tag_id = tag_id
        self._tag_clock = tag_clock
        self._clocks = clocks
        self._random = randoms
        self.bias_m: dict[str, float] = {}
        self.scale: dict[str, float] = {}
        for anchor_id, random in self._random.items():
            draws = random.standard_normal(2)
            self.bias_m[anchor_id] = float(draws[0]) * errors.bias_std
            self.scale[anchor_id] = float(draws[1]) * errors.scale_std
        # Where between least and most the detour lies: a Gauss-Markov process through its
        # distribution function, so that it is uniform at any time and changes slowly.
        self._detour = dict.fromkeys(self._random, 0.0)
        self._detour_ns: dict[str, int] = {}
        self.lost = dict.fromkeys(self._random, 0)
        self._sequence = 0

    def fly(
        self, stamp: int, anchor_id: str, distance: float, blocked: str
    ) -> tuple[ExchangeSample | None, RangeTruth]:
        """Return the next exchange with an anchor, None when it was lost, and the truth about it.

        Parameters
        ----------
        stamp : int
        anchor_id : str
        distance : float
            Between the antennas [m].
        blocked : str
            What stands in the way, as in `RangeTruth`.
        """
        self._sequence = (self._sequence + 1) % _SEQUENCES
        errors, random = self._errors, self._random[anchor_id]
        # Always the same draws, whatever happens, so that runs that differ in one thing compare.
        normal = random.standard_normal(6)
        uniform = random.random(3)
        detour = self._next_detour(stamp, anchor_id, float(normal[5]))
        excess = self._excess(blocked, detour)
        chance = errors.nlos_loss_probability if blocked else errors.loss_probability
        lost = bool(uniform[0] < chance)
        truth = RangeTruth(
            stamp, anchor_id, self._sequence, distance, blocked, excess, lost, self._tag_id
        )
        clock = self._clocks[anchor_id]
        clock.advance(stamp)
        self._tag_clock.advance(stamp)
        if lost:
            self.lost[anchor_id] += 1
            return None, truth
        extra = errors.nlos_std if blocked else 0.0
        std = math.hypot(errors.range_std, extra)
        late = self.bias_m[anchor_id] + self.scale[anchor_id] * distance + excess
        noise = [float(draw) * std * math.sqrt(16.0 / 6.0) for draw in normal[:3]]
        flights = [(distance + late + part) / LIGHT_M_S for part in noise]
        low, high = errors.reply_delay
        delays = [low + (high - low) * float(draw) for draw in uniform[1:]]
        times = _exchange_times(self._tag_clock, clock, flights, delays)
        power = POWER_AT_1M_DBM - 20.0 * math.log10(max(distance, 0.1)) - LOSS_DB[blocked]
        power += errors.power_std * float(normal[3])
        thin, thick = GAP_DB[blocked]
        gap = max(thin + (thick - thin) * detour + errors.power_std * float(normal[4]), 0.0)
        sample = ExchangeSample(
            stamp,
            anchor_id,
            self._tag_id,
            self._sequence,
            *times,
            rx_power_dbm=power,
            first_path_power_dbm=power - gap,
        )
        return sample, truth

    def _next_detour(self, stamp: int, anchor_id: str, draw: float) -> float:
        """Return where between least (0) and most (1) the detour of the signal now lies."""
        last = self._detour_ns.get(anchor_id)
        keep = 0.0 if last is None else math.exp(-seconds(stamp - last) / self._errors.nlos_hold)
        self._detour[anchor_id] = keep * self._detour[anchor_id] + math.sqrt(1 - keep**2) * draw
        self._detour_ns[anchor_id] = stamp
        return float(ndtr(self._detour[anchor_id]))

    def _excess(self, blocked: str, detour: float) -> float:
        if not blocked:
            return 0.0
        errors = self._errors
        low, high = errors.person_excess if blocked == 'person' else errors.nlos_excess
        return low + (high - low) * detour


class Radio:
    """The exchanges of the robot's tag with all anchors of the room in turn.

    Parameters
    ----------
    scenario : Scenario
    seed : int
    own : str
        Put before the names of the random streams of its links.
    clocks : mapping of str to DeviceClock, optional
        Of the anchors; made from the seed when not given.

    Attributes
    ----------
    links : Links
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        own: str = '',
        clocks: Mapping[str, DeviceClock] | None = None,
    ) -> None:
        errors = scenario.sensors.uwb
        self._anchors = scenario.anchors
        self._mount = scenario.robot.tag_position
        self._heights = [person.height for person in scenario.people]
        self._sight = Sight(scenario.outlines)
        ids = [anchor.id for anchor in scenario.anchors]
        self.links = Links(
            errors,
            scenario.tag_id,
            device_clock(errors, scenario.tag_id, seed),
            clocks or {name: device_clock(errors, name, seed) for name in ids},
            {name: stream(seed, f'{own}uwb {name}') for name in ids},
        )
        self._turn = 0

    @property
    def bias_m(self) -> dict[str, float]:
        """Constant error of the link to each anchor [m]."""
        return self.links.bias_m

    @property
    def scale(self) -> dict[str, float]:
        """Error of the link to each anchor in proportion to the range."""
        return self.links.scale

    @property
    def lost(self) -> dict[str, int]:
        """Exchanges lost so far, by anchor."""
        return self.links.lost

    def exchange(
        self, stamp: int, pose: Pose2, people: Sequence[PersonState]
    ) -> tuple[ExchangeSample | None, RangeTruth]:
        """Return the next exchange, None when it was lost, and the truth about it.

        Parameters
        ----------
        stamp : int
        pose : Pose2
            base_link in map; the robot is taken to stand during the few milliseconds.
        people : sequence of PersonState
        """
        anchor = self._anchors[self._turn]
        self._turn = (self._turn + 1) % len(self._anchors)
        antenna = pose @ Pose2(self._mount[0], self._mount[1])
        tag = (antenna.x, antenna.y, self._mount[2])
        distance = math.dist(tag, anchor.position)
        blocked = ''
        if self._sight.thing_blocks(tag, anchor.position):
            blocked = 'thing'
        elif person_blocks(tag, anchor.position, people, self._heights):
            blocked = 'person'
        return self.links.fly(stamp, anchor.id, distance, blocked)


def device_clock(errors: UwbErrors, name: str, seed: int) -> DeviceClock:
    """Return the clock of a device by its name."""
    random = stream(seed, f'clock {name}')
    return DeviceClock(errors.clock_error_ppm, errors.clock_walk_ppm, random)


def _exchange_times(
    tag: DeviceClock, anchor: DeviceClock, flights: Sequence[float], delays: Sequence[float]
) -> tuple[int, int, int, int, int, int]:
    """Return the six registers of one exchange.

    Parameters
    ----------
    tag, anchor : DeviceClock
        Both advanced to the stamp of the exchange.
    flights : sequence of 3 floats
        How long poll, response and final take [s].
    delays : sequence of 2 floats
        Reply delays of anchor and tag, which each measures by its own clock [s].
    """
    poll_tx = _send_slot(tag.read(0.0))
    poll_rx = anchor.read(tag.when(poll_tx) + flights[0])
    response_tx = _send_slot(poll_rx + round(delays[0] * TICKS_PER_SECOND))
    response_rx = tag.read(anchor.when(response_tx) + flights[1])
    final_tx = _send_slot(response_rx + round(delays[1] * TICKS_PER_SECOND))
    final_rx = anchor.read(tag.when(final_tx) + flights[2])
    return (
        wrap_counter(poll_tx),
        wrap_counter(poll_rx),
        wrap_counter(response_tx),
        wrap_counter(response_rx),
        wrap_counter(final_tx),
        wrap_counter(final_rx),
    )


def _send_slot(ticks: int) -> int:
    """Return the next time at which a radio can be told to send."""
    return -(-ticks // _SEND_GRID) * _SEND_GRID
