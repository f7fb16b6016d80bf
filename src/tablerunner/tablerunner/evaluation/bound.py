"""The posterior Cramer-Rao bound: how well a pose can be known from odometry and ranges at all.

Tichavsky, Muravchik, Nehorai 1998 give the recursion of the information matrix. Here noise enters
the motion only through distance and turn, so that the process noise is singular and the recursion
is written for the covariance instead, which needs no inverse of it (their section III, by the
matrix inversion lemma): with F, G the Jacobians of the motion and H that of a range,

    P' = F P F' + G Q G' + W,      P'' = P' - P' H' (H P' H' + R)^-1 H P'

all taken at the *true* trajectory, never at an estimate. Averaged over trajectories it bounds the
mean square error of every estimator that is told no more than is known here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablerunner.estimation.models.motion_model import input_noise, move, transport
from tablerunner.estimation.models.range_model import STANDING, Point3, Twist, predict_range
from tablerunner.estimation.models.state import RANGE_BIAS
from tablerunner.evaluation.truth import Stamps, Truth
from tablerunner.geometry.pose import Pose2
from tablerunner.odometry.motion import Motion, MotionNoise, between_poses
from tablerunner.types import Matrix, Vector, seconds


@dataclass(frozen=True)
class BoundModel:
    """What the bound knows: every variance exactly, and nothing that is drawn.

    The state is that of `estimation.models.state`.

    Attributes
    ----------
    anchors : tuple of (x, y, z)
        Places in map [m].
    lever_arm : tuple
        Tag in base_link [m].
    prior : ndarray, shape (n, n)
        Covariance of the state at the start; n = RANGE_BIAS + 2 anchors.
    motion : MotionNoise
        Noise of distance and turn, taken as Gaussian and white.
    walk_per_time : ndarray, shape (n,)
        By how much each state's variance grows in a second.
    range_std : float
        Noise of a range in plain sight [m].
    """

    anchors: tuple[Point3, ...]
    lever_arm: Point3
    prior: Matrix
    motion: MotionNoise
    walk_per_time: Vector
    range_std: float

    @property
    def size(self) -> int:
        """Number of states."""
        return RANGE_BIAS + 2 * len(self.anchors)


def posterior_bound(
    model: BoundModel, truth: Truth, range_stamps: Stamps, range_anchors: Sequence[int]
) -> Matrix:
    """Return the bound on the covariance of x, y, heading along one true trajectory.

    It knows the variances, the prior, the trajectory (at which it linearises), and which ranges
    were lost or blocked (they are not among those given). Errors that are constant in a run are
    states with a prior; the models are linearised at their mean, zero, where they are small
    against one.

    Parameters
    ----------
    model : BoundModel
    truth : Truth
        True poses of base_link, the first at the time of the prior.
    range_stamps : ndarray of int64, shape (m,)
        When ranges were measured, increasing [ns]; those outside of the truth's time count not.
    range_anchors : sequence of int, (m,)
        To which of the model's anchors.

    Returns
    -------
    ndarray, shape (k, 3, 3)
        At each stamp of the truth, before the ranges of that very stamp, as an estimator knows
        the pose when its odometry has come; units m^2, m rad, rad^2.
    """
    stamps = np.concatenate([truth.stamps, np.asarray(range_stamps, dtype=np.int64)])
    which = np.concatenate([np.full(len(truth), -1), np.asarray(range_anchors, dtype=int)])
    order = np.argsort(stamps, kind='stable')
    stamps, which = stamps[order], which[order]
    positions, headings = truth.at(stamps)
    bounds = np.empty((len(truth), 3, 3))
    covariance, row = np.array(model.prior, dtype=float), 0
    state, twist = np.zeros(model.size), STANDING
    before: tuple[int, Pose2] | None = None
    for stamp, anchor, (x, y), heading in zip(stamps, which, positions, headings, strict=True):
        if not np.isfinite(heading):
            continue
        pose = Pose2(float(x), float(y), float(heading))
        if before is not None and stamp > before[0]:
            step = between_poses(before[1], pose, seconds(int(stamp) - before[0]))
            state[:3] = before[1].x, before[1].y, before[1].heading
            covariance = _moved(model, covariance, state, step)
            twist = step.distance_m / step.dt_s, step.turn_rad / step.dt_s
        before = int(stamp), pose
        if anchor < 0:
            bounds[row] = covariance[:3, :3]
            row += 1
        else:
            state[:3] = pose.x, pose.y, pose.heading
            covariance = _ranged(model, covariance, state, int(anchor), twist)
    return bounds


def _moved(model: BoundModel, covariance: Matrix, state: Vector, motion: Motion) -> Matrix:
    _, by_state, by_input = move(state, motion)
    noise: Matrix = np.diag(model.walk_per_time * motion.dt_s)
    input_noise(noise, by_input, *model.motion.variances(motion))
    return transport(covariance, by_state, noise)


def _ranged(
    model: BoundModel, covariance: Matrix, state: Vector, anchor: int, twist: Twist
) -> Matrix:
    place = model.anchors[anchor]
    _, slope = predict_range(state, place, model.lever_arm, anchor, twist)
    cross = covariance @ slope
    corrected: Matrix = covariance - np.outer(
        cross, cross / (float(slope @ cross) + model.range_std**2)
    )
    return corrected
