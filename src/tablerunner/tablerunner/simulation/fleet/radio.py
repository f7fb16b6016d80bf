"""Ranging of many robots: `simulation.radio.Radio` over arrays.

Instead of six timestamps there is the time of flight that they lead to. The exchange is asymmetric
double-sided, (Ra Rb - Da Db) / (Ra + Rb + Da + Db) with rounds R and replies D; with receptions
late by their own noise that is exact but for the drift of the clocks and the steps of their
counters, together below a millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tablerunner.scenario import Scenario
from tablerunner.simulation.fleet.draws import Draws
from tablerunner.simulation.radio import GAP_DB, LIGHT_M_S, LOSS_DB, POWER_AT_1M_DBM
from tablerunner.simulation.sight import Sight
from tablerunner.simulation.streams import stream
from tablerunner.types import seconds

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class FleetExchange(NamedTuple):
    """One exchange of every run with the same anchor; arrays of shape (runs,)."""

    anchor: int
    flight_s: Array  # time of flight as the timestamps give it; NaN where the exchange was lost
    rx_power_dbm: Array
    first_path_power_dbm: Array
    blocked: Flags
    excess_m: Array


class FleetRadio:
    """The exchanges of all tags with the anchors in turn.

    Attributes
    ----------
    bias_m, scale : ndarray, shape (anchors, runs)
        Constant and proportional error of each link: those of the one-robot `Radio` of that seed.
    """

    def __init__(self, scenario: Scenario, seeds: Sequence[int]) -> None:
        self._errors = scenario.sensors.uwb
        self._places = [anchor.position for anchor in scenario.anchors]
        self._mount = scenario.robot.tag_position
        self._sight = Sight(scenario.outlines)
        count, runs = len(scenario.anchors), len(seeds)
        streams = [
            [stream(seed, f'uwb {anchor.id}') for seed in seeds] for anchor in scenario.anchors
        ]
        links = np.array([[random.standard_normal(2) for random in row] for row in streams])
        links = links.reshape(count, runs, 2)
        self.bias_m = links[:, :, 0] * self._errors.bias_std
        self.scale = links[:, :, 1] * self._errors.scale_std
        self._draws = [Draws(row, normals=6, uniforms=3) for row in streams]
        self._detour = np.zeros((count, runs))
        self._stamps: list[int | None] = [None] * count
        self._turn = 0

    def tag(self, x: Array, y: Array, heading: Array) -> Array:
        """Return where the antennas are in map, shape (2, runs) [m]."""
        cos, sin = np.cos(heading), np.sin(heading)
        forward, left, _ = self._mount
        return np.stack([x + cos * forward - sin * left, y + sin * forward + cos * left])

    def exchange(self, stamp: int, tag: Array, people: Array, sizes: Array) -> FleetExchange:
        """Return the next exchange of every run.

        Parameters
        ----------
        stamp : int
        tag : ndarray, shape (2, runs)
            Antennas in map [m].
        people : ndarray, shape (2, people, runs)
            Where everybody is [m].
        sizes : ndarray, shape (2, people, runs)
            Radius and height of everybody [m].
        """
        index = self._turn
        self._turn = (self._turn + 1) % len(self._places)
        anchor, errors, height = self._places[index], self._errors, self._mount[2]
        distance = np.sqrt(
            (anchor[0] - tag[0]) ** 2 + (anchor[1] - tag[1]) ** 2 + (anchor[2] - height) ** 2
        )
        thing = self._sight.thing_blocks_many(tag, height, anchor)
        person = person_blocks_many(tag, height, anchor, people, sizes) & ~thing
        blocked = thing | person
        normals, uniforms = self._draws[index].row()
        detour = self._next_detour(index, stamp, normals[5])
        excess = np.where(
            thing, _between(errors.nlos_excess, detour), _between(errors.person_excess, detour)
        )
        excess = np.where(blocked, excess, 0.0)
        lost = uniforms[0] < np.where(
            blocked, errors.nlos_loss_probability, errors.loss_probability
        )
        std = np.where(blocked, math.hypot(errors.range_std, errors.nlos_std), errors.range_std)
        late = distance + self.bias_m[index] + self.scale[index] * distance + excess
        flights = (late + normals[:3] * std * math.sqrt(16.0 / 6.0)) / LIGHT_M_S
        replies = _between(errors.reply_delay, uniforms[1:])
        flight = np.where(lost, np.nan, _double_sided(flights, replies))
        power = POWER_AT_1M_DBM - 20.0 * np.log10(np.maximum(distance, 0.1))
        power -= _of_kind(LOSS_DB, thing, person) - errors.power_std * normals[3]
        thin = _of_kind({kind: pair[0] for kind, pair in GAP_DB.items()}, thing, person)
        thick = _of_kind({kind: pair[1] for kind, pair in GAP_DB.items()}, thing, person)
        gap = np.maximum(thin + (thick - thin) * detour + errors.power_std * normals[4], 0.0)
        return FleetExchange(index, flight, power, power - gap, blocked, excess)

    def _next_detour(self, index: int, stamp: int, draw: Array) -> Array:
        """Return where between least (0) and most (1) the detours of the signals now lie."""
        last, self._stamps[index] = self._stamps[index], stamp
        keep = 0.0 if last is None else math.exp(-seconds(stamp - last) / self._errors.nlos_hold)
        self._detour[index] = keep * self._detour[index] + math.sqrt(1.0 - keep**2) * draw
        return np.asarray(ndtr(self._detour[index]))


def person_blocks_many(
    tag: Array, height: float, anchor: tuple[float, float, float], people: Array, sizes: Array
) -> Flags:
    """Return whether the lines from tags to an anchor pass through a person, shape (runs,).

    Parameters
    ----------
    tag : ndarray, shape (2, runs)
    height : float
        Of the tags [m].
    anchor : tuple
    people : ndarray, shape (2, people, runs)
    sizes : ndarray, shape (2, people, runs)
        Radius and height [m].
    """
    if people.shape[1] == 0:
        return np.zeros(tag.shape[1], dtype=bool)
    dx, dy, dz = anchor[0] - tag[0], anchor[1] - tag[1], anchor[2] - height
    flat2 = np.maximum(dx * dx + dy * dy, 1e-12)
    px, py = people[0] - tag[0], people[1] - tag[1]
    middle = (px * dx + py * dy) / flat2
    half2 = (sizes[0] ** 2 - (px - middle * dx) ** 2 - (py - middle * dy) ** 2) / flat2
    half = np.sqrt(np.maximum(half2, 0.0))
    enter, leave = np.maximum(middle - half, 0.0), np.minimum(middle + half, 1.0)
    lowest = height + np.minimum(enter * dz, leave * dz)
    hit = (half2 > 0.0) & (enter < leave) & (lowest < sizes[1])
    return np.asarray(hit.any(axis=0) & (flat2 > 1e-12))


def _double_sided(flights: Array, replies: Array) -> Array:
    """Return the time of flight that an exchange gives [s], shape (runs,).

    Parameters
    ----------
    flights : ndarray, shape (3, runs)
        How long poll, response and final take [s].
    replies : ndarray, shape (2, runs)
        Reply delays of anchor and tag [s].
    """
    first, second = flights[0] + flights[1], flights[1] + flights[2]
    product = replies[0] * second + replies[1] * first + first * second
    return np.asarray(product / (2.0 * (replies[0] + replies[1]) + first + second))


def _between(limits: tuple[float, float], share: Array) -> Array:
    return limits[0] + (limits[1] - limits[0]) * share


def _of_kind(values: dict[str, float], thing: Flags, person: Flags) -> Array:
    return np.where(thing, values['thing'], np.where(person, values['person'], values['']))
