"""Exchanges, ranges, anchors and innovations: there and back, and what is refused."""

from __future__ import annotations

import math
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from tablerunner.types import (
    Anchor,
    ExchangeSample,
    Innovation,
    LosState,
    RangeSample,
    Refusal,
)
from tablerunner_ros.conversions.anchors import anchors_from_message, anchors_to_message
from tablerunner_ros.conversions.exchange import exchange_from_message, exchange_to_message
from tablerunner_ros.conversions.innovation import innovation_from_message, innovation_to_message
from tablerunner_ros.conversions.uwb_range import range_from_message, range_to_message
from tablerunner_ros.testing.strategies import (
    lengths,
    positive,
    stamps,
    unknown,
    words,
)

ticks = st.integers(0, 2**40 - 1)
sequences = st.integers(0, 2**32 - 1)
powers = st.one_of(st.floats(-120.0, 0.0, width=32), unknown)
probabilities = st.one_of(st.floats(0.0, 1.0, width=32), unknown)


def wired(message: Any) -> Any:
    """Return a message as it comes out of DDS."""
    return deserialize_message(serialize_message(message), type(message))


def equal(left: Any, right: Any) -> bool:
    """Compare records field by field; NaN equals NaN."""
    return all(
        a == b or (a != a and b != b) for a, b in zip(astuple(left), astuple(right), strict=True)
    )


@given(
    st.builds(
        ExchangeSample,
        stamps,
        words,
        words,
        sequences,
        *[ticks] * 6,
        rx_power_dbm=powers,
        first_path_power_dbm=powers,
    )
)
def test_exchange_there_and_back_is_the_same(sample: ExchangeSample) -> None:
    """All forty bits of each counter survive."""
    assert equal(exchange_from_message(wired(exchange_to_message(sample, 'uwb_tag'))), sample)


@given(
    st.builds(
        RangeSample,
        stamps,
        words,
        words,
        sequences,
        st.one_of(lengths, unknown),
        st.one_of(lengths, unknown),
        st.one_of(lengths, unknown),
        powers,
        powers,
        st.sampled_from(LosState),
        probabilities,
    )
)
def test_range_there_and_back_is_the_same(sample: RangeSample) -> None:
    """Also values that the core will refuse: it is the core that judges them."""
    message = wired(range_to_message(sample, 'uwb_tag'))
    assert message.header.frame_id == 'uwb_tag'
    back = range_from_message(message)
    assert isinstance(back, RangeSample)
    assert equal(back, sample)


def test_range_of_unknown_line_of_sight_state_is_refused() -> None:
    """A number that stands for nothing."""
    message = range_to_message(RangeSample(5, 'a', 't', 1, 2.0), 'uwb_tag')
    message.los = 9
    assert range_from_message(message) == Refusal(
        5, 'uwb/ranges', 'a', 'unknown line-of-sight state'
    )


@given(
    st.lists(
        st.builds(Anchor, words, st.tuples(lengths, lengths, lengths), lengths, positive),
        max_size=5,
        unique_by=lambda anchor: anchor.anchor_id,
    ),
    stamps,
)
def test_anchors_there_and_back_are_the_same(anchors: list[Anchor], stamp: int) -> None:
    """Names, places, biases and variances, in their order."""
    message = wired(anchors_to_message(anchors, stamp, 'map'))
    assert anchors_from_message(message, 'map') == tuple(anchors)


@pytest.mark.parametrize(
    ('change', 'key', 'reason'),
    [
        (lambda m: setattr(m.header, 'frame_id', 'odom'), '', 'not in frame map'),
        (lambda m: setattr(m.anchors[1].position, 'z', math.nan), 'b', 'anchor is not finite'),
        (lambda m: setattr(m.anchors[1], 'bias', math.inf), 'b', 'anchor is not finite'),
        (lambda m: m.anchors[1].covariance.__setitem__(0, math.nan), 'b', 'anchor is not finite'),
        (lambda m: m.anchors[1].covariance.__setitem__(slice(None), -1.0), 'b', 'negative'),
        (lambda m: setattr(m.anchors[1], 'anchor_id', 'a'), 'a', 'anchor named twice'),
    ],
)
def test_anchors_malformed_are_refused(change: Any, key: str, reason: str) -> None:
    """One bad anchor refuses the list: half a list would be another room."""
    message = anchors_to_message(
        [Anchor('a', (0.0, 0.0, 2.0)), Anchor('b', (1.0, 0.0, 2.0))], 4, 'map'
    )
    change(message)
    result = anchors_from_message(wired(message), 'map')
    assert isinstance(result, Refusal)
    assert (result.stamp, result.source, result.key) == (4, 'uwb/anchors', key)
    assert result.reason.startswith(reason)


@given(st.integers(0, 3), stamps, st.booleans(), words, st.floats(0.0, 100.0))
def test_innovation_there_and_back_is_the_same(
    size: int, stamp: int, accepted: bool, reason: str, nis: float
) -> None:
    """Vector and matrix of any size survive, an empty one too."""
    generator = np.random.default_rng(size)
    record = Innovation(
        stamp,
        'uwb/ranges',
        'a',
        accepted,
        reason,
        generator.normal(size=size),
        generator.normal(size=(size, size)),
        nis,
        math.inf,
    )
    message = wired(innovation_to_message(record, 'map', 'ekf'))
    assert (message.header.frame_id, message.estimator) == ('map', 'ekf')
    back = innovation_from_message(message)
    np.testing.assert_array_equal(back.innovation, record.innovation)
    np.testing.assert_array_equal(back.covariance, record.covariance)
    assert (back.stamp, back.source, back.key) == (stamp, 'uwb/ranges', 'a')
    assert (back.accepted, back.reason, back.nis, back.gate) == (accepted, reason, nis, math.inf)


def test_innovation_of_a_transposed_matrix_keeps_rows_and_columns() -> None:
    """A matrix that lies column by column in memory is still written row by row."""
    matrix = np.array([[1.0, 2.0], [3.0, 4.0]]).T
    record = Innovation(1, 's', '', True, '', np.zeros(2), matrix)
    message = innovation_to_message(record, 'map', 'ekf')
    assert list(message.variance) == [1.0, 3.0, 2.0, 4.0]
