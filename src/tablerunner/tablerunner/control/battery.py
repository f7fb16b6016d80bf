"""Whether the charge suffices for another delivery."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.types import Refusal, seconds

_LOW_AGAIN = 0.02  # a charge that has been low is low until it is so much above the limit


@dataclass(frozen=True)
class BatteryConfig(Config):
    """When the battery counts as low."""

    min_charge: float = parameter(
        0.2,
        description='Share of the full charge below which no delivery is taken',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    timeout: float = parameter(
        60.0,
        description='A charge that was heard longer ago is not known any more',
        unit='s',
        above=0.0,
        dynamic=True,
    )


class Battery:
    """Remembers the last charge; what is not known does not keep the robot from its work.

    Parameters
    ----------
    config : BatteryConfig
    """

    def __init__(self, config: BatteryConfig) -> None:
        self.config = config
        self._charge = math.nan
        self._stamp = 0
        self._low = False

    def take(self, charge: float, stamp: int, source: str = 'battery_state') -> Refusal | None:
        """Take a charge, 0 to 1, NaN where the battery does not tell; `stamp` [ns] on arrival."""
        if not (math.isnan(charge) or 0.0 <= charge <= 1.0):
            return Refusal(stamp, source, '', 'charge is not a share from 0 to 1')
        self._charge, self._stamp = charge, stamp
        if not math.isnan(charge):
            limit = self.config.min_charge
            self._low = charge < limit + (_LOW_AGAIN if self._low else 0.0)
        return None

    def charge(self, stamp: int) -> float:
        """Return the charge, 0 to 1; NaN: not known, or too long ago."""
        age = seconds(stamp - self._stamp)
        return self._charge if 0.0 <= age <= self.config.timeout else math.nan

    def is_low(self, stamp: int) -> bool:
        """Return whether the charge is known and too low."""
        return self._low and not math.isnan(self.charge(stamp))

    def words(self, stamp: int) -> str:
        """Return the charge in words."""
        charge = self.charge(stamp)
        return 'not known' if math.isnan(charge) else f'{100.0 * charge:.0f} %'
