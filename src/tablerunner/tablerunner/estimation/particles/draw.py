"""One measurement and the swarm: proposal, weights, linear states, resampling.

With particle i at x_i after its way, of covariance P_i, and a measurement of m numbers with noise
R (of ranges, the covariance of the biases about each particle's mean included):

1. x is drawn from a proposal: N(x_i, P_i) itself (`pf`), or what an EKF, IEKF or LM-IEKF makes of
   it and the measurement.
2. w_i grows by  p(z | x) N(x; x_i, P_i) / proposal(x), as logarithms.
3. The pose that was drawn tells of the errors of odometry, what the ranges leave over tells of the
   biases: Kalman corrections with gains that are the same for all.
4. Where the effective number falls below a share, particles are resampled, as many as KLD sampling
   asks for, and moved apart by a kernel.

p(z | x) is N(h(x), R) with a share of errors ten times as large, for each whitened number.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tablerunner.estimation.particles.config import ParticleConfig
from tablerunner.estimation.particles.iterated import Array, Iteration, drawn, update
from tablerunner.estimation.particles.kernel import bandwidth, square_root
from tablerunner.estimation.particles.kld import enough, occupied
from tablerunner.estimation.particles.progressive import FEWEST, progressed
from tablerunner.estimation.particles.resampling import RESAMPLERS
from tablerunner.estimation.particles.swarm import Swarm, Way, rotation
from tablerunner.estimation.particles.triangular import times
from tablerunner.estimation.particles.weights import effective_size, normalised
from tablerunner.types import Matrix, Vector

_WIDE = 10.0
"""How many times larger the errors are that a share of the measurements has."""

_PULL = 3.0
"""Deviations beyond which what is left of a range pulls its bias no further."""

_COMPACT = (0.5, 0.3)
"""Deviation of place [m] and heading [rad] up to which the swarm is one cloud."""

_LARGEST_KERNEL = np.array([0.2, 0.2, 0.2])
"""Deviations of the kernel while it is not [m, m, rad]: wider ones would blur what is there."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """A measurement of m numbers, as the swarm sees it.

    Attributes
    ----------
    look : callable
        Takes poses, shape (k, 3); returns measured less expected, (k, m), and d(expected)/d(pose),
        (k, m, 3), without range biases.
    noise : ndarray, shape (m, m)
        R, without that of the range biases.
    anchors : ndarray of int, shape (m,), or None
        Whose range each number is; None: these are no ranges.
    """

    look: Callable[[Matrix], tuple[Matrix, Array]]
    noise: Matrix
    anchors: NDArray[np.intp] | None = None


class View(NamedTuple):
    """What n particles expect of a measurement of m numbers.

    Attributes
    ----------
    offset : ndarray, shape (n, m)
        Measured less expected, range biases taken off.
    slope : ndarray, shape (n, m, 3)
        d(expected)/d(pose).
    roots : ndarray, shape (n, 3, 3)
        L of the covariance L L' of each pose, in map.
    """

    offset: Matrix
    slope: Array
    roots: Array


class Seen(NamedTuple):
    """A measurement as all particles together expect it, before it is used."""

    innovation: Vector  # (m,)
    spread: Matrix  # (m, m), S


def view_of(swarm: Swarm, poses: Matrix, sighting: Sighting) -> View:
    """Return what the particles expect.

    Parameters
    ----------
    swarm : Swarm
    poses : ndarray, shape (n, 3)
        As of `swarm.now()`.
    sighting : Sighting
    """
    offset, slope = sighting.look(poses)
    if sighting.anchors is not None:
        offset = offset - swarm.biases[:, sighting.anchors]
    turn = rotation(poses[:, 2] - swarm.way.moved[2])
    return View(offset, slope, turn @ square_root(swarm.pose_noise))


def foreseen(swarm: Swarm, sighting: Sighting, view: View) -> Seen:
    """Return the innovation of the mean and its covariance over the swarm."""
    weights = np.exp(swarm.log_weights)
    mean = weights @ view.offset
    apart = view.offset - mean
    spread = (weights[:, None] * apart).T @ apart + _noise(swarm, sighting)
    along = view.slope @ view.roots
    spread += np.tensordot(weights, along @ np.swapaxes(along, 1, 2), 1)
    return Seen(mean, spread)


def absorbed(
    swarm: Swarm,
    poses: Matrix,
    sighting: Sighting,
    view: View,
    iteration: Iteration | None,
    config: ParticleConfig,
    rng: np.random.Generator,
) -> Swarm | None:
    """Return the swarm after a measurement; None if no particle has any weight left.

    Parameters
    ----------
    swarm : Swarm
    poses : ndarray, shape (n, 3)
        As of `swarm.now()`.
    sighting : Sighting
    view : View
        Of the same poses and the same measurement.
    iteration : Iteration or None
        Of the proposal; None: the motion alone.
    config : ParticleConfig
    rng : Generator
    """
    noise = _noise(swarm, sighting)
    root = square_root(swarm.pose_noise)
    normal = rng.standard_normal(poses.shape)
    biases = None if sighting.anchors is None else swarm.biases[:, sighting.anchors]

    def look(states: Matrix, rows: NDArray[np.intp]) -> tuple[Matrix, Array]:
        offset, slope = sighting.look(states)
        return (offset if biases is None else offset - biases[rows]), slope

    if iteration is None:
        y, ratio = normal, np.zeros(len(poses))
        states = poses + times(view.roots, y)
    else:
        updated = update(poses, view.roots, look, noise, iteration, view[:2])
        proposal = drawn(poses, view.roots, updated, normal)
        states, y, ratio = proposal.states, proposal.whitened, proposal.log_ratio
    offset, _ = look(states, np.arange(len(states)))
    whiten = np.linalg.inv(np.linalg.cholesky(noise)).T
    white = offset @ whiten
    gained = ratio + _log_likelihood(white, config.outliers)
    found = normalised(swarm.log_weights + gained)
    if found.recovered:
        return None
    after = replace(_told(swarm, root, y), poses=states, way=Way.none())
    if effective_size(found.log_weights) < min(FEWEST, 0.25 * len(states)) and not _compact(swarm):

        def log_likelihood(drawn_anew: Swarm) -> Vector:
            seen = view_of(drawn_anew, drawn_anew.poses, sighting)
            return _log_likelihood(seen.offset @ whiten, config.outliers)

        after = progressed(
            after, gained, log_likelihood, lambda between: resampled(between, config, rng)
        )
        offset = view_of(after, after.poses, sighting).offset
        white = offset @ whiten
    else:
        after = replace(after, log_weights=found.log_weights)
    if sighting.anchors is not None:
        after = _left_over(after, offset, white, noise, sighting.anchors)
    if effective_size(after.log_weights) < config.threshold * len(after):
        after = resampled(after, config, rng)
    return after


def resampled(swarm: Swarm, config: ParticleConfig, rng: np.random.Generator) -> Swarm:
    """Return as many particles as it takes, of equal weight, moved apart by a kernel.

    While they are one cloud, they are drawn towards their mean by as much as the kernel widens
    them (Liu and West 2001), so that their covariance stays; while they are not, that would pull
    hypotheses into one, and the kernel is narrow instead.
    """
    weights = np.exp(swarm.log_weights)
    mean, apart = swarm.about_mean(swarm.poses)
    covariance = (weights[:, None] * apart).T @ apart
    size = (config.bin_side, config.bin_side, config.bin_turn)
    choose = RESAMPLERS[config.resampler]
    rows = choose(weights, len(swarm), rng)
    bins = occupied(swarm.poses[np.unique(rows)], size)
    wanted = enough(bins, config.adaptive_error, config.adaptive_confidence)
    count = min(max(wanted, config.least), config.at_start)
    if count != len(rows):
        rows = choose(weights, count, rng)
    off = apart[rows]
    width = bandwidth(count, 3)
    kernel = width * square_root(covariance)
    if _is_compact(covariance):
        off *= math.sqrt(max(1.0 - width * width, 0.0))
    else:
        deviations = np.maximum(width * np.sqrt(np.diagonal(covariance)[:3]), 1e-12)
        kernel[:3] *= np.minimum(_LARGEST_KERNEL / deviations, 1.0)[:, None]
    states = mean + off + rng.standard_normal(off.shape) @ kernel.T
    return replace(
        swarm,
        poses=states[:, :3],
        errors=states[:, 3:6],
        biases=states[:, 6:],
        log_weights=np.full(count, -math.log(count)),
    )


def _compact(swarm: Swarm) -> bool:
    _, covariance = swarm.moments(swarm.now())
    return _is_compact(covariance)


def _is_compact(covariance: Matrix) -> bool:
    place, heading = math.sqrt(covariance[0, 0] + covariance[1, 1]), math.sqrt(covariance[2, 2])
    return place < _COMPACT[0] and heading < _COMPACT[1]


def _noise(swarm: Swarm, sighting: Sighting) -> Matrix:
    if sighting.anchors is None:
        return sighting.noise
    return sighting.noise + swarm.bias_covariance[np.ix_(sighting.anchors, sighting.anchors)]


def _log_likelihood(white: Matrix, outliers: float) -> Vector:
    """Return the log likelihood of whitened numbers, shape (n,), but for a constant."""
    square = white**2
    plain = -0.5 * square
    if outliers > 0.0:
        wide = math.log(outliers / _WIDE) - 0.5 * square / _WIDE**2
        plain = np.logaddexp(math.log(1.0 - outliers) + plain, wide)
    return np.asarray(plain.sum(axis=1))


def _told(swarm: Swarm, root: Matrix, y: Matrix) -> Swarm:
    """Return the swarm with the errors of odometry corrected by the poses that were drawn.

    A pose root @ y off its expectation, of covariance root root', tells of the errors by the
    gain E C' (root root')^-1, with E their covariance and C the slope of the way.
    """
    cross = swarm.error_covariance @ swarm.way.by_errors.T
    gain = cross @ np.linalg.pinv(root, rcond=1e-9).T
    left = swarm.error_covariance - gain @ gain.T
    return replace(swarm, errors=swarm.errors + y @ gain.T, error_covariance=0.5 * (left + left.T))


def _left_over(
    swarm: Swarm, offset: Matrix, white: Matrix, noise: Matrix, anchors: NDArray[np.intp]
) -> Swarm:
    """Return the swarm with its range biases corrected by what the ranges leave over."""
    cross = swarm.bias_covariance[:, anchors]
    gain = np.linalg.solve(noise, cross.T).T
    largest = np.maximum(np.abs(white).max(axis=1), _PULL)
    pulled = offset * (_PULL / largest)[:, None]
    left = swarm.bias_covariance - gain @ cross.T
    return replace(
        swarm, biases=swarm.biases + pulled @ gain.T, bias_covariance=0.5 * (left + left.T)
    )
