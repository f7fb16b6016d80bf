"""Triples of anchors: which there are, and which to take when one is enough."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tablerunner.uwb.epochs import Array, flatness
from tablerunner.uwb.solvers.linear import LEAST_FLATNESS

Triple = tuple[int, int, int]


def triples_by_area(anchors: Array) -> tuple[Triple, ...]:
    """Return all triples that are not in one line, the widest triangle first.

    Triangles of one area keep the order of their anchors.
    """
    return _triples_by_area(tuple((float(x), float(y)) for x, y in anchors[:, :2]))


@lru_cache(maxsize=16)
def _triples_by_area(plan: tuple[tuple[float, float], ...]) -> tuple[Triple, ...]:
    # Anchors stay where they are, and this takes longer than solving a few epochs.
    places = np.array(plan).reshape(-1, 2)
    found: list[tuple[float, Triple]] = []
    for triple in combinations(range(len(places)), 3):
        mask = np.zeros((1, len(places)), dtype=bool)
        mask[0, list(triple)] = True
        if flatness(places, mask)[0][0] < LEAST_FLATNESS:
            continue
        (ax, ay), (bx, by), (cx, cy) = places[list(triple)]
        area = 0.5 * abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
        # Rounded, lest the last digit decide between equal triangles.
        found.append((-round(float(area), 6), triple))
    return tuple(triple for _, triple in sorted(found))


def choose_triples(
    triples: tuple[Triple, ...], usable: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return for each epoch the first of the triples whose ranges are all there.

    Parameters
    ----------
    triples : tuple of k triples
    usable : ndarray of bool, shape (m, n)

    Returns
    -------
    chosen : ndarray of int, shape (m, 3)
        Indices of anchors; 0, 0, 0 where there is no such triple.
    found : ndarray of bool, shape (m,)
    """
    chosen = np.zeros((len(usable), 3), dtype=np.int64)
    found = np.zeros(len(usable), dtype=bool)
    for triple in triples:
        here = ~found & usable[:, list(triple)].all(axis=1)
        chosen[here] = triple
        found |= here
        if found.all():
            break
    return chosen, found
