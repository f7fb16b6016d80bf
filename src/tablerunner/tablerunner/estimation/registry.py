"""Every estimator by the name that chooses it."""

from __future__ import annotations

from collections.abc import Callable

from tablerunner.estimation.dead_reckoning import DeadReckoning
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.estimator import Estimator, EstimatorConfig
from tablerunner.estimation.models.range_model import Point3
from tablerunner.estimation.ukf import Ukf
from tablerunner.types import Anchor

ESTIMATORS: dict[str, Callable[[EstimatorConfig, tuple[Anchor, ...], Point3], Estimator]] = {
    Ekf.name: Ekf,
    Ukf.name: Ukf,
    DeadReckoning.name: DeadReckoning,
}
