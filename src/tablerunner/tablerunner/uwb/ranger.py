"""From exchanges, or a device's ranges, to calibrated ranges; refuses what cannot be right."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tablerunner.config import Config, parameter
from tablerunner.errors import ConfigError
from tablerunner.stream import Order, StampOrder
from tablerunner.types import Anchor, ExchangeSample, LosState, RangeSample, Refusal
from tablerunner.uwb import ranging
from tablerunner.uwb.nlos.range_judge import NLOS_TESTS, RangeJudge
from tablerunner.uwb.nlos.range_variance import variance_threshold

SOURCE = 'uwb/exchanges'
DEVICE_SOURCE = 'uwb/device'

_LONGEST_EXCHANGE_TICKS = 0.1 / ranging.TICK_S


@dataclass(frozen=True)
class RangerConfig(Config):
    """What the ranging needs to know of the anchors and of the radio."""

    anchor_ids: tuple[str, ...] = parameter((), description='Names of the anchors')
    anchor_positions: tuple[float, ...] = parameter(
        (), unit='m', description='x, y, z of each anchor in map, one after the other'
    )
    anchor_biases: tuple[float, ...] = parameter(
        (),
        unit='m',
        description='How much too long each anchor reads; empty: 0 for all (Sun 35)',
        low=-5.0,
        high=5.0,
    )
    anchor_scales: tuple[float, ...] = parameter(
        (),
        description='Share by which each anchor reads too long; empty: 0 for all (Sun 35)',
        low=-0.2,
        high=0.2,
    )
    range_std: float = parameter(
        0.1,
        unit='m',
        description='Standard deviation of a line-of-sight range',
        above=0.0,
        high=5.0,
        dynamic=True,
    )
    max_range: float = parameter(
        60.0,
        unit='m',
        description='Ranges beyond this are refused',
        above=0.0,
        high=1000.0,
        dynamic=True,
    )
    nlos_test: str = parameter(
        'signal_quality',
        description='What judges each range: signal_quality, range_variance (Liu 12-13) or none',
        choices=NLOS_TESTS,
        dynamic=True,
    )
    nlos_gap_centre: float = parameter(
        8.0,
        unit='dB',
        description='Receive minus first-path power at which NLOS is as likely as not',
        low=0.0,
        high=40.0,
        dynamic=True,
    )
    nlos_gap_width: float = parameter(
        1.0,
        unit='dB',
        description='Width of the change from likely LOS to likely NLOS',
        above=0.0,
        high=20.0,
        dynamic=True,
    )

    nlos_window: int = parameter(
        20,
        description='Differences of ranges that range_variance looks at, for each anchor',
        low=2,
        high=1000,
        dynamic=True,
    )
    nlos_variance_factor: float = parameter(
        1.5,
        description='Variance of differences over that of clear ranges from which on it is NLOS',
        above=0.0,
        high=1000.0,
        dynamic=True,
    )
    nlos_offset: float = parameter(
        0.0,
        unit='m',
        description='What is taken off a range that is judged NLOS (Sun 37); 0: nothing',
        low=0.0,
        high=5.0,
        dynamic=True,
    )

    def check(self) -> None:
        """Check that the lists belong together and no anchor stands twice."""
        count = len(self.anchor_ids)
        if len(self.anchor_positions) != 3 * count:
            raise ConfigError(
                'anchor_positions',
                self.anchor_positions,
                f'{3 * count} numbers, x, y, z for each of {count} anchor_ids',
            )
        for name in ('anchor_biases', 'anchor_scales'):
            values = getattr(self, name)
            if values and len(values) != count:
                raise ConfigError(name, values, f'{count} numbers, one for each of anchor_ids')
        for index, anchor_id in enumerate(self.anchor_ids):
            if not anchor_id:
                raise ConfigError(f'anchor_ids[{index}]', anchor_id, 'a name')
            if anchor_id in self.anchor_ids[:index]:
                raise ConfigError(f'anchor_ids[{index}]', anchor_id, 'each anchor once')

    @property
    def anchors(self) -> tuple[Anchor, ...]:
        """The anchors as records; their bias is zero, since ranges leave here calibrated."""
        return tuple(
            Anchor(anchor_id, self.anchor_positions[3 * i : 3 * i + 3])  # type: ignore[arg-type]
            for i, anchor_id in enumerate(self.anchor_ids)
        )


class Ranger:
    """Turns exchanges or raw ranges into ranges; remembers what came last of each anchor."""

    def __init__(self, config: RangerConfig) -> None:
        self._sequence: dict[tuple[str, str], int] = {}
        self._order: dict[tuple[str, str], StampOrder] = {}
        self.configure(config)

    def configure(self, config: RangerConfig) -> None:
        """Use other settings from now on; the NLOS test begins anew."""
        self.config = config
        self._judge = RangeJudge(
            config.nlos_test,
            (config.nlos_gap_centre, config.nlos_gap_width),
            variance_threshold(config.range_std, config.nlos_variance_factor),
            config.nlos_window,
        )
        count = len(config.anchor_ids)
        biases = config.anchor_biases or (0.0,) * count
        scales = config.anchor_scales or (0.0,) * count
        self._calibration = dict(
            zip(config.anchor_ids, zip(biases, scales, strict=True), strict=True)
        )

    def reset(self) -> None:
        """Forget the sequence numbers and ranges, as after a jump back in time."""
        self._sequence.clear()
        self._order.clear()
        self._judge.reset()

    def add(self, sample: ExchangeSample) -> RangeSample | Refusal:
        """Return the range of one exchange, or why there is none.

        Refused are a zero stamp, an unknown anchor, a repeated sequence number, a stamp that does
        not advance, times that no exchange can have, and a range that is negative or too long.
        """
        if sample.anchor_id not in self._calibration:
            return self._refuse(sample, 'unknown anchor')
        link = (sample.anchor_id, sample.tag_id)
        if sample.stamp > 0 and self._sequence.get(link) == sample.sequence:
            return self._refuse(sample, 'repeated sequence number')
        order = self._order.setdefault(link, StampOrder()).judge(sample.stamp)
        if order in (Order.ZERO, Order.LATE):
            return self._refuse(sample, order.value)
        self._sequence[link] = sample.sequence
        times = ranging.intervals(
            sample.poll_tx,
            sample.poll_rx,
            sample.response_tx,
            sample.response_rx,
            sample.final_tx,
            sample.final_rx,
        )
        if min(times) <= 0 or sum(times) > _LONGEST_EXCHANGE_TICKS:
            return self._refuse(sample, 'impossible exchange times')
        return self._finish(sample, ranging.distance(ranging.double_sided(*times)), SOURCE)

    def take(self, sample: RangeSample) -> RangeSample | Refusal:
        """Return the calibrated range of one that a device has measured, or why there is none.

        Refused are the same as of exchanges, but for their times and the sequence number, which
        is the device's own matter.

        Parameters
        ----------
        sample : RangeSample
            With the range as the device gave it.
        """
        if sample.anchor_id not in self._calibration:
            return self._refuse(sample, 'unknown anchor', DEVICE_SOURCE)
        link = (sample.anchor_id, sample.tag_id)
        order = self._order.setdefault(link, StampOrder()).judge(sample.stamp)
        if order in (Order.ZERO, Order.LATE):
            return self._refuse(sample, order.value, DEVICE_SOURCE)
        return self._finish(sample, sample.range_m, DEVICE_SOURCE)

    def _finish(
        self, sample: ExchangeSample | RangeSample, raw: float, source: str
    ) -> RangeSample | Refusal:
        """Calibrate a raw range and judge whether its line was free."""
        bias, scale = self._calibration[sample.anchor_id]
        range_m = ranging.calibrated(raw, bias, scale)
        if not range_m > 0.0:
            return self._refuse(sample, 'negative range', source)
        if range_m > self.config.max_range:
            return self._refuse(sample, 'range beyond max_range', source)
        probability = self._judge.probability(
            sample.anchor_id, range_m, sample.rx_power_dbm, sample.first_path_power_dbm
        )
        state = _los_state(probability)
        if state is LosState.NLOS:
            # A blocked range that is shorter than what is taken off stays as it is.
            corrected = float(ranging.nlos_corrected(range_m, True, self.config.nlos_offset))
            range_m = corrected if corrected > 0.0 else range_m
        return RangeSample(
            sample.stamp,
            sample.anchor_id,
            sample.tag_id,
            sample.sequence,
            range_m,
            self.config.range_std**2,
            raw,
            sample.rx_power_dbm,
            sample.first_path_power_dbm,
            state,
            probability,
        )

    @staticmethod
    def _refuse(
        sample: ExchangeSample | RangeSample, reason: str, source: str = SOURCE
    ) -> Refusal:
        return Refusal(sample.stamp, source, sample.anchor_id, reason)


def _los_state(probability: float) -> LosState:
    if math.isnan(probability):
        return LosState.UNKNOWN
    return LosState.NLOS if probability > 0.5 else LosState.LOS
