"""Hypothesis strategies for records that messages can carry."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from tablerunner.geometry.pose import Pose2
from tablerunner.types import Matrix

stamps = st.integers(0, (2**31 - 1) * 10**9)
lengths = st.floats(-1e6, 1e6)
positive = st.floats(0.0, 1e6)
headings = st.floats(-math.pi, math.pi)
words = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=12)
unknown = st.just(math.nan)


def poses() -> st.SearchStrategy[Pose2]:
    """Return poses in the plane."""
    return st.builds(Pose2, lengths, lengths, headings)


def covariances(size: int) -> st.SearchStrategy[Matrix]:
    """Return covariances, shape (size, size), with small variances."""
    factors = st.lists(st.floats(-1.0, 1.0), min_size=size * size, max_size=size * size)

    def product(values: list[float]) -> Matrix:
        factor = np.array(values).reshape(size, size)
        return factor @ factor.T

    return factors.map(product)
