"""Deliveries that are under way or wait for their turn."""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.control.tour import Tour
from tablerunner.errors import MissionError


@dataclass(frozen=True, slots=True)
class Delivery:
    """One delivery, and how far it has come.

    Attributes
    ----------
    id : str
        Whoever ordered it knows it by this.
    tour : Tour
    """

    id: str
    tour: Tour


@dataclass(frozen=True, slots=True)
class DeliveryQueue:
    """Deliveries in the order in which they are served; every change gives a new queue.

    Attributes
    ----------
    deliveries : tuple of Delivery
    """

    deliveries: tuple[Delivery, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a queue with one delivery twice."""
        ids = [delivery.id for delivery in self.deliveries]
        if len(set(ids)) != len(ids):
            raise MissionError(f'a delivery stands twice in the queue: {", ".join(ids)}')

    def __len__(self) -> int:
        return len(self.deliveries)

    @property
    def first(self) -> Delivery | None:
        """The one that is under way or comes next."""
        return self.deliveries[0] if self.deliveries else None

    def place(self, delivery_id: str) -> int | None:
        """Return how many come before a delivery; None: it is not here."""
        for place, delivery in enumerate(self.deliveries):
            if delivery.id == delivery_id:
                return place
        return None

    def find(self, delivery_id: str) -> Delivery | None:
        """Return a delivery by its id."""
        place = self.place(delivery_id)
        return None if place is None else self.deliveries[place]

    def add(self, delivery: Delivery) -> DeliveryQueue:
        """Return a queue with one more, behind all others.

        Raises
        ------
        MissionError
            It is in the queue already.
        """
        return DeliveryQueue((*self.deliveries, delivery))

    def remove(self, delivery_id: str) -> DeliveryQueue:
        """Return a queue without one."""
        return DeliveryQueue(tuple(item for item in self.deliveries if item.id != delivery_id))

    def update(self, delivery: Delivery) -> DeliveryQueue:
        """Return a queue in which a delivery of the same id has come as far as this one."""
        return DeliveryQueue(
            tuple(delivery if item.id == delivery.id else item for item in self.deliveries)
        )
