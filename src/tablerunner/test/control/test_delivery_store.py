"""The queue's file: what was kept is there again, whatever happens; damage is named."""

from __future__ import annotations

import json
import math
import os
import random
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tablerunner.control import Delivery, DeliveryQueue, DeliveryStore, Destination, Tour
from tablerunner.control.delivery_store import decode, encode
from tablerunner.errors import ConfigError, MissionError
from tablerunner.geometry.pose import Pose2

NUMBERS = st.floats(-1e6, 1e6)
TIMES = st.floats(0.0, 1e5)
NAMES = st.text(max_size=12)
STOPS = st.builds(
    Destination, NAMES, st.builds(Pose2, NUMBERS, NUMBERS, NUMBERS), TIMES, TIMES, st.booleans()
)


@st.composite
def tours(draw: Any) -> Tour:
    stops = tuple(draw(st.lists(STOPS, min_size=1, max_size=4)))
    home = draw(st.none() | STOPS)
    tour = Tour(stops, home)
    for _ in range(draw(st.integers(0, len(tour.legs) - 1))):
        if draw(st.booleans()):
            tour = tour.arrive().leave(draw(st.booleans()))
        else:
            tour = tour.miss(draw(NAMES))
    return tour


QUEUES = st.lists(st.tuples(NAMES, tours()), unique_by=lambda item: item[0], max_size=4).map(
    lambda items: DeliveryQueue(tuple(Delivery(name, tour) for name, tour in items))
)


def queue_of(count: int) -> DeliveryQueue:
    """Return a queue that tells its number by its length and in each delivery."""
    stop = Destination('table_1', Pose2(1.0, 2.0, 0.5), 3.0, 60.0)
    return DeliveryQueue(
        tuple(Delivery(f'{count}-{place}', Tour((stop,) * 5)) for place in range(count % 7))
    )


@given(QUEUES)
def test_queue_comes_back_bit_for_bit(queue: DeliveryQueue) -> None:
    assert decode(encode(queue)) == queue


@given(QUEUES, st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
def test_any_cut_or_changed_byte_is_noticed(
    tmp_path: Path, queue: DeliveryQueue, data: st.DataObject
) -> None:
    """Whatever is lost at the end, or changed within: the old queue or an error, never another."""
    content = encode(queue).encode('utf-8')
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        damaged = content[:at]
    else:
        damaged = content[:at] + data.draw(st.binary(min_size=1, max_size=1)) + content[at + 1 :]
    store = DeliveryStore(tmp_path / 'queue.json')
    try:
        store.path.write_bytes(damaged)
        try:
            found: DeliveryQueue | str = store.load()
        except ConfigError as error:
            found = str(error)
        if isinstance(found, str):
            assert str(store.path) in found
            assert 'move it away' in found
        else:
            assert found == queue  # only space between its parts was hit
        assert store.path.read_bytes() == damaged
    finally:
        store.close()


def test_no_file_is_an_empty_queue(tmp_path: Path) -> None:
    assert DeliveryStore(tmp_path / 'deep' / 'queue.json').load() == DeliveryQueue()


def damage(path: Path, change: Any) -> None:
    content = json.loads(path.read_text(encoding='utf-8'))
    change(content)
    path.write_text(json.dumps(content), encoding='utf-8')


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda c: c.update(schema='menu'), 'schema: got .menu.'),
        (lambda c: c.update(version=2), 'version: got 2, expected 1'),
        (lambda c: c.update(version=True), 'version: got True'),
        (lambda c: c.pop('deliveries'), 'deliveries: got None'),
        (lambda c: c.update(checksum='sha256:0'), 'checksum: got'),
        (lambda c: c['deliveries'].pop(), 'checksum: got'),
        (lambda c: c['deliveries'].append(c['deliveries'][0]), 'deliveries: .*twice'),
        (lambda c: c['deliveries'][1].pop('index'), r'deliveries\[1\]: got'),
        (lambda c: c['deliveries'][1].update(index=-1), r'deliveries\[1\]\.index: got -1'),
        (lambda c: c['deliveries'][1].update(index=5), r'deliveries\[1\]\.index: got 5'),
        (
            lambda c: c['deliveries'][1].update(index=1),
            r'\[1\]\.index: got 1, .*reached',
        ),
        (lambda c: c['deliveries'][1].update(index=True), r'deliveries\[1\]\.index: got True'),
        (lambda c: c['deliveries'][1].update(stops=[]), r'deliveries\[1\]\.stops: got \[\]|index'),
        (lambda c: c['deliveries'][1].update(id=7), r'deliveries\[1\]\.id: got 7'),
        (lambda c: c['deliveries'][1].update(missed=[['a']]), r'missed\[0\]'),
        (
            lambda c: c['deliveries'][0]['stops'][2].update(pose=[1.0, 2.0]),
            r'deliveries\[0\]\.stops\[2\]\.pose',
        ),
        (
            lambda c: c['deliveries'][0]['stops'][2].update(pose=[1.0, math.nan, 0.0]),
            r'deliveries\[0\]\.stops\[2\]\.pose\[1\]: got nan',
        ),
        (lambda c: c['deliveries'][0]['stops'][2].update(wait=-1), r'stops\[2\]\.wait: got -1'),
    ],
)
def test_damage_is_named_by_file_and_place(tmp_path: Path, change: Any, words: str) -> None:
    store = DeliveryStore(tmp_path / 'queue.json')
    store.save(queue_of(2))
    damage(store.path, change)
    with pytest.raises(ConfigError, match=words) as caught:
        store.load()
    assert str(caught.value).startswith(str(store.path))
    assert 'move it away' in str(caught.value)


def test_broken_json_is_named_by_its_line(tmp_path: Path) -> None:
    store = DeliveryStore(tmp_path / 'queue.json')
    store.path.write_text('{\n "schema": "x",\n oops\n}', encoding='utf-8')
    with pytest.raises(ConfigError, match=r'queue\.json:3: got'):
        store.load()
    store.path.write_bytes(b'{"\xff"}')
    with pytest.raises(ConfigError, match='UTF-8'):
        store.load()


@pytest.mark.parametrize('step', ['os.fsync', 'pathlib.Path.replace', 'pathlib.Path.open'])
def test_disk_that_fails_at_any_step_leaves_the_old_queue(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    store = DeliveryStore(tmp_path / 'queue.json')
    store.save(queue_of(2))

    def fail(*_: Any, **__: Any) -> None:
        raise OSError(28, 'No space left on device')

    with monkeypatch.context() as patch:
        patch.setattr(step, fail)
        with pytest.raises(MissionError, match='No space left on device'):
            store.save(queue_of(5))
    assert store.load() == queue_of(2)
    store.save(queue_of(5))
    assert store.load() == queue_of(5)


def test_one_process_at_a_time(tmp_path: Path) -> None:
    store = DeliveryStore(tmp_path / 'queue.json')
    with pytest.raises(ConfigError, match=r'queue\.json.*no other process'):
        DeliveryStore(store.path)
    store.close()
    DeliveryStore(store.path).close()


def test_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('', encoding='utf-8')
    with pytest.raises(ConfigError, match='queue_file'):
        DeliveryStore(tmp_path / 'file' / 'queue.json')


def test_kill_in_the_middle_of_writing_loses_nothing_that_was_kept(tmp_path: Path) -> None:
    """Killed 30 times at any moment: the file holds the last queue kept, or the one being kept."""
    draw = random.Random(4)
    path = tmp_path / 'queue.json'
    for _ in range(30):
        kept, told = os.pipe()
        child = os.fork()
        if child == 0:  # writes one queue after the other, and tells each that is kept
            store = DeliveryStore(path)
            for count in range(1, 1_000_000):
                store.save(queue_of(count))
                os.write(told, count.to_bytes(4, 'little'))
            os._exit(1)
        os.close(told)
        first = os.read(kept, 4)
        time.sleep(draw.uniform(0.0, 0.02))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        with os.fdopen(kept, 'rb') as pipe:
            rest = pipe.read()
        last = int.from_bytes((first + rest)[-4:], 'little')
        store = DeliveryStore(path)
        assert store.load() in (queue_of(last), queue_of(last + 1))
        store.close()
