"""A battery that is low, one that is not, and one that does not tell."""

from __future__ import annotations

import math

import pytest

from tablerunner.control import Battery, BatteryConfig
from tablerunner.types import NANOSECONDS

NOW = 100 * NANOSECONDS


def battery(*charges: float) -> Battery:
    item = Battery(BatteryConfig(min_charge=0.2, timeout=60.0))
    for charge in charges:
        assert item.take(charge, NOW) is None
    return item


@pytest.mark.parametrize(
    ('charge', 'low', 'words'),
    [(0.0, True, '0 %'), (0.19, True, '19 %'), (0.2, False, '20 %'), (1.0, False, '100 %')],
)
def test_charge_below_the_limit_is_low(charge: float, low: bool, words: str) -> None:
    item = battery(charge)
    assert item.is_low(NOW) is low
    assert item.words(NOW) == words


def test_unknown_charge_is_not_low_and_is_said() -> None:
    """Never heard, NaN, or heard too long ago."""
    assert not battery().is_low(NOW)
    for item, now in ((battery(), NOW), (battery(0.1, math.nan), NOW), (battery(0.1), 2 * NOW)):
        assert not item.is_low(now)
        assert item.words(now) == 'not known'
        assert math.isnan(item.charge(now))


def test_charge_about_the_limit_does_not_flicker() -> None:
    """Low once, it is low until it is clearly above."""
    assert battery(0.19, 0.21).is_low(NOW)
    assert not battery(0.19, 0.23).is_low(NOW)
    assert not battery(0.19, 0.23, 0.21).is_low(NOW)


@pytest.mark.parametrize('charge', [-0.01, 1.01, 87.0, math.inf, -math.inf])
def test_charge_that_is_no_share_is_refused(charge: float) -> None:
    item = battery(0.5)
    refusal = item.take(charge, NOW)
    assert refusal is not None
    assert refusal.reason == 'charge is not a share from 0 to 1'
    assert item.words(NOW) == '50 %'
