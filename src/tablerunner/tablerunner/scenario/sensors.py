"""How the simulated sensors and the simulated base err.

Localisation does not read this: what it believes of its sensors stands in its own configuration.
"""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config.parameter import Config, parameter
from tablerunner.errors import ConfigError


@dataclass(frozen=True)
class UwbErrors(Config):
    """Two-way ranging between the tag and each anchor."""

    rate: float = parameter(
        10.0, description='exchanges with each anchor per second', unit='Hz', above=0.0, high=50.0
    )
    range_std: float = parameter(
        0.08, description='noise of a range in plain sight', unit='m', low=0.0
    )
    bias_std: float = parameter(
        0.07, description='spread of the constant error of each anchor', unit='m', low=0.0
    )
    scale_std: float = parameter(
        0.005, description='spread of the error in proportion to the range', low=0.0, high=0.2
    )
    nlos_excess: tuple[float, float] = parameter(
        (0.2, 1.0), description='least and most excess behind a thing', unit='m', low=0.0
    )
    person_excess: tuple[float, float] = parameter(
        (0.1, 0.5), description='least and most excess behind a person', unit='m', low=0.0
    )
    nlos_hold: float = parameter(
        1.0, description='time over which the excess changes', unit='s', above=0.0
    )
    nlos_std: float = parameter(
        0.10, description='noise added to each range out of sight', unit='m', low=0.0
    )
    loss_probability: float = parameter(
        0.02, description='chance to lose an exchange in plain sight', low=0.0, high=1.0
    )
    nlos_loss_probability: float = parameter(
        0.10, description='chance to lose an exchange out of sight', low=0.0, high=1.0
    )
    clock_error_ppm: float = parameter(
        5.0,
        description='spread of the rate error of each device clock',
        unit='ppm',
        low=0.0,
        high=100.0,
    )
    clock_walk_ppm: float = parameter(
        0.02, description='random walk of the rate error, per root second', unit='ppm', low=0.0
    )
    reply_delay: tuple[float, float] = parameter(
        (0.0008, 0.0012), description='least and most reply delay', unit='s', above=0.0, high=0.01
    )
    power_std: float = parameter(1.0, description='noise of a power reading', unit='dB', low=0.0)

    def check(self) -> None:
        """Refuse ranges that are upside down."""
        for name in ('nlos_excess', 'person_excess', 'reply_delay'):
            low, high = getattr(self, name)
            if low > high:
                raise ConfigError(name, [low, high], 'the smaller value first')


@dataclass(frozen=True)
class WheelErrors(Config):
    """Encoders, motors and wheels."""

    rate: float = parameter(
        50.0, description='encoder readings per second', unit='Hz', above=0.0, high=100.0
    )
    ticks_per_turn: int = parameter(
        2048, description='encoder ticks per turn of a wheel; 0: not quantised', low=0
    )
    radius_scale_std: float = parameter(
        0.005, description='spread of the relative error of each wheel radius', low=0.0, high=0.2
    )
    radius_scale: tuple[float, float] = parameter(
        (0.0, 0.0),
        description='relative error of the left and the right wheel radius of this very robot',
        low=-0.5,
        high=0.5,
    )
    track_scale_std: float = parameter(
        0.01, description='spread of the relative error of the track', low=0.0, high=0.2
    )
    motor_lag: float = parameter(
        0.08, description='time constant of each wheel following its set speed', unit='s', low=0.0
    )
    slip_rate: float = parameter(
        0.02, description='slips of each wheel per second of driving', unit='1/s', low=0.0
    )
    slip_duration: float = parameter(
        0.3, description='mean length of a slip (exponential)', unit='s', above=0.0
    )
    slip_share: float = parameter(
        0.3, description='largest share of the motion that a slip loses', low=0.0, high=1.0
    )
    floor_noise: float = parameter(
        0.001,
        description='noise of the way of each wheel over the floor, per root metre',
        unit='m/m^0.5',
        low=0.0,
    )
    command_timeout: float = parameter(
        0.25, description='the base stops when the last command is older', unit='s', above=0.0
    )


@dataclass(frozen=True)
class ImuErrors(Config):
    """Gyroscope and accelerometers."""

    rate: float = parameter(
        100.0, description='readings per second', unit='Hz', above=0.0, high=100.0
    )
    gyro_std: float = parameter(
        0.005, description='noise of a yaw rate reading', unit='rad/s', low=0.0
    )
    gyro_bias_std: float = parameter(
        0.01, description='spread of the bias at the start', unit='rad/s', low=0.0
    )
    gyro_bias_walk: float = parameter(
        0.0002, description='random walk of the bias, per root second', unit='rad/s/s^0.5', low=0.0
    )
    gyro_scale_std: float = parameter(
        0.005, description='spread of the error in proportion to the rate', low=0.0, high=0.2
    )
    acceleration_std: float = parameter(
        0.05, description='noise of an acceleration reading', unit='m/s^2', low=0.0
    )
    acceleration_bias_std: float = parameter(
        0.03, description='spread of the bias of each accelerometer', unit='m/s^2', low=0.0
    )


@dataclass(frozen=True)
class MagneticErrors(Config):
    """Magnetometer in the field of the earth and of the iron in the room."""

    rate: float = parameter(
        20.0, description='readings per second', unit='Hz', above=0.0, high=100.0
    )
    north: float = parameter(
        1.5707963, description='direction of magnetic north in map', unit='rad'
    )
    horizontal: float = parameter(
        20e-6, description='horizontal part of the field of the earth', unit='T', low=0.0
    )
    vertical: float = parameter(
        -44e-6, description='upward part of the field of the earth', unit='T'
    )
    std: float = parameter(
        0.3e-6, description='noise of a reading of each axis', unit='T', low=0.0
    )
    hard_iron_std: float = parameter(
        0.5e-6, description='spread of the constant error of each axis', unit='T', low=0.0
    )


@dataclass(frozen=True)
class UltrasonicErrors(Config):
    """Ultrasonic ranging, one sensor firing at a time."""

    slot: float = parameter(
        0.03, description='time from one sensor firing to the next', unit='s', low=0.01
    )
    min_range: float = parameter(0.03, description='nearest echo', unit='m', low=0.0)
    max_range: float = parameter(3.0, description='farthest echo', unit='m', above=0.0)
    field_of_view: float = parameter(
        0.48, description='full opening of the cone', unit='rad', above=0.0, high=3.0
    )
    std: float = parameter(0.01, description='noise of an echo', unit='m', low=0.0)
    critical_incidence: float = parameter(
        0.7,
        description='angle to the normal beyond which a flat thing sends no echo back',
        unit='rad',
        above=0.0,
    )
    missing_probability: float = parameter(
        0.01, description='chance that an echo is not heard', low=0.0, high=1.0
    )
    false_probability: float = parameter(
        0.001, description='chance of an echo from nothing', low=0.0, high=1.0
    )

    def check(self) -> None:
        """Refuse a range that is upside down."""
        if self.min_range >= self.max_range:
            raise ConfigError('min_range', self.min_range, 'less than max_range [m]')


@dataclass(frozen=True)
class SensorErrors(Config):
    """Rates and errors of everything that is simulated."""

    uwb: UwbErrors = parameter(factory=UwbErrors, description='two-way ranging')
    wheels: WheelErrors = parameter(factory=WheelErrors, description='encoders and motors')
    imu: ImuErrors = parameter(factory=ImuErrors, description='gyroscope and accelerometers')
    magnetic: MagneticErrors = parameter(factory=MagneticErrors, description='magnetometer')
    ultrasonic: UltrasonicErrors = parameter(factory=UltrasonicErrors, description='ultrasonics')

    def ideal(self) -> SensorErrors:
        """Return the same rates and clocks without any error: for tests and for comparison."""
        return SensorErrors(
            uwb=self.uwb.replace(
                range_std=0.0,
                bias_std=0.0,
                scale_std=0.0,
                nlos_excess=(0.0, 0.0),
                person_excess=(0.0, 0.0),
                nlos_std=0.0,
                loss_probability=0.0,
                nlos_loss_probability=0.0,
                power_std=0.0,
            ),
            wheels=self.wheels.replace(
                ticks_per_turn=0,
                radius_scale_std=0.0,
                radius_scale=(0.0, 0.0),
                track_scale_std=0.0,
                slip_rate=0.0,
                floor_noise=0.0,
            ),
            imu=self.imu.replace(
                gyro_std=0.0,
                gyro_bias_std=0.0,
                gyro_bias_walk=0.0,
                gyro_scale_std=0.0,
                acceleration_std=0.0,
                acceleration_bias_std=0.0,
            ),
            magnetic=self.magnetic.replace(std=0.0, hard_iron_std=0.0),
            ultrasonic=self.ultrasonic.replace(
                std=0.0, missing_probability=0.0, false_probability=0.0
            ),
        )
