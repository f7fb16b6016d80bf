"""Drives of Sun's room, simulated once for all that survey them."""

from __future__ import annotations

import pytest

from tablerunner.experiments.survey import PROTOTYPE, Recorded, recorded


@pytest.fixture(scope='session')
def drives() -> list[Recorded]:
    """Return twenty drives of 40 m with the noise of the prototype."""
    return recorded(PROTOTYPE, range(20))
