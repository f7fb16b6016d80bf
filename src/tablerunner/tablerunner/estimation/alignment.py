"""Finding the start: position from the first ranges, heading by driving.

Ranges to one tag say nothing about heading until the robot has moved. Over a window of odometry
and ranges the unknowns are the pose of base_link *now* and each anchor's range bias; odometry says
where the tag was, seen from now, when each range was taken. The maximum a posteriori estimate is
sought from many headings and from both sides of the anchors at once (Levenberg-Marquardt, Cauchy
loss against NLOS). It is believed only when heading and position are well determined and no other
pose explains the window nearly as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tablerunner.config import Config, parameter
from tablerunner.geometry.angles import wrap
from tablerunner.types import UNKNOWN_YAW_VARIANCE, Matrix, Vector

_HEADINGS = 8  # from each of two places
_ITERATIONS = 15
_CAUCHY = 2.0  # residual, in standard deviations, at which a range loses half its weight
_SAME_HEADING = math.radians(20.0)  # results closer than this, and than ...
_SAME_PLACE_M = 0.5  # ... this, are one solution


@dataclass(frozen=True)
class AlignmentConfig(Config):
    """When a start is believed."""

    window: float = parameter(
        20.0,
        unit='s',
        description='Longest window of ranges that the start is found from',
        above=0.0,
        high=300.0,
    )
    min_ranges: int = parameter(
        12, description='Fewest ranges that a start is found from', low=4, high=1000
    )
    interval: float = parameter(
        0.25, unit='s', description='Time between two attempts', low=0.0, high=10.0
    )
    max_heading_std: float = parameter(
        0.15, unit='rad', description='Heading must be known better than this', above=0.0, high=1.0
    )
    max_position_std: float = parameter(
        0.3, unit='m', description='Position must be known better than this', above=0.0, high=5.0
    )
    min_driven: float = parameter(
        1.0,
        unit='m',
        description='Shortest way that a start is found from',
        low=0.0,
        high=100.0,
    )
    max_scatter: float = parameter(
        4.0,
        description=(
            'Scatter of the ranges about the best pose, over the deviation that they are given, '
            'beyond which odometry and ranges contradict each other (wheels that spin)'
        ),
        above=1.0,
        high=100.0,
    )
    ambiguity: float = parameter(
        6.0,
        description='By how much (log likelihood) any other pose must fit worse',
        above=0.0,
        high=100.0,
    )


@dataclass(frozen=True, slots=True)
class Window:
    """What the start is found from, for m ranges.

    Attributes
    ----------
    ranges, variances : ndarray, shape (m,)
    anchors : ndarray, shape (m, 3)
        Position of the anchor of each range.
    bias_index : ndarray of int, shape (m,)
        Which bias each range carries.
    tags : ndarray, shape (m, 2)
        Tag antenna at each range, in the frame of base_link now.
    tag_height : float
    driven : float
        Length of the way over the window [m].
    turned_variance : float
        Variance of heading that odometry gathers over the window [rad^2].
    """

    ranges: Vector
    variances: Vector
    anchors: Matrix
    bias_index: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    tags: Matrix
    tag_height: float
    driven: float
    turned_variance: float


@dataclass(frozen=True, slots=True)
class Alignment:
    """A pose for now, with biases, and whether to believe it.

    Attributes
    ----------
    mean : ndarray, shape (3 + b,)
        x, y, heading, biases.
    covariance : ndarray, shape (3 + b, 3 + b)
    certain : bool
        Whether heading and position are good enough to start from.
    words : str
        What is still missing, for people; empty when certain.
    contradicted : bool
        Whether no pose explains ranges and odometry together.
    """

    mean: Vector
    covariance: Matrix
    certain: bool
    words: str
    contradicted: bool = False


def align(window: Window, bias_prior: Matrix, config: AlignmentConfig) -> Alignment | None:
    """Return the best pose for now, or None where the ranges do not even give a position.

    Parameters
    ----------
    window : Window
    bias_prior : ndarray, shape (b, b)
        Prior covariance of the range biases.
    config : AlignmentConfig
    """
    prior = _prior_information(bias_prior)
    mean, cost, normal = _minimise(window, prior)
    order = np.argsort(cost)
    best = order[0]
    information = normal[best].copy()
    # All that is known of a heading beforehand; it matters only while nothing else is.
    information[2, 2] += 1.0 / UNKNOWN_YAW_VARIANCE
    eigenvalues = np.linalg.eigvalsh(information)
    if eigenvalues[0] <= 1e-9 * eigenvalues[-1]:
        return None
    residual, _ = _residuals(mean[best : best + 1], window)
    scale = _scatter(residual[0])
    covariance = np.linalg.inv(information) * max(1.0, scale)
    covariance[2, 2] += window.turned_variance
    turned = np.abs(wrap(mean[:, 2] - mean[best, 2]))
    away = np.hypot(mean[:, 0] - mean[best, 0], mean[:, 1] - mean[best, 1])
    rivals = cost[(turned > _SAME_HEADING) | (away > _SAME_PLACE_M)]
    lead = (float(rivals.min()) - float(cost[best])) / max(1.0, scale) if len(rivals) else np.inf
    words = _missing(covariance, lead, config)
    if not words and window.driven < config.min_driven:
        words = 'heading not certain yet: drive on'
    contradicted = scale > config.max_scatter**2
    if contradicted:
        words = 'ranges and odometry contradict each other'
    elif not words:
        standing = _cost_of_standing(window, prior)
        if standing - float(cost[best]) < config.ambiguity * max(1.0, scale):
            words = 'ranges do not show the way that odometry tells: drive on'
    if covariance[2, 2] > 0.5 * UNKNOWN_YAW_VARIANCE or lead < config.ambiguity:
        covariance = _without_heading(covariance, mean, cost, int(best), max(1.0, scale))
    return Alignment(mean[best], covariance, not words, words, contradicted)


def _cost_of_standing(window: Window, prior: Matrix) -> float:
    """Return how well a robot fits that stood all the while: its wheels may have spun."""
    still = replace(window, tags=np.broadcast_to(window.tags[-1], window.tags.shape))
    return float(_minimise(still, prior)[1].min())


def _missing(covariance: Matrix, lead: float, config: AlignmentConfig) -> str:
    heading = math.sqrt(covariance[2, 2])
    position = math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))
    if position > config.max_position_std:
        return f'position known to {position:.2f} m only'
    if heading > config.max_heading_std:
        return 'heading unknown: drive'
    if lead < config.ambiguity:
        return 'pose ambiguous: drive a curve'
    return ''


def _prior_information(bias_prior: Matrix) -> Matrix:
    # A bias with no prior variance is no unknown: a tiny one keeps the matrix invertible.
    size = len(bias_prior)
    information = np.zeros((3 + size, 3 + size))
    information[3:, 3:] = np.linalg.inv(bias_prior + 1e-8 * np.eye(size))
    return information


def _residuals(mean: Matrix, window: Window) -> tuple[Matrix, Matrix]:
    """Return weighted residuals (k, m) and Jacobians (k, m, n) for k candidate states."""
    cos, sin = np.cos(mean[:, 2, None]), np.sin(mean[:, 2, None])
    arm_x = cos * window.tags[:, 0] - sin * window.tags[:, 1]
    arm_y = sin * window.tags[:, 0] + cos * window.tags[:, 1]
    dx = mean[:, 0, None] + arm_x - window.anchors[:, 0]
    dy = mean[:, 1, None] + arm_y - window.anchors[:, 1]
    dz = window.tag_height - window.anchors[:, 2]
    distance = np.maximum(np.sqrt(dx**2 + dy**2 + dz**2), 1e-6)
    weight = 1.0 / np.sqrt(window.variances)
    ux, uy = dx / distance, dy / distance
    jacobian = np.zeros((*distance.shape, mean.shape[1]))
    jacobian[..., 0], jacobian[..., 1] = ux, uy
    jacobian[..., 2] = uy * arm_x - ux * arm_y
    jacobian[:, np.arange(len(window.ranges)), 3 + window.bias_index] = 1.0
    residual = distance + mean[:, 3 + window.bias_index] - window.ranges
    return residual * weight, jacobian * weight[:, None]


def _minimise(window: Window, prior: Matrix) -> tuple[Matrix, Vector, Matrix]:
    size = len(prior)
    mean = np.zeros((2 * _HEADINGS, size))
    mean[:, :2] = _both_sides(window)
    mean[:, 2] = np.linspace(-np.pi, np.pi, 2 * _HEADINGS, endpoint=False)
    damping = np.full(2 * _HEADINGS, 1e-2)
    cost, gradient, normal = _expand(mean, window, prior)
    for _ in range(_ITERATIONS):
        damped = normal.copy()
        diagonal = np.arange(size)
        damped[:, diagonal, diagonal] *= 1.0 + damping[:, None]
        damped[:, diagonal, diagonal] += 1e-9
        step = np.linalg.solve(damped, gradient[..., None])[..., 0]
        trial = mean - step
        new_cost, new_gradient, new_normal = _expand(trial, window, prior)
        better = new_cost < cost
        mean = np.where(better[:, None], trial, mean)
        cost = np.where(better, new_cost, cost)
        gradient = np.where(better[:, None], new_gradient, gradient)
        normal = np.where(better[:, None, None], new_normal, normal)
        damping = np.where(better, damping * 0.2, damping * 8.0)
    mean[:, 2] = wrap(mean[:, 2])
    return mean, cost, normal


def _both_sides(window: Window) -> Matrix:
    """Return starting places, shape (k, 2), alternating between the sides of the anchors' axis.

    Anchors in a line see a place and its mirror image alike: a search that began on one side only
    would never meet the other.
    """
    centre = window.anchors[:, :2].mean(axis=0)
    axes = np.linalg.svd(window.anchors[:, :2] - centre, full_matrices=False)[2]
    offset = 0.5 * float(np.median(window.ranges)) * axes[1]
    side = np.where(np.arange(2 * _HEADINGS) % 2 == 0, 1.0, -1.0)
    return np.asarray(centre + side[:, None] * offset)


def _expand(mean: Matrix, window: Window, prior: Matrix) -> tuple[Vector, Matrix, Matrix]:
    residual, jacobian = _residuals(mean, window)
    square = (residual / _CAUCHY) ** 2
    cost = 0.5 * _CAUCHY**2 * np.log1p(square).sum(axis=1)
    weighted = jacobian / (1.0 + square)[..., None]
    away = mean @ prior
    cost = cost + 0.5 * np.sum(mean * away, axis=1)
    gradient = np.einsum('kmn,km->kn', weighted, residual) + away
    normal = np.einsum('kmn,kmp->knp', weighted, jacobian) + prior
    return cost, gradient, normal


def _scatter(residual: Vector) -> float:
    """Return the variance of weighted residuals, by their median: 1 for noise as told."""
    return float((np.median(np.abs(residual)) / 0.6745) ** 2)


def _without_heading(
    covariance: Matrix, mean: Matrix, cost: Vector, best: int, scale: float
) -> Matrix:
    """Return the covariance when heading is open: position over all solutions, by likelihood."""
    weight = np.exp(-(cost - cost[best]) / scale)
    offset = mean[:, :2] - mean[best, :2]
    spread = (weight[:, None, None] * (offset[:, :, None] * offset[:, None, :])).sum(axis=0)
    open_heading = np.array(covariance)
    open_heading[2, :] = open_heading[:, 2] = 0.0
    open_heading[2, 2] = UNKNOWN_YAW_VARIANCE
    open_heading[:2, :2] += spread / weight.sum()
    return open_heading
