"""Bound of a plan: sigma of every coefficient that a batch of all data of a perfect IMU reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.batch.batch import bound_covariance
from sdimu_calibration.core.effects import body_frame, imu_model
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.evidence.known import Known
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.plan_search.known import together
from sdimu_calibration.core.planning.predict import prepare
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

_FIXED = 1e-6
"""Share of its prior below which a sigma is zero by definition of the body frame: above rounding."""
_UNSEEN = 0.99
"""Share of its prior from which a sigma tells nothing (1): a plan that shows less of it leaves it as it was."""


@dataclass(frozen=True)
class Question:
    """What a plan has to determine."""

    site: Site
    imu: ImuSpecification
    model: Model
    """Its effects are to be determined."""
    known: Known | None = None
    """What earlier data know of the unit."""


@dataclass(frozen=True)
class Bounds:
    """Sigmas that a plan reaches, what was known before it counted."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    """`names`, `units`: coefficients and their display units, length p."""
    effect: tuple[str, ...]
    """Effect of each coefficient, length p."""
    covariance: Floats
    """Shape (p, p). Frame of the prior; SI."""
    sigma: Floats
    """Shape (p,). In the reported body frame; SI."""
    prior: Floats
    """Shape (p,). Sigma before the test; SI."""

    def largest(self) -> dict[str, float]:
        """Largest sigma of each effect's coefficients (SI); those that the body frame fixes do not count."""
        out: dict[str, float] = {}
        for effect, sigma, prior in zip(self.effect, self.sigma, self.prior, strict=True):
            if sigma > _FIXED * prior:
                out[effect] = max(out.get(effect, 0.0), float(sigma))
        return out

    @property
    def unseen(self) -> tuple[str, ...]:
        """Effects with a coefficient of which a plan shows nothing: its sigma stays that of the prior, or nearly so."""
        stays = self.sigma > _UNSEEN * self.prior
        return tuple(dict.fromkeys(effect for effect, one in zip(self.effect, stays, strict=True) if one))

    @property
    def spread(self) -> float:
        """Geometric mean of the sigmas along the principal axes of the covariance over those of the priors (1)."""
        scaled = self.covariance / np.outer(self.prior, self.prior)
        return float(np.exp(0.5 * np.linalg.slogdet(scaled)[1] / len(self.prior)))


def bounds(plan: Plan, asked: Question) -> Bounds:
    """Compute the sigmas that a plan reaches."""
    nominal = prepare(plan, asked.site, asked.imu, asked.model, None, None)
    sensors = nominal.setup.sensors
    alone = bound_covariance(nominal.prepared, nominal.setup, nominal.start)
    covariance = alone if asked.known is None else together(asked.known, sensors.names, sensors.prior, alone)
    return _bounds(sensors, asked, covariance)


def already(asked: Question) -> Bounds:
    """Give the sigmas before a plan is run: what is known already, or the priors."""
    sensors = imu_model.build(asked.model.effects, asked.imu)
    return _bounds(sensors, asked, together(asked.known, sensors.names, sensors.prior, None))


def _bounds(sensors: ImuModel, asked: Question, covariance: Floats) -> Bounds:
    J = body_frame.frame_jacobian(sensors.names, asked.model.body_frame)
    effects = [e.family or e.name for e in sensors.effects for _ in e.parameters]
    return Bounds(
        sensors.names,
        tuple(p.display_unit for p in sensors.parameters),
        tuple(effects),
        covariance,
        np.sqrt(np.diag(J @ covariance @ J.T)),
        sensors.prior,
    )
