"""Every estimator by the name that chooses it."""

from __future__ import annotations

from typing import Protocol

from tablerunner.estimation.ddf import Ddf
from tablerunner.estimation.dead_reckoning import DeadReckoning
from tablerunner.estimation.ekf import Ekf
from tablerunner.estimation.ekf_cv import EkfCv
from tablerunner.estimation.estimator import Estimator, EstimatorConfig
from tablerunner.estimation.iekf import Iekf, LmIekf
from tablerunner.estimation.kf import Kf
from tablerunner.estimation.models.range_model import Point3
from tablerunner.estimation.particles.robot import (
    ParticleEkf,
    ParticleIekf,
    ParticleUiekf,
    RobotParticleFilter,
)
from tablerunner.estimation.ukf import Ukf
from tablerunner.types import Anchor


class EstimatorFactory(Protocol):
    """A class of estimators, made for settings, anchors and the tag's place in base_link."""

    @property
    def takes_positions(self) -> bool:
        """Whether it needs ranges made into positions first."""
        ...

    def __call__(
        self, config: EstimatorConfig, anchors: tuple[Anchor, ...], lever_arm: Point3
    ) -> Estimator:
        """Make one."""
        ...


ESTIMATORS: dict[str, EstimatorFactory] = {
    Ekf.name: Ekf,
    Ukf.name: Ukf,
    Kf.name: Kf,
    EkfCv.name: EkfCv,
    Ddf.name: Ddf,
    DeadReckoning.name: DeadReckoning,
    Iekf.name: Iekf,
    LmIekf.name: LmIekf,
    RobotParticleFilter.name: RobotParticleFilter,
    ParticleEkf.name: ParticleEkf,
    ParticleIekf.name: ParticleIekf,
    ParticleUiekf.name: ParticleUiekf,
}

STARTS_ANYWHERE = frozenset(
    {RobotParticleFilter.name, ParticleEkf.name, ParticleIekf.name, ParticleUiekf.name}
)
"""Those that find their start by themselves."""
