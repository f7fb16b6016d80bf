"""Our inference against scikit-fuzzy's, on the same rule bases."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tablerunner.control.fuzzy import base_names, load_base

pytest.importorskip('skfuzzy', reason='scikit-fuzzy is not installed: make setup')
BENCH = Path(__file__).parents[5] / 'bench'


@pytest.fixture(scope='module')
def reference() -> ModuleType:
    """Return the module by which `make bench` rebuilds our rule bases."""
    spec = importlib.util.spec_from_file_location('skfuzzy_twin', BENCH / 'skfuzzy_twin.py')
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows_of(base, count: int) -> np.ndarray:
    low, high = ([getattr(item, end) for item in base.inputs] for end in ('low', 'high'))
    return np.random.default_rng(9).uniform(low, high, (count, len(low)))


@pytest.mark.parametrize('name', base_names())
def test_centroid_is_that_of_scikit_fuzzy(name: str, reference: ModuleType) -> None:
    """To 1e-3 of the domain.

    Over a universe of 301 points, which holds the corners of all sets, what is left is how each
    side sums up the area between grid points where two sets cross.
    """
    base = replace(load_base(name), defuzzification='centroid')
    twin, rows = reference.twin(base, 301), rows_of(base, 15)
    theirs = [reference.compute(twin, base, row) for row in rows]
    width = base.output.high - base.output.low
    np.testing.assert_allclose(base.infer(rows), theirs, atol=1e-3 * width)


@pytest.mark.parametrize('name', base_names())
def test_weighted_average_is_that_of_its_memberships(name: str, reference: ModuleType) -> None:
    """scikit-fuzzy has no weighted average: memberships by it, Lv (12) by hand; exact."""
    base = load_base(name)
    rows = rows_of(base, 100)
    theirs = [reference.ByHand(base, 301).compute(row) for row in rows]
    np.testing.assert_allclose(base.infer(rows), theirs, atol=1e-9)
