"""First come, first served."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablerunner.control import Delivery, DeliveryQueue, Destination, Tour
from tablerunner.errors import MissionError
from tablerunner.geometry.pose import Pose2

TOUR = Tour((Destination('table_1', Pose2()),))
STEPS = st.lists(st.tuples(st.sampled_from(['add', 'remove']), st.integers(0, 6)), max_size=30)


@given(STEPS)
def test_queue_behaves_as_a_list_without_duplicates(steps: list[tuple[str, int]]) -> None:
    """Against a plain list; the queue that was changed stays as it was."""
    queue, model = DeliveryQueue(), []
    for what, number in steps:
        name, before = str(number), queue
        if what == 'remove':
            queue = queue.remove(name)
            model = [item for item in model if item != name]
        elif name in model:
            with pytest.raises(MissionError, match='twice'):
                queue.add(Delivery(name, TOUR))
        else:
            queue = queue.add(Delivery(name, TOUR))
            model = [*model, name]
            assert len(before) == len(queue) - 1
        assert [item.id for item in queue.deliveries] == model
        assert len(queue) == len(model)
        assert queue.place(name) == (model.index(name) if name in model else None)
        assert (queue.first is None) == (not model)
        assert queue.first is None or queue.first.id == model[0]


def test_update_changes_one_delivery_and_its_place_is_kept() -> None:
    queue = DeliveryQueue(tuple(Delivery(name, TOUR) for name in 'abc'))
    done = queue.update(Delivery('b', TOUR.miss('gone')))
    assert [item.id for item in done.deliveries] == ['a', 'b', 'c']
    assert done.find('b').tour.missed == (('table_1', 'gone'),)
    assert queue.find('b').tour == TOUR
