"""Wheels that slip, noticed against the gyroscope.

Where one wheel slips more than the other, the wheels tell another turn than the gyroscope does.
What they differ by beyond what track, radii and noise explain is way that a rim covered and the
robot did not: track times that turn, on one side; half of it is missing in the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

from tablerunner.config import Config, parameter


@dataclass(frozen=True)
class SlipConfig(Config):
    """From when on wheels and gyroscope disagree too much."""

    rate: float = parameter(
        0.15,
        unit='rad/s',
        description='Difference of the turn rates of wheels and gyroscope that is still noise',
        above=0.0,
        high=10.0,
        dynamic=True,
    )
    per_turn: float = parameter(
        0.1,
        description='What may be added to it for each rad/s of turning (track, gyro scale)',
        low=0.0,
        high=1.0,
        dynamic=True,
    )
    per_speed: float = parameter(
        0.05,
        unit='rad/m',
        description='What may be added to it for each m/s (unequal wheels)',
        low=0.0,
        high=10.0,
        dynamic=True,
    )
    pause: float = parameter(
        0.3,
        unit='s',
        description='A slip that comes back within this time is the same slip',
        low=0.0,
        high=10.0,
        dynamic=True,
    )


class SlipWatch:
    """Adds up what a slip may have cost.

    Attributes
    ----------
    slipping : bool
        Whether the last step slipped.
    count : int
        Slips so far.
    """

    def __init__(self, config: SlipConfig, track_m: float) -> None:
        self.config = config
        self._track_m = track_m
        self.reset()

    def reset(self) -> None:
        """Forget everything, as after a jump back in time."""
        self.slipping = False
        self.count = 0
        self._missing_m = 0.0
        self._since_s = float('inf')

    def add(self, wheels_rad: float, gyro_rad: float, distance_m: float, dt_s: float) -> float:
        """Take a step; return the variance that a slip adds to its distance [m^2], 0 without.

        Parameters
        ----------
        wheels_rad, gyro_rad : float
            Turn by the wheels and by the gyroscope, its bias taken off.
        distance_m, dt_s : float
        """
        config = self.config
        apart = abs(wheels_rad - gyro_rad)
        usual = config.rate * dt_s + config.per_turn * abs(gyro_rad)
        usual += config.per_speed * abs(distance_m)
        self.slipping = dt_s > 0.0 and apart > usual
        if not self.slipping:
            self._since_s += dt_s
            return 0.0
        if self._since_s > config.pause:
            self._missing_m = 0.0
            self.count += 1
        self._since_s = 0.0
        before = self._missing_m
        self._missing_m += 0.5 * self._track_m * apart
        # The parts of one slip share their sign: their sum is squared, not each of them.
        return self._missing_m**2 - before**2
