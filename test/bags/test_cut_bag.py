"""A recorded bag that was cut off: used up to the cut, and the user is told what is missing."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tablerunner.bags.reader import BagReader
from tablerunner_ros.testing.domain import lease_domain
from tablerunner_ros.testing.process import environment

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture
def cut(recorded, tmp_path) -> Path:
    """Return a copy of the recorded bag of which the second half of the file is gone."""
    copy = tmp_path / 'cut'
    shutil.copytree(recorded.bag, copy)
    (file,) = copy.glob('*.mcap')
    with file.open('r+b') as stream:
        stream.truncate(file.stat().st_size // 2)
    return copy


def command(*arguments: str | Path, domain: int = 0) -> subprocess.CompletedProcess[str]:
    """Run `tablerunner` and return how it ended."""
    return subprocess.run(
        ['tablerunner', *map(str, arguments)],
        env=environment(domain),
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )


def test_replay_cut_bag_gives_the_beginning_bit_for_bit(recorded, cut):
    """Up to the cut the estimates are those of the whole bag."""
    whole = recorded.replay().estimates
    result = dataclasses.replace(recorded, bag=cut).replay()
    count = len(result.estimates.stamps)
    assert 0.25 * len(whole.stamps) < count < 0.75 * len(whole.stamps)
    for name in ('stamps', 'poses', 'covariances', 'trusted'):
        left, all_of_it = getattr(result.estimates, name), getattr(whole, name)
        assert left.tobytes() == all_of_it[:count].tobytes(), name
    assert result.damage


def test_replay_command_cut_bag_says_what_is_missing(recorded, cut, tmp_path):
    """It does its job, exit code 0, and names file, place and the topics with what they lack."""
    start = recorded.scenario.start_pose
    file = tmp_path / 'figures.json'
    run = command(
        *('replay', cut, '--scenario', recorded.bag.parent / 'scenario.yaml', '--json', file),
        *('--start', f'{start.x},{start.y},{start.heading}'),
    )
    assert run.returncode == 0, run.stderr
    with BagReader(cut) as bag:
        found = {topic.name: topic.count for topic in bag.topics}
    size = next(cut.glob('*.mcap')).stat().st_size
    place = re.search(r'\.mcap, byte (\d+): .*cut off', run.stderr)
    assert place, run.stderr
    assert 0.8 * size < int(place[1]) <= size
    for topic in recorded.inputs:
        assert (
            f'{topic}: {recorded.counts[topic]} messages are named, {found[topic]} were found'
            in run.stderr
        )
    figures = json.loads(file.read_text(encoding='utf-8'))
    assert len(figures['damage']) == run.stderr.count('damaged: ')
    assert figures['rmse'] < 0.1
    assert figures['data_seconds'] == pytest.approx(0.5 * length_s(recorded.bag), rel=0.3)


def length_s(bag: Path) -> float:
    """Return the time from the first message of a bag to its last [s]."""
    with BagReader(bag) as reader:
        return (reader.end - reader.start) * 1e-9


@pytest.mark.parametrize(
    'arguments', [('info',), ('play', '--topics', '/uwb/anchors', '--no-clock')]
)
def test_other_commands_cut_bag_say_what_is_missing(cut, arguments):
    """`info` and `play` use what is there, too, and say the same."""
    name, *options = arguments
    with lease_domain() as domain:
        run = command(name, cut, *options, domain=domain)
    assert run.returncode == 0, run.stderr
    assert 'cut off' in run.stdout + run.stderr
    assert 'messages are named' in run.stdout + run.stderr
