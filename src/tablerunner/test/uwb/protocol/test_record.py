"""A device's range under the name of the anchor in the map."""

import math

from tablerunner.types import RangeSample, Refusal
from tablerunner.uwb.protocol import DeviceRange, to_sample

RANGE = DeviceRange(5, 'tag7', 'anchor3', 2.5, 0.9, -79.0, -81.0, ticks=7)


def test_known_anchor_gets_its_name_and_keeps_what_was_measured():
    sample = to_sample(RANGE, {'anchor3': 'north'}, 'tag', stamp=4, sequence=11)
    assert isinstance(sample, RangeSample)
    assert (sample.anchor_id, sample.tag_id) == ('north', 'tag7')
    assert (sample.sequence, sample.stamp) == (11, 4)
    assert (sample.range_m, sample.raw_range_m) == (2.5, 2.5)
    assert (sample.rx_power_dbm, sample.first_path_power_dbm) == (-79.0, -81.0)
    assert sample.variance_m2 == 0.0


def test_unknown_anchor_is_refused_where_names_are_given():
    refusal = to_sample(RANGE, {'anchor4': 'south'}, 'tag')
    assert refusal == Refusal(5, 'device', 'anchor3', 'unknown anchor')


def test_without_names_ids_stay_and_the_device_says_sequence_and_tag():
    sample = to_sample(DeviceRange(5, '', '022E', 1.0, sequence=3), {}, 'tag', sequence=11)
    assert (sample.anchor_id, sample.tag_id, sample.sequence, sample.stamp) == (
        '022E',
        'tag',
        3,
        5,
    )
    assert math.isnan(sample.rx_power_dbm)
