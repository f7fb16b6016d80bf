"""Anchors from drives: how far off, how honest, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablerunner.errors import ConfigError
from tablerunner.evaluation.consistency import chi_square_bounds
from tablerunner.experiments.survey import (
    ANCHORS,
    CALIBRATED,
    CASES,
    GIVEN,
    NEES_SLACK,
    Recorded,
    judge,
)
from tablerunner.survey.record import RangeTable, SurveyConfig, SurveyData
from tablerunner.survey.survey import survey
from tablerunner.survey.track import Track

CONFIG = CASES['two anchors given'][1]


def test_anchors_are_right_and_say_how_right(drives: list[Recorded]) -> None:
    """Twenty drives of 40 m: the asked 0.05 m, and errors as large as they are said to be."""
    found = [judge(survey(drive.data, CONFIG)) for drive in drives]
    assert max(item.rms for item in found) < 0.05
    dimensions = sum(item.dimensions for item in found)
    low, high = chi_square_bounds(dimensions)
    mean = float(np.mean([item.nees for item in found]))
    assert low / dimensions / NEES_SLACK < mean < high / dimensions * NEES_SLACK


def test_the_start_fixes_the_map(drives: list[Recorded]) -> None:
    data = drives[0].data
    here = survey(data, replace(CALIBRATED, start=(0.0, 0.0, 0.0)))
    there = survey(data, replace(CALIBRATED, start=(3.0, 3.0, np.pi / 2)))
    turned = np.column_stack([-here.positions[:, 1], here.positions[:, 0]]) + 3.0
    # One problem in two frames: as far as the descent settles.
    np.testing.assert_allclose(turned, there.positions[:, :2], atol=2e-3)
    assert judge(there).rms < 0.1


def test_given_anchors_stay_where_they_are(drives: list[Recorded]) -> None:
    found = survey(drives[1].data, CONFIG)
    by_name = {item.anchor_id: item for item in found.anchors}
    for name, place in GIVEN.items():
        assert tuple(by_name[name].position[:2]) == place
        assert not by_name[name].std[:2].any()
    assert by_name['A2'].std[0] > 0.0


def test_biases_are_found_as_far_as_they_show(drives: list[Recorded]) -> None:
    """An anchor that reads 0.15 m too long: within three of its stated deviations."""
    data = drives[2].data
    more = np.where(data.ranges.anchor == 2, 0.15, 0.0)
    table = replace(data.ranges, range_m=data.ranges.range_m + more)
    heights = {name: place[2] for name, place in ANCHORS.items()}
    found = survey(replace(data, ranges=table), SurveyConfig(fixed=GIVEN, heights=heights))
    for item in found.anchors:
        true = 0.15 if item.anchor_id == 'A2' else 0.0
        assert abs(item.bias_m - true) < 3.0 * item.bias_std_m
    assert found.anchors[2].bias_std_m < 0.08  # less than what was believed before


def test_blocked_ranges_are_left_out(drives: list[Recorded]) -> None:
    """A tenth of one anchor's ranges, in a row, by up to a metre: found, and no harm done."""
    data = drives[3].data
    own = np.flatnonzero(data.ranges.anchor == 2)
    some = own[len(own) // 4 : len(own) // 4 + len(own) // 10]
    ranges = data.ranges.range_m.copy()
    ranges[some] += np.random.default_rng(0).uniform(0.4, 1.0, len(some))
    found = survey(replace(data, ranges=replace(data.ranges, range_m=ranges)), CONFIG)
    assert judge(found).rms < 0.05
    assert found.anchors[2].blocked == pytest.approx(0.1, abs=0.03)


def test_ranges_between_anchors_make_it_more_certain(drives: list[Recorded]) -> None:
    data = drives[4].data
    rng = np.random.default_rng(1)
    names = list(ANCHORS)
    links = {
        (one, two): np.linalg.norm(np.subtract(ANCHORS[one], ANCHORS[two]))
        + rng.normal(0.0, 0.1, 50)
        for index, one in enumerate(names)
        for two in names[index + 1 :]
    }
    alone = survey(data, replace(CALIBRATED, start=(3.0, 3.0, np.pi / 2)))
    more = survey(replace(data, links=links), replace(CALIBRATED, start=(3.0, 3.0, np.pi / 2)))
    assert judge(more).shape < 0.05
    assert np.trace(more.covariance) < np.trace(alone.covariance)


def cut(data: SurveyData, names: tuple[str, ...]) -> SurveyData:
    keep = np.isin(data.ranges.anchor, [data.ranges.ids.index(name) for name in names])
    table = data.ranges
    return replace(
        data,
        ranges=RangeTable(table.ids, table.stamps[keep], table.anchor[keep], table.range_m[keep]),
    )


def until(data: SurveyData, way_m: float) -> SurveyData:
    return replace(data, track=data.track.cut(int(np.searchsorted(data.track.way, way_m))))


@pytest.mark.parametrize(
    ('change', 'config', 'words'),
    [
        (lambda d: cut(d, ('A0', 'A1')), CALIBRATED, '3 anchors or more with 20 ranges'),
        (lambda d: d, replace(CALIBRATED, fixed={'B7': (0.0, 0.0), 'A1': (1.0, 0.0)}), 'B7'),
        (lambda d: d, replace(CALIBRATED, fixed={'A1': (1.0, 0.0)}), 'two anchors, or none'),
        (lambda d: d, replace(CALIBRATED, heights={'A9': 2.0}), 'A9'),
        (lambda d: until(d, 2.0), CALIBRATED, '3 m or more'),
        (lambda d: until(d, 8.0), CALIBRATED, 'straight'),
        (
            lambda d: d,
            replace(CALIBRATED, fixed={'A0': (0.0, 0.0), 'A1': (13.0, 0.0)}),
            'A0 and A1 13.00 m apart',
        ),
    ],
)
def test_what_cannot_be_surveyed_is_named(
    drives: list[Recorded], change: object, config: SurveyConfig, words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        survey(change(drives[0].data), config)


def test_two_sides_that_look_alike_are_named() -> None:
    """A way with a bow of 0.4 m: too little to tell on which side a far anchor is."""
    along = np.linspace(0.0, 8.0, 800)
    aside = 0.4 * np.sin(np.pi * along / 8.0)
    heading = np.arctan(0.4 * np.pi / 8.0 * np.cos(np.pi * along / 8.0))
    stamps = (1 + np.arange(800)) * 20_000_000
    rng = np.random.default_rng(0)
    which = np.arange(800) % 3
    places = np.array([[1.0, 1.5], [4.0, 9.0], [7.0, -1.5]])
    ranges = np.hypot(*(np.column_stack([along, aside]) - places[which]).T)
    table = RangeTable(('A', 'B', 'C'), stamps, which, ranges + rng.normal(0.0, 0.1, 800))
    track = Track(stamps, np.column_stack([along, aside, heading]))
    data = SurveyData(track, table, (0.0, 0.0, 0.0))
    heights = dict.fromkeys('ABC', 0.0)
    with pytest.raises(ConfigError, match=r'anchor [ABC].*as well as.*round corners'):
        survey(data, SurveyConfig(heights=heights))
