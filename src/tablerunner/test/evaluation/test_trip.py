"""The table of errors and the picture of a trip."""

from __future__ import annotations

import json
import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection

from tablerunner.cli.json_file import write_json
from tablerunner.errors import ConfigError
from tablerunner.evaluation.plots import draw_trip
from tablerunner.evaluation.plots.trip import draw_plan
from tablerunner.evaluation.trip import Halt, Trip, errors_table
from tablerunner.evaluation.truth import Truth
from tablerunner.geometry.pose import Pose2
from tablerunner.scenario import Scenario
from tablerunner.scenario.wall import Wall
from tablerunner.types import Anchor, Innovation, LosState, RangeSample

SECOND = 1_000_000_000


def make_trip() -> Trip:
    """Return ten seconds along x; the estimate is 0.3 m to the side."""
    stamps = np.arange(1, 101, dtype=np.int64) * SECOND // 10
    poses = np.column_stack([0.05 * np.arange(100), np.full(100, 0.3), np.zeros(100)])
    truth = Truth.from_poses(
        (int(stamp), Pose2(float(x), 0.0, 0.0), True)
        for stamp, (x, _, _) in zip(stamps, poses, strict=True)
    )
    return Trip(
        'A trip',
        'ekf',
        stamps,
        poses,
        np.broadcast_to(np.diag([0.01, 0.09, 0.01]), (100, 3, 3)),
        truth,
        poses[::10, :2] + [0.0, 0.1],
        stamps[::10],
        tuple(
            RangeSample(int(stamp), 'A0', 'tag', 0, 1.0, los=LosState(1 + index % 2))
            for index, stamp in enumerate(stamps)
        ),
        (Anchor('A0', (0.0, 3.0, 2.0)), Anchor('A1', (5.0, 3.0, 2.0))),
        tuple(
            Innovation(int(stamp), 'uwb/ranges', 'A0', True, '', np.zeros(1), np.eye(1), 1.0, 9.0)
            for stamp in stamps
        ),
        (Halt(int(stamps[50]), 1.5, 2.5, 0.0, (3.0, 0.5)), Halt(int(stamps[80]), 1.0, 4.0, 0.0)),
    )


def test_errors_table_by_hand(tmp_path: Path) -> None:
    table = errors_table(make_trip())
    for name in ('rmse', 'mean', 'max', 'final'):
        assert table['position_error'][name] == pytest.approx(0.3)
        assert table['uwb_only_error'][name] == pytest.approx(0.4)
    assert table['duration'] == pytest.approx(9.9)
    assert table['heading_rmse'] == 0.0
    # 0.3 m at a standard deviation of 0.3 m, in three dimensions.
    assert table['nees']['mean'] == pytest.approx(1.0 / 3.0)
    assert table['nees']['dimensions'] == 3
    assert table['sources']['uwb/ranges']['nis'] == pytest.approx(1.0)
    assert table['ranges'] == 100
    assert table['nlos_ranges'] == 50
    assert table['halts'] == [
        {
            'after': pytest.approx(5.0),
            'duration': 1.5,
            'x': 2.5,
            'y': 0.0,
            'for_a_person': True,
            'emergency': False,
        },
        {
            'after': pytest.approx(8.0),
            'duration': 1.0,
            'x': 4.0,
            'y': 0.0,
            'for_a_person': False,
            'emergency': False,
        },
    ]
    write_json(tmp_path / 'deep' / 'errors.json', table)
    assert json.loads((tmp_path / 'deep' / 'errors.json').read_text())['estimator'] == 'ekf'


def test_errors_table_without_truth_has_null_figures(tmp_path: Path) -> None:
    trip = Trip('x', '', np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3, 3)))
    table = errors_table(trip)
    assert math.isnan(table['position_error']['rmse'])
    write_json(tmp_path / 'errors.json', table)
    assert json.loads((tmp_path / 'errors.json').read_text())['position_error']['rmse'] is None


def test_trip_places_truth_first_else_nearest_estimate() -> None:
    trip = make_trip()
    places = trip.places([int(trip.stamps[10]), 100 * SECOND])
    np.testing.assert_allclose(places, [[0.5, 0.0], [4.95, 0.3]])


def picture_size(file: Path) -> tuple[int, int]:
    """Return width and height of a PNG by its head."""
    data = file.read_bytes()
    assert data[:8] == b'\x89PNG\r\n\x1a\n'
    width, height = struct.unpack('>II', data[16:24])
    return width, height


def test_draw_trip_in_a_room_writes_a_picture(tmp_path: Path) -> None:
    room = Scenario(
        name='room', walls=(Wall(points=((-1, -2), (7, -2), (7, 4), (-1, 4)), closed=True),)
    )
    draw_trip(make_trip(), room, tmp_path / 'out' / 'trip.png', dpi=60)
    width, height = picture_size(tmp_path / 'out' / 'trip.png')
    assert width == 540
    assert height > 400


def test_draw_trip_shows_each_part(tmp_path: Path) -> None:
    """Leaving a part out changes the picture: each is really drawn."""
    trip = make_trip()
    pictures = {}
    for name, changes in {
        'all': {},
        'no truth': {'truth': Truth.from_poses(())},
        'no fixes': {'fixes': np.empty((0, 2)), 'fix_stamps': np.empty(0, np.int64)},
        'no rays': {'ranges': ()},
        'no halts': {'halts': ()},
        'no ellipses': {'covariances': np.zeros((100, 3, 3))},
    }.items():
        draw_trip(replace(trip, **changes), None, tmp_path / 'trip.png', dpi=50)
        pictures[name] = (tmp_path / 'trip.png').read_bytes()
    assert len(set(pictures.values())) == len(pictures)


def test_draw_plan_draws_a_ray_for_each_range_without_sight() -> None:
    """Each goes from where the robot was to the anchor."""
    figure, axes = plt.subplots()
    axes.set_xlim(0.0, 6.0)
    draw_plan(axes, make_trip())
    (rays,) = (item for item in axes.collections if isinstance(item, LineCollection))
    segments = rays.get_segments()
    plt.close(figure)
    assert len(segments) == 50
    np.testing.assert_allclose(segments[3], [[0.35, 0.0], [0.0, 3.0]])


def test_draw_trip_with_nothing_known_still_draws(tmp_path: Path) -> None:
    trip = Trip('x', '', np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3, 3)))
    draw_trip(trip, None, tmp_path / 'trip.png', dpi=50)
    assert picture_size(tmp_path / 'trip.png')[0] == 450


def test_draw_trip_file_that_cannot_be_written_raises(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(ConfigError, match='a file to write'):
        draw_trip(make_trip(), None, tmp_path / 'file' / 'trip.png', dpi=50)
