"""What every estimator of the robot's pose can do, whatever is inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.estimation.particles.config import ParticleConfig
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion, MotionNoise
from tablerunner.types import (
    Estimate,
    HeadingSample,
    Innovation,
    Matrix,
    PoseSample,
    RangeSample,
    Vector,
)

Measurement = RangeSample | PoseSample | HeadingSample
"""What an estimator can be corrected by."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where an estimator begins: a pose, and range biases if they came out with it."""

    stamp: int
    pose: Vector  # (3,): x, y, heading of base_link in map
    pose_covariance: Matrix  # (3, 3)
    range_biases: Vector | None = None  # (anchors,)
    covariance: Matrix | None = None  # (3 + anchors, 3 + anchors), pose then biases
    anywhere: bool = False  # of a particle filter: nothing is known, the pose is the room's middle

    @classmethod
    def at(cls, sample: PoseSample) -> Start:
        """Return the start at a pose with heading, at its stamp."""
        pose = sample.pose
        vector = np.array([pose.x, pose.y, wrap(pose.heading)])
        return cls(sample.stamp, vector, sample.covariance)


RANGE_SOURCE = 'uwb/ranges'


@dataclass(frozen=True)
class SunConfig(Config):
    """Noise of `kf` and `ekf_cv`, which keep their own instead of the measurements'."""

    process_variance: float = parameter(
        0.4,
        description='Q of kf: variance of a displacement over its square (Sun)',
        low=0.0,
        high=100.0,
        dynamic=True,
    )
    position_variance: float = parameter(
        0.35,
        unit='m^2',
        description='R of kf: variance of a position (Sun)',
        above=0.0,
        high=100.0,
        dynamic=True,
    )
    largest_offset: float = parameter(
        0.4,
        unit='m',
        description='kf: a position farther from where odometry has it is not believed (Sun 2.6)',
        above=0.0,
        high=1e6,
        dynamic=True,
    )
    acceleration_density: float = parameter(
        0.4,
        unit='m^2/s^3',
        description='Q of ekf_cv: density of the white acceleration (Sun)',
        low=0.0,
        high=100.0,
        dynamic=True,
    )
    velocity_variance: float = parameter(
        0.001,
        unit='m^2/s',
        description='Variance of the velocity from odometry over one second',
        above=0.0,
        high=100.0,
        dynamic=True,
    )
    range_variance: float = parameter(
        0.35,
        unit='m^2',
        description='R of ekf_cv: variance of a range (Sun)',
        above=0.0,
        high=100.0,
        dynamic=True,
    )


@dataclass(frozen=True)
class DdfConfig(Config):
    """When `ddf` corrects how much (Liu)."""

    straight_speed: float = parameter(
        0.15,
        unit='m/s',
        description='Faster is straight on',
        low=0.0,
        high=10.0,
        dynamic=True,
    )
    straight_turn_rate: float = parameter(
        0.03,
        unit='rad/s',
        description='Turning less is straight on',
        low=0.0,
        high=10.0,
        dynamic=True,
    )
    turn_speed: float = parameter(
        0.1, unit='m/s', description='Slower is a turn', low=0.0, high=10.0, dynamic=True
    )
    turn_rate: float = parameter(
        0.65, unit='rad/s', description='Turning more is a turn', low=0.0, high=10.0, dynamic=True
    )
    position_std: float = parameter(
        0.1,
        unit='m',
        description='Added to the deviation of a position, for blocked ranges that went unnoticed',
        low=0.0,
        high=10.0,
        dynamic=True,
    )
    gate: float = parameter(
        6.6,
        description='Normalised innovation squared beyond which a position is refused',
        above=0.0,
        high=1e6,
        dynamic=True,
    )


@dataclass(frozen=True)
class EstimatorConfig(Config):
    """Noise and gates; each estimator uses what applies to it."""

    motion: MotionNoise = parameter(factory=MotionNoise, description='Noise of odometry')
    scale_std: float = parameter(
        0.02, description='Prior deviation of the wheels scale error', low=0.0, high=0.5
    )
    scale_walk: float = parameter(
        1e-4,
        unit='1/sqrt(m)',
        description='Random walk of the scale error',
        low=0.0,
        high=0.1,
        dynamic=True,
    )
    turn_scale_std: float = parameter(
        0.005,
        description='Prior deviation of the scale error of turns',
        low=0.0,
        high=0.5,
    )
    turn_scale_walk: float = parameter(
        1e-4,
        unit='1/sqrt(rad)',
        description='Random walk of the scale error of turns',
        low=0.0,
        high=0.1,
        dynamic=True,
    )
    gyro_bias_std: float = parameter(
        0.01,
        unit='rad/s',
        description='Prior deviation of what is left of the yaw rate bias',
        low=0.0,
        high=1.0,
    )
    gyro_bias_walk: float = parameter(
        2e-4,
        unit='rad/s/sqrt(s)',
        description='Random walk of the yaw rate bias',
        low=0.0,
        high=0.1,
        dynamic=True,
    )
    range_delay_std: float = parameter(
        0.03,
        unit='s',
        description='Prior deviation of the delay of the stamps of ranges',
        low=0.0,
        high=1.0,
    )
    range_delay_walk: float = parameter(
        1e-4,
        unit='s/sqrt(s)',
        description='Random walk of that delay: clocks drift',
        low=0.0,
        high=0.1,
        dynamic=True,
    )
    range_bias_common_std: float = parameter(
        0.1,
        unit='m',
        description='Prior deviation of the range bias that all anchors share',
        low=0.0,
        high=5.0,
    )
    range_bias_std: float = parameter(
        0.08,
        unit='m',
        description="Prior deviation of each anchor's own range bias",
        low=0.0,
        high=5.0,
    )
    range_bias_walk: float = parameter(
        2e-3,
        unit='m/sqrt(s)',
        description='Random walk of each range bias',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    range_scale_std: float = parameter(
        0.005,
        description="Prior deviation of each anchor's range error in proportion to the distance",
        low=0.0,
        high=0.2,
    )
    default_range_std: float = parameter(
        0.1,
        unit='m',
        description='Deviation of a range that comes without variance',
        above=0.0,
        high=5.0,
        dynamic=True,
    )
    least_range_std: float = parameter(
        0.005,
        unit='m',
        description='No range is believed to be better than this, whatever its message says',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    nlos_std: float = parameter(
        3.0,
        unit='m',
        # Not the size of the excess (0.2-1 m) but what it is worth: it stays nearly the same from
        # one range to the next, so that ten ranges a second must not weigh ten times as much.
        description='Added deviation of a range that is surely NLOS',
        low=0.0,
        high=20.0,
        dynamic=True,
    )
    huber: float = parameter(
        1.5,
        description='Innovation in standard deviations beyond which it loses weight',
        above=0.0,
        high=100.0,
        dynamic=True,
    )
    persistence: float = parameter(
        1.0,
        description=(
            'Mean innovation of an anchor, in standard deviations, beyond which it has been long '
            'for too long to be chance'
        ),
        above=0.0,
        high=4.0,
        dynamic=True,
    )
    persistence_share: float = parameter(
        0.1,
        description='Share of one range in that mean',
        above=0.0,
        high=1.0,
        dynamic=True,
    )
    persistence_count: float = parameter(
        20.0,
        description='How many ranges of an anchor that is long for a while tell as much as one',
        low=0.0,
        high=1000.0,
        dynamic=True,
    )
    doubt: float = parameter(
        1.0,
        description=(
            'The same for an anchor that has been short: nothing in the way makes it so, and the '
            'pose is doubted'
        ),
        above=0.0,
        high=4.0,
        dynamic=True,
    )
    doubt_std: float = parameter(
        0.3,
        unit='m/sqrt(s)',
        description='Noise of the place while it is doubted',
        low=0.0,
        high=10.0,
        dynamic=True,
    )
    doubt_turn_std: float = parameter(
        0.1,
        unit='rad/sqrt(s)',
        description='The same of the heading',
        low=0.0,
        high=10.0,
        dynamic=True,
    )
    doubt_limit: float = parameter(
        0.5,
        unit='m',
        description='Deviation of the place up to which it is doubted further',
        above=0.0,
        high=10.0,
        dynamic=True,
    )
    gate: float = parameter(
        16.0,
        description='Normalised innovation squared beyond which a range is refused',
        above=0.0,
        high=1e6,
        dynamic=True,
    )
    heading_gate: float = parameter(
        6.6,
        description='The same for a heading, as of a compass',
        above=0.0,
        high=1e6,
        dynamic=True,
    )
    pose_gate: float = parameter(
        16.3,
        description='The same for a pose or position (three numbers)',
        above=0.0,
        high=1e6,
        dynamic=True,
    )
    sun: SunConfig = parameter(factory=SunConfig, description='Of kf and ekf_cv')
    ddf: DdfConfig = parameter(factory=DdfConfig, description='Of ddf')
    particles: ParticleConfig = parameter(
        factory=ParticleConfig, description='Of pf, pf_ekf, pf_iekf and pf_uiekf'
    )


def no_use(
    estimate: Estimate, measurement: Measurement, reason: str
) -> tuple[Estimate, Innovation]:
    """Return the estimate as it is, and a refusal for a reason that is no gate's."""
    source = RANGE_SOURCE if isinstance(measurement, RangeSample) else measurement.source
    key = measurement.anchor_id if isinstance(measurement, RangeSample) else ''
    return estimate, Innovation(measurement.stamp, source, key, False, reason, considered=False)


class Estimator(Protocol):
    """Pure: takes an estimate, returns a new one; keeps nothing between calls."""

    @property
    def name(self) -> str:
        """Name by which it is chosen."""
        ...

    @property
    def takes_positions(self) -> bool:
        """Whether it needs ranges made into positions first."""
        ...

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states, in order; x, y, heading first."""
        ...

    def start(self, start: Start) -> Estimate:
        """Return the first estimate."""
        ...

    def predict(self, estimate: Estimate, motion: Motion, stamp: int) -> Estimate:
        """Return the estimate carried to `stamp` by a motion."""
        ...

    def update(self, estimate: Estimate, measurement: Measurement) -> tuple[Estimate, Innovation]:
        """Return the estimate corrected by a measurement of its stamp, and what happened."""
        ...

    def update_ranges(
        self, estimate: Estimate, samples: Sequence[RangeSample]
    ) -> tuple[Estimate, tuple[Innovation, ...]]:
        """Return the estimate corrected by ranges of one instant, and what each of them did."""
        ...


class RangeByRange:
    """Takes ranges of one instant one after the other: for estimators without a better way."""

    def update_ranges(
        self: Estimator, estimate: Estimate, samples: Sequence[RangeSample]
    ) -> tuple[Estimate, tuple[Innovation, ...]]:
        """Return the estimate corrected by ranges of one instant, and what each of them did."""
        innovations = []
        for sample in samples:
            estimate, innovation = self.update(estimate, sample)
            innovations.append(innovation)
        return estimate, tuple(innovations)
