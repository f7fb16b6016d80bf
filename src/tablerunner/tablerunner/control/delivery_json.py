"""Delivery queues as plain data for JSON, and back; what does not fit is named by its place."""

from __future__ import annotations

import math
from typing import Any

from tablerunner.control.delivery_queue import Delivery, DeliveryQueue
from tablerunner.control.destination import Destination
from tablerunner.control.tour import Tour
from tablerunner.errors import MissionError
from tablerunner.geometry.pose import Pose2

_TOUR = ('id', 'stops', 'home', 'index', 'reached', 'missed', 'unconfirmed')
_STOP = ('name', 'pose', 'wait', 'confirm', 'keep_heading')


class PlaceError(ValueError):
    """Something at a place is not what it should be."""

    def __init__(self, place: str, value: Any, expected: str) -> None:
        super().__init__(f'{place}: got {value!r}, expected {expected}')
        self.place, self.value, self.expected = place, value, expected


def queue_to_json(queue: DeliveryQueue) -> list[dict[str, Any]]:
    """Return a queue as lists, dicts, strings and numbers."""
    return [_delivery_to_json(delivery) for delivery in queue.deliveries]


def queue_from_json(data: Any, place: str) -> DeliveryQueue:
    """Return the queue of `queue_to_json`.

    Raises
    ------
    PlaceError
    """
    items = _list(data, place)
    deliveries = tuple(_delivery(item, f'{place}[{at}]') for at, item in enumerate(items))
    try:
        return DeliveryQueue(deliveries)
    except MissionError as error:
        raise PlaceError(place, [item.id for item in deliveries], str(error)) from None


def _delivery_to_json(delivery: Delivery) -> dict[str, Any]:
    tour = delivery.tour
    return {
        'id': delivery.id,
        'stops': [_stop_to_json(stop) for stop in tour.stops],
        'home': None if tour.home is None else _stop_to_json(tour.home),
        'index': tour.index,
        'reached': list(tour.reached),
        'missed': [list(pair) for pair in tour.missed],
        'unconfirmed': list(tour.unconfirmed),
    }


def _stop_to_json(stop: Destination) -> dict[str, Any]:
    return {
        'name': stop.name,
        'pose': [stop.pose.x, stop.pose.y, stop.pose.heading],
        'wait': stop.wait_s,
        'confirm': stop.confirm_s,
        'keep_heading': stop.keep_heading,
    }


def _delivery(data: Any, place: str) -> Delivery:
    values = _object(data, place, _TOUR)
    stops = tuple(
        _stop(item, f'{place}.stops[{at}]')
        for at, item in enumerate(_list(values['stops'], f'{place}.stops'))
    )
    home = values['home']
    if home is not None:
        home = _stop(home, f'{place}.home')
    legs = len(stops) + (home is not None)
    index = values['index']
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < max(legs, 1):
        raise PlaceError(f'{place}.index', index, f'a whole number from 0 to {legs - 1}')
    if not legs:
        raise PlaceError(f'{place}.stops', [], 'at least one stop')
    missed = []
    for at, pair in enumerate(_list(values['missed'], f'{place}.missed')):
        names = _names(pair, f'{place}.missed[{at}]')
        if len(names) != 2:
            raise PlaceError(f'{place}.missed[{at}]', pair, 'a stop and a reason')
        missed.append((names[0], names[1]))
    reached = _names(values['reached'], f'{place}.reached')
    if len(reached) + len(missed) != index:
        raise PlaceError(f'{place}.index', index, 'the number of stops reached and missed')
    unconfirmed = _names(values['unconfirmed'], f'{place}.unconfirmed')
    name = _text(values['id'], f'{place}.id')
    return Delivery(name, Tour(stops, home, index, reached, tuple(missed), unconfirmed))


def _stop(data: Any, place: str) -> Destination:
    values = _object(data, place, _STOP)
    pose = _list(values['pose'], f'{place}.pose')
    if len(pose) != 3:
        raise PlaceError(f'{place}.pose', pose, 'x, y, heading')
    x, y, heading = (_number(value, f'{place}.pose[{at}]') for at, value in enumerate(pose))
    keep = values['keep_heading']
    if not isinstance(keep, bool):
        raise PlaceError(f'{place}.keep_heading', keep, 'true or false')
    waits = {name: _number(values[name], f'{place}.{name}') for name in ('wait', 'confirm')}
    for name, value in waits.items():
        if value < 0.0:
            raise PlaceError(f'{place}.{name}', value, 'at least 0')
    name = _text(values['name'], f'{place}.name')
    return Destination(name, Pose2(x, y, heading), waits['wait'], waits['confirm'], keep)


def _object(data: Any, place: str, names: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(data, dict) or set(data) != set(names):
        found = sorted(data) if isinstance(data, dict) else data
        raise PlaceError(place, found, 'an object with ' + ', '.join(names))
    return data


def _list(data: Any, place: str) -> list[Any]:
    if not isinstance(data, list):
        raise PlaceError(place, data, 'a list')
    return data


def _names(data: Any, place: str) -> tuple[str, ...]:
    return tuple(_text(item, f'{place}[{at}]') for at, item in enumerate(_list(data, place)))


def _text(data: Any, place: str) -> str:
    if not isinstance(data, str):
        raise PlaceError(place, data, 'text')
    return data


def _number(data: Any, place: str) -> float:
    if isinstance(data, bool) or not isinstance(data, (int, float)) or not math.isfinite(data):
        raise PlaceError(place, data, 'a finite number')
    return float(data)
