"""How far a robot runs before it stands, and how fast it may be to stand in time.

With speed v, delay t until the brakes bite, deceleration a, and something that comes nearer by
itself at speed u until the robot stands, the gap closes by

    d(v) = v t + v^2 / (2 a) + u (t + v / a)                                              (1)

and the largest speed whose d(v) fits into a free way F is

    v(F) = a (-q + sqrt(q^2 + 2 (F - u t) / a)),   q = t + u / a                           (2)

(zero when F <= u t). docs/safety.md.
"""

from __future__ import annotations

import numpy as np

from tablerunner.types import Vector


def stopping_distance(
    speed: float, delay: float, deceleration: float, approach: float = 0.0
) -> float:
    """Return by how much a gap closes until the robot stands [m], (1).

    Parameters
    ----------
    speed : float
        Of the robot, at least 0 [m/s].
    delay : float
        From the reading to the brakes [s].
    deceleration : float
        Above 0 [m/s^2].
    approach : float
        Speed at which the other comes nearer [m/s].
    """
    brake = speed / deceleration
    return speed * delay + 0.5 * speed * brake + approach * (delay + brake)


def largest_speed(
    way: Vector | float, delay: float, deceleration: float, approach: Vector | float = 0.0
) -> Vector:
    """Return the speeds from which the robot stands within each `way` [m/s], (2).

    Arguments as above; `way` and `approach` may be arrays, which are broadcast.
    """
    room = np.maximum(way - approach * np.float64(delay), 0.0)
    wait = delay + approach / np.float64(deceleration)
    root = np.sqrt(wait**2 + 2.0 * room / deceleration)
    return np.asarray(np.maximum(deceleration * (root - wait), 0.0))
