"""Random streams: one for each thing that is random, all from one seed."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, name: str) -> np.random.Generator:
    """Return the random stream of one thing.

    Streams of different names are independent, and what one draws does not move another: switching
    off one sensor leaves the errors of all others as they were.
    """
    key = zlib.crc32(name.encode())
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(key,))))
