"""Where a person with a tag is, seen from a robot that carries the anchors.

Anchors half a metre apart tell the distance well and the direction badly; but a person does not
jump. An iterated extended Kalman filter on the ranges themselves, with a velocity that walks,
averages the direction over as long as the motion allows.

State: x, y [m] and velocity [m/s] of the tag over the floor, along the axes of base_link.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tablerunner.config import Config, parameter
from tablerunner.errors import CovarianceError, GeometryError
from tablerunner.odometry.motion import Motion
from tablerunner.types import Matrix, Vector
from tablerunner.uwb.solvers.registry import solve

_NEAREST_M = 1e-6
_SETTLED_M = 1e-4


@dataclass(frozen=True)
class TargetTrackerConfig(Config):
    """How a target moves and how its ranges are believed."""

    acceleration: float = parameter(
        0.3,
        unit='m/s/sqrt(s)',
        description='Random walk of the velocity of the target',
        above=0.0,
        high=10.0,
        dynamic=True,
    )
    speed_std: float = parameter(
        0.7, unit='m/s', description='Prior deviation of its velocity', above=0.0, high=10.0
    )
    range_std: float = parameter(
        0.1,
        unit='m',
        description='Deviation of a range',
        above=0.0,
        high=5.0,
        dynamic=True,
    )
    gate: float = parameter(
        16.0,
        description='Normalised innovation squared beyond which a range is refused',
        above=0.0,
        high=1e6,
        dynamic=True,
    )
    iterations: int = parameter(
        4, description='Most linearisations of one epoch', low=1, high=20, dynamic=True
    )


@dataclass(frozen=True)
class Target:
    """What is believed of the target.

    Attributes
    ----------
    mean : ndarray, shape (4,)
        x, y [m], velocity [m/s], along the axes of base_link.
    covariance : ndarray, shape (4, 4)
    """

    mean: Vector
    covariance: Matrix


@dataclass(frozen=True)
class TargetUpdate:
    """What an epoch did.

    Attributes
    ----------
    target : Target
        After it.
    used : ndarray of bool, shape (n,)
        Which ranges went in: those that are there and pass the gate.
    nis : ndarray, shape (n,)
        Normalised innovation squared of each range, one by one; NaN where there is none.
    """

    target: Target
    used: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    nis: Vector


class TargetTracker:
    """Tracks one tag by ranges to anchors on the robot.

    Pure: takes a belief, returns a new one; keeps nothing between calls.

    Parameters
    ----------
    config : TargetTrackerConfig
    anchors : array_like, shape (n, 3)
        Anchors in base_link [m].
    tag_height : float
        Height of the tag over base_link [m].

    Raises
    ------
    GeometryError
        Fewer than three anchors, or a shape other than (n, 3).
    """

    def __init__(self, config: TargetTrackerConfig, anchors: ArrayLike, tag_height: float) -> None:
        self.config = config
        self._anchors = np.asarray(anchors, dtype=float)
        if self._anchors.ndim != 2 or self._anchors.shape[1] != 3 or len(self._anchors) < 3:
            raise GeometryError(
                f'anchors on the robot have shape {self._anchors.shape}; (n, 3) with n of at '
                'least 3 is needed'
            )
        self._tag_height = float(tag_height)

    def start(self, ranges: ArrayLike) -> Target | None:
        """Return the first belief, from one epoch; None where its ranges leave the place open.

        Parameters
        ----------
        ranges : array_like, shape (n,)
            Calibrated ranges [m], NaN where missing.
        """
        fix = solve(
            'nonlinear', self._anchors, np.asarray(ranges), self.config.range_std, self._tag_height
        )
        if not fix.solved[0]:
            return None
        covariance = np.zeros((4, 4))
        covariance[:2, :2] = fix.covariance[0] * fix.excess[0]
        covariance[2, 2] = covariance[3, 3] = self.config.speed_std**2
        return Target(np.array([*fix.position[0], 0.0, 0.0]), covariance)

    def predict(self, target: Target, dt_s: float, motion: Motion | None = None) -> Target:
        """Return the belief a while later.

        Parameters
        ----------
        target : Target
        dt_s : float
            [s].
        motion : Motion, optional
            What the robot did meanwhile: the target is then seen from its new pose.
        """
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt_s
        density = self.config.acceleration**2
        noise = np.zeros((4, 4))
        noise[0, 0] = noise[1, 1] = density * dt_s**3 / 3.0
        noise[0, 2] = noise[2, 0] = noise[1, 3] = noise[3, 1] = density * dt_s**2 / 2.0
        noise[2, 2] = noise[3, 3] = density * dt_s
        mean = step @ target.mean
        covariance = step @ target.covariance @ step.T + noise
        if motion is not None:
            half, turn = 0.5 * motion.turn_rad, motion.turn_rad
            mean[:2] -= motion.distance_m * np.array([np.cos(half), np.sin(half)])
            back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
            seen = np.kron(np.eye(2), back)
            mean, covariance = seen @ mean, seen @ covariance @ seen.T
        return Target(mean, 0.5 * (covariance + covariance.T))

    def update(self, target: Target, ranges: ArrayLike, std: ArrayLike = np.nan) -> TargetUpdate:
        """Return the belief corrected by one epoch of ranges.

        Parameters
        ----------
        target : Target
        ranges : array_like, shape (n,)
            Calibrated ranges of the same time [m]; what is not positive and finite is missing.
        std : array_like, broadcast to (n,)
            Deviation of each [m]; `range_std` where NaN.

        Raises
        ------
        GeometryError
            Another number of ranges than of anchors.
        CovarianceError
            A deviation that is not positive.
        """
        measured = np.asarray(ranges, dtype=float)
        if measured.shape != (len(self._anchors),):
            raise GeometryError(f'{measured.shape} ranges to {len(self._anchors)} anchors')
        own = np.broadcast_to(np.asarray(std, dtype=float), measured.shape)
        noise = np.where(np.isnan(own), self.config.range_std, own) ** 2
        if np.any(own <= 0.0):
            raise CovarianceError('a range has a standard deviation that is not positive')
        with np.errstate(invalid='ignore'):
            there = np.isfinite(measured) & (measured > 0.0)
        expected, jacobian = predict_ranges(target.mean, self._anchors, self._tag_height)
        spread = np.einsum('ij,jk,ik->i', jacobian, target.covariance, jacobian) + noise
        nis = np.where(there, (measured - expected) ** 2 / spread, np.nan)
        used = there & (nis <= self.config.gate)
        if not used.any():
            return TargetUpdate(target, used, nis)
        z, r = measured[used], np.diag(noise[used])
        prior = target.covariance
        place = target.mean
        for _ in range(self.config.iterations):
            expected, jacobian = predict_ranges(place, self._anchors, self._tag_height)
            h = jacobian[used]
            gain = np.linalg.solve(h @ prior @ h.T + r, h @ prior).T
            moved = target.mean + gain @ (z - expected[used] - h @ (target.mean - place))
            settled = float(np.abs(moved - place).max()) < _SETTLED_M
            place = moved
            if settled:
                break
        keep = np.eye(4) - gain @ h
        covariance = keep @ prior @ keep.T + gain @ r @ gain.T
        return TargetUpdate(Target(place, 0.5 * (covariance + covariance.T)), used, nis)


def predict_ranges(mean: Vector, anchors: Matrix, tag_height: float) -> tuple[Vector, Matrix]:
    """Return the expected ranges and their Jacobian.

    Parameters
    ----------
    mean : ndarray, shape (4,)
        As in `Target`.
    anchors : ndarray, shape (n, 3)
        [m].
    tag_height : float
        [m].

    Returns
    -------
    expected : ndarray, shape (n,)
        [m].
    jacobian : ndarray, shape (n, 4)
        Zero towards an anchor that the tag touches.
    """
    offset = mean[:2] - anchors[:, :2]
    expected = np.sqrt(np.sum(offset**2, axis=1) + (tag_height - anchors[:, 2]) ** 2)
    jacobian = np.zeros((len(anchors), 4))
    jacobian[:, :2] = offset / np.maximum(expected, _NEAREST_M)[:, None]
    return expected, jacobian
