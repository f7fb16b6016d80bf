"""Looking back: what the whole run says of each instant (RTS smoother: Rauch et al. 1965).

A filter knows at each time what was measured until then. Going back from the end, the smoother
corrects each filtered estimate by what was learned after it: with the filtered mean m and
covariance P at step k, the prediction m', P' for step k + 1 made of it, and the smoothed mean and
covariance ms', Ps' there,

    G  = C P'^-1              C = Cov(state k, prediction of state k + 1) = P F'
    ms = m + G (ms' - m')
    Ps = P - G C' + G Ps' G'

(Saerkkae 2013, Bayesian Filtering and Smoothing, eq. 8.6; 9.9 with a statistical linearisation).
For a linear model with Gaussian noise this is the exact posterior.
"""

from __future__ import annotations

import numpy as np

from tablerunner.estimation.estimator import Estimator
from tablerunner.estimation.recording import Run
from tablerunner.geometry.angles import wrap
from tablerunner.odometry.motion import Motion
from tablerunner.types import Estimate, Matrix

SMOOTHED = ('ekf', 'ukf', 'dead_reckoning', 'iekf', 'lm_iekf')
"""Estimators that can be smoothed: the others keep no covariance that F P F' + Q explains."""

_HEADING = 2  # of every estimator: the only angle of a state
_STEP = 1e-5  # of the differences: units are m, rad, and fractions of 1
_CERTAIN = 1e-10  # deviation, in any unit here, that only rounding makes
_NOTHING = 1e-12  # eigenvalue of a correlation matrix that counts as none


def smooth(run: Run) -> list[Estimate]:
    """Return the smoothed estimates of a run: of its start, then of each of its steps.

    The predictions are made again from the filtered estimates of the run, so that gates, weights
    and everything else are those of the very run.

    Parameters
    ----------
    run : Run
        Of an estimator whose predicted covariance is F P F' + Q for the slope F of its predicted
        mean.
    """
    filtered = [run.first, *(step.after for step in run.steps)]
    smoothed = [filtered[-1]]
    for before, step in zip(filtered[-2::-1], run.steps[::-1], strict=True):
        later = smoothed[-1]
        predicted, cross = before, before.covariance
        if step.motion is not None:
            predicted = run.estimator.predict(before, step.motion, step.stamp)
            slope = slope_of(run.estimator, before, step.motion, step.stamp)
            cross = before.covariance @ slope.T
        smoothed.append(smooth_step(before, predicted, cross, later))
    return smoothed[::-1]


def smooth_step(
    filtered: Estimate, predicted: Estimate, cross: Matrix, later: Estimate
) -> Estimate:
    """Return the smoothed estimate of one step from the smoothed one of the next.

    Parameters
    ----------
    filtered : Estimate
        Of this step, n states.
    predicted : Estimate
        What was predicted of it for the next step.
    cross : ndarray, shape (n, n)
        Covariance of this state (rows) and the predicted one (columns).
    later : Estimate
        Smoothed estimate of the next step.
    """
    gain = cross @ inverse_of_covariance(predicted.covariance)
    offset = later.mean - predicted.mean
    offset[_HEADING] = wrap(float(offset[_HEADING]))
    mean = filtered.mean + gain @ offset
    mean[_HEADING] = wrap(float(mean[_HEADING]))
    # What is left of the uncertainty when the next state is known is no less than nothing, also
    # where rounding says so.
    left = without_negative(filtered.covariance - gain @ cross.T)
    covariance = left + gain @ later.covariance @ gain.T
    return filtered._replace(mean=mean, covariance=0.5 * (covariance + covariance.T))


def slope_of(estimator: Estimator, estimate: Estimate, motion: Motion, stamp: int) -> Matrix:
    """Return the slope F of the predicted mean, shape (n, n), by central differences.

    For sigma points that is their statistical linearisation (by Stein's lemma P F' is the
    covariance of state and prediction), which a Jacobian at the mean would not be.
    """
    size = len(estimate.mean)
    slope = np.empty((size, size))
    for state in range(size):
        ahead = estimator.predict(_moved(estimate, state, _STEP), motion, stamp).mean
        back = estimator.predict(_moved(estimate, state, -_STEP), motion, stamp).mean
        difference = ahead - back
        difference[_HEADING] = wrap(float(difference[_HEADING]))
        slope[:, state] = difference / (2.0 * _STEP)
    return slope


def extend_back(run: Run, start: Estimate) -> list[Estimate]:
    """Return the estimates from before the start of a run, oldest first: odometry undone.

    The start was found from a window of ranges and odometry that lies before it. Those ranges are
    in the smoothed start already and must not count twice, so that from there back only odometry
    leads: each step undoes one motion and adds its noise.

    Parameters
    ----------
    run : Run
    start : Estimate
        Smoothed estimate of the start.
    """
    estimates = [start]
    for lead in run.lead_in[::-1]:
        if lead.stamp < estimates[-1].stamp:
            estimates.append(_undone(run.estimator, estimates[-1], lead.onward, lead.stamp))
    return estimates[:0:-1]


def _undone(estimator: Estimator, later: Estimate, motion: Motion, stamp: int) -> Estimate:
    # The mean goes back by the motion turned round; the noise is that of the motion itself.
    back = Motion(-motion.distance_m, -motion.turn_rad, -motion.dt_s)
    mean = estimator.predict(later, back, stamp).mean
    earlier = later._replace(stamp=stamp, mean=mean)
    certain = earlier._replace(covariance=np.zeros_like(later.covariance))
    noise = estimator.predict(certain, motion, later.stamp).covariance
    slope = slope_of(estimator, later, back, stamp)
    covariance = slope @ (later.covariance + noise) @ slope.T
    return earlier._replace(covariance=0.5 * (covariance + covariance.T))


def inverse_of_covariance(covariance: Matrix) -> Matrix:
    """Return the pseudo-inverse of a covariance whose states may be of very different size.

    States without variance, and combinations that are certain, get zeros. The states are scaled
    to a deviation of 1 first, so that small ones do not count as nothing beside large ones.
    """
    deviation = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    scale = np.divide(1.0, deviation, out=np.zeros_like(deviation), where=deviation > _CERTAIN)
    values, vectors = np.linalg.eigh(covariance * scale[:, None] * scale)
    kept = values > _NOTHING * max(float(values[-1]), 0.0)
    root = vectors[:, kept] / np.sqrt(values[kept]) * scale[:, None]
    return np.asarray(root @ root.T)


def without_negative(covariance: Matrix) -> Matrix:
    """Return a covariance without the negative eigenvalues that rounding gave it."""
    symmetric: Matrix = 0.5 * (covariance + covariance.T)
    values, vectors = np.linalg.eigh(symmetric)
    if values[0] >= 0.0:
        return symmetric
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _moved(estimate: Estimate, state: int, step: float) -> Estimate:
    mean = estimate.mean.copy()
    mean[state] += step
    return estimate._replace(mean=mean)
