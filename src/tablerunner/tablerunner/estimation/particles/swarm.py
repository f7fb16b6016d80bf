"""The particles of the robot between two measurements.

Each particle has a pose, drawn, and Gaussians of what is linear once the pose is known: the errors
of odometry (scale of distances, scale of turns, bias of the yaw rate) and the range biases. That
is a marginalised particle filter (Schoen, Gustafsson and Nordlund 2005; FastSLAM 2.0 does the same
with landmarks). The covariances of these Gaussians are the same for all particles, since the same
motions and ranges tell of them; the means differ.

Odometry moves all particles alike but for heading and errors. So it is gathered once, in the frame
of the pose at the last draw: how far and which way, how that hangs on the errors, and how
uncertain it is. Each particle thus carries a pose covariance: that one, turned by its heading.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablerunner.estimation.models.motion_model import input_noise, move
from tablerunner.estimation.models.state import GYRO_BIAS, HEADING, SCALE
from tablerunner.estimation.particles.iterated import Array
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import Matrix, Vector

ERRORS = slice(SCALE, GYRO_BIAS + 1)
"""Which states of a pose with errors are the errors."""


@dataclass(frozen=True, slots=True)
class Way:
    """What odometry has told since the particles were drawn, in the frame of the pose then.

    Attributes
    ----------
    moved : ndarray, shape (3,)
        x, y [m], heading [rad], for the mean errors.
    by_errors : ndarray, shape (3, 3)
        d(moved)/d(errors).
    noise : ndarray, shape (3, 3)
        Covariance of x, y, heading beside that of the errors.
    """

    moved: Vector
    by_errors: Matrix
    noise: Matrix

    @classmethod
    def none(cls) -> Way:
        """Return a way of no length that is known exactly."""
        return cls(np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)))

    def then(
        self, errors: Vector, motion: Motion, variances: tuple[float, float], extra: Vector
    ) -> Way:
        """Return this way and a motion after it.

        Parameters
        ----------
        errors : ndarray, shape (3,)
            Mean errors of odometry.
        motion : Motion
        variances : tuple
            Of its distance [m^2] and turn [rad^2].
        extra : ndarray, shape (3,)
            Further variances of x, y, heading.
        """
        moved, by_state, by_input = move(np.concatenate([self.moved, errors]), motion)
        forward = by_state[:3, :3]
        noise = np.diag(extra)
        added = np.zeros((3, 3))
        input_noise(added, by_input, *variances)
        return Way(
            moved[:3],
            forward @ self.by_errors + by_state[:3, ERRORS],
            forward @ self.noise @ forward.T + noise + added,
        )


@dataclass(frozen=True, slots=True)
class Swarm:
    """n particles among m anchors.

    Attributes
    ----------
    poses : ndarray, shape (n, 3)
        x, y [m], heading [rad] of base_link in map when they were drawn.
    errors : ndarray, shape (n, 3)
        Mean scale, turn scale and yaw rate bias of each.
    biases : ndarray, shape (n, m)
        Mean range biases of each [m].
    log_weights : ndarray, shape (n,)
        Normalised.
    error_covariance : ndarray, shape (3, 3)
        Of the errors, about each particle's mean.
    bias_covariance : ndarray, shape (m, m)
        Of the range biases, about each particle's mean.
    way : Way
    """

    poses: Matrix
    errors: Matrix
    biases: Matrix
    log_weights: Vector
    error_covariance: Matrix
    bias_covariance: Matrix
    way: Way

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def mean_errors(self) -> Vector:
        """Weighted mean of the errors, shape (3,)."""
        return np.asarray(np.exp(self.log_weights) @ self.errors)

    def now(self) -> Matrix:
        """Return where the particles are after the way, shape (n, 3); headings not wrapped."""
        return carried(self.poses, self.errors - self.mean_errors, self.way)

    @property
    def pose_noise(self) -> Matrix:
        """Covariance of each pose in its own frame, that of the errors included, shape (3, 3)."""
        by_errors = self.way.by_errors
        return np.asarray(self.way.noise + by_errors @ self.error_covariance @ by_errors.T)

    def moments(self, poses: Matrix) -> tuple[Vector, Matrix]:
        """Return mean and covariance of pose, errors and biases, shapes (6 + m,) and square.

        Parameters
        ----------
        poses : ndarray, shape (n, 3)
            As of `now`.
        """
        weights = np.exp(self.log_weights)
        mean, apart = self.about_mean(poses)
        covariance = (weights[:, None] * apart).T @ apart
        # Within each particle: turned by the mean heading, exact where they agree on it.
        turn = rotation(mean[2:3] - self.way.moved[2])[0]
        covariance[:3, :3] += turn @ self.pose_noise @ turn.T
        cross = turn @ self.way.by_errors @ self.error_covariance
        covariance[:3, 3:6] += cross
        covariance[3:6, :3] += cross.T
        covariance[3:6, 3:6] += self.error_covariance
        covariance[6:, 6:] += self.bias_covariance
        return mean, 0.5 * (covariance + covariance.T)

    def about_mean(self, poses: Matrix) -> tuple[Vector, Matrix]:
        """Return the mean of pose, errors and biases, and how far each particle is off it."""
        weights = np.exp(self.log_weights)
        states = np.concatenate([poses, self.errors, self.biases], axis=1)
        mean = weights @ states
        heading = poses[:, HEADING]
        mean[HEADING] = np.arctan2(weights @ np.sin(heading), weights @ np.cos(heading))
        apart = states - mean
        apart[:, HEADING] = wrap(apart[:, HEADING])
        return mean, apart

    def after(self, way: Way, error_walk: Vector, bias_walk: float) -> Swarm:
        """Return the particles with a longer way, and walked errors and biases (variances)."""
        return replace(
            self,
            way=way,
            error_covariance=self.error_covariance + np.diag(error_walk),
            bias_covariance=self.bias_covariance + bias_walk * np.eye(len(self.bias_covariance)),
        )


def carried(poses: Matrix, errors: Matrix, way: Way) -> Matrix:
    """Return poses after a way, each with its own errors beyond the mean ones, shape (n, 3)."""
    moved = way.moved + errors @ way.by_errors.T
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.stack(
        [
            poses[:, 0] + cos * moved[:, 0] - sin * moved[:, 1],
            poses[:, 1] + sin * moved[:, 0] + cos * moved[:, 1],
            poses[:, 2] + moved[:, 2],
        ],
        axis=1,
    )


def rotation(headings: Vector) -> Array:
    """Return what turns x, y, heading by each angle, shape (n, 3, 3)."""
    turn = np.zeros((len(headings), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(headings)
    turn[:, 1, 0] = np.sin(headings)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return turn
