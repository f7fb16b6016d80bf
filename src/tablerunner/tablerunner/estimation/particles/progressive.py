"""A measurement taken in parts, where all of it at once would leave hardly a particle.

Particles all over a room and a camera that knows a place to two centimetres: of four thousand one
or two are near it, and their headings would be all that is left. Progressive correction (Musso,
Oudjane and Le Gland 2001) takes the likelihood to a power first, small enough that enough
particles keep weight, resamples them and moves them apart, and goes on with what is left of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from tablerunner.estimation.particles.swarm import Swarm
from tablerunner.estimation.particles.weights import effective_size, normalised
from tablerunner.types import Vector

FEWEST = 100.0
"""Effective particles that each part is to leave."""

_MOST_PARTS = 30
_HALVINGS = 30


def progressed(
    swarm: Swarm,
    gained: Vector,
    log_likelihood: Callable[[Swarm], Vector],
    resampled: Callable[[Swarm], Swarm],
) -> Swarm:
    """Return the swarm after all parts of a measurement, of weights that add up to one.

    Parameters
    ----------
    swarm : Swarm
        Where the particles were drawn, with the weights from before.
    gained : ndarray, shape (n,)
        Log of what the whole measurement multiplies the weights by.
    log_likelihood : callable
        The same for another swarm that has been drawn in the meantime.
    resampled : callable
        Resamples, and moves particles apart.
    """
    left = 1.0
    for _ in range(_MOST_PARTS):
        part = largest_part(swarm.log_weights, gained, left)
        weighed = normalised(swarm.log_weights + part * gained)
        swarm = replace(swarm, log_weights=weighed.log_weights)
        left -= part
        if left <= 0.0:
            break
        swarm = resampled(swarm)
        gained = log_likelihood(swarm)
    return swarm


def largest_part(log_weights: Vector, gained: Vector, left: float) -> float:
    """Return the largest power, at most `left`, that leaves `FEWEST` effective particles.

    Halved again and again: where not even a small part does, a small part it is.
    """
    wanted = min(FEWEST, 0.25 * len(log_weights))
    # Minus infinity to any power is nothing: such a particle is gone with the first part.
    if _effective(log_weights + left * gained) >= wanted:
        return left
    low, high = 0.0, left
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _effective(log_weights + middle * gained) >= wanted:
            low = middle
        else:
            high = middle
    return max(low, 1e-3 * left)


def _effective(log_weights: Vector) -> float:
    return effective_size(normalised(log_weights).log_weights)
