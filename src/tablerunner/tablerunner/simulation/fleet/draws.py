"""Random numbers of many runs, each from its own stream, drawn in blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Draws:
    """Gives one row of random numbers for all runs at a time.

    Blocks have a fixed length, so that a run's numbers do not depend on the other runs; asking
    every generator at every step would cost more than everything else.

    Parameters
    ----------
    generators : sequence of Generator
        One for each run.
    normals, uniforms : int
        Numbers in a row: from the standard normal distribution, and from [0, 1).
    block : int
        Rows that are drawn at a time.
    """

    def __init__(
        self,
        generators: Sequence[np.random.Generator],
        normals: int,
        uniforms: int = 0,
        block: int = 64,
    ) -> None:
        self._generators = generators
        self._normals = np.empty((block, normals, len(generators)))
        self._uniforms = np.empty((block, uniforms, len(generators)))
        self._next = block

    def row(self) -> tuple[Array, Array]:
        """Return the next normal, shape (normals, runs), and uniform, (uniforms, runs), ones."""
        block, normals, _ = self._normals.shape
        uniforms = self._uniforms.shape[1]
        if self._next == block:
            for run, generator in enumerate(self._generators):
                self._normals[:, :, run] = generator.standard_normal((block, normals))
                if uniforms:
                    self._uniforms[:, :, run] = generator.random((block, uniforms))
            self._next = 0
        index, self._next = self._next, self._next + 1
        return self._normals[index], self._uniforms[index]
