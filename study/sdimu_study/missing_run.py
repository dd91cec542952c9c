"""One run of the study of missing physics: hide an effect, diagnose as if the catalogue lacked it, or had it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.mean_bias import BIASES
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.grade_run import LATITUDES_DEG, PLANS, drawn_effect, scored_row, simulated_test

_SPAN = (15.0, 30.0)
"""Size of the hidden effect, in the sigma of the clean test."""


@dataclass(frozen=True)
class MissingRun:
    """Hide an effect of one family; diagnose with the catalogue as it is, and without the family.

    Attributes
    ----------
    imu : str
        Name in config/imu.
    family : str
        Registry name of the effect.
    """

    imu: str
    family: str

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: ``with`` and ``without`` the effect in the catalogue, each a row as `scored_row` makes it.

        Raises
        ------
        DataError
            When the test cannot be calibrated or does not show the effect.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(f"{self.imu} {self.family}".encode())]))
        imu, model = load_imu(self.imu), load_model("baseline")
        plan, site = str(rng.choice(PLANS)), Site(math.radians(float(rng.choice(LATITUDES_DEG))), 0.0)
        test, _ = simulated_test(self.imu, imu, plan, site, seed, ())
        clean = test.recording
        truth = drawn_effect(rng, solve(test, model), _SPAN, (self.family,), options=True)
        test, sensor = simulated_test(self.imu, imu, plan, site, seed, (truth.text,))
        fit = solve(test, model)
        known, lacking = climb(fit), climb(fit, without=(self.family,))
        # From here on the truth is known; nothing before this line has seen it.
        meant = with_mean_error(sensor, clean, test.recording) if registry.get(self.family).wander_like else sensor
        return {
            "with": scored_row(known, sensor, truth), "without": scored_row(lacking, meant, truth),
            "plan": plan, "latitude_deg": math.degrees(site.latitude_rad),
        }  # fmt: skip


def with_mean_error(sensor: ImuTruth, clean: Recording, disturbed: Recording) -> ImuTruth:
    """Return a sensor whose biases are means over the dwells of all that a transient adds.

    A transient of one sense after every turn is, for who does not know it, a part of the bias: the estimate states the
    bias in the mean over the dwells, and so does this truth. Noise is the same in both recordings and cancels.

    Parameters
    ----------
    sensor : ImuTruth
    clean, disturbed : Recording
        The same test without the transient and with it.
    """
    log = disturbed.phase
    if log is None:
        return sensor
    middle = disturbed.t - 0.5 * disturbed.interval_s
    rest = np.asarray(log.dwell)[np.clip(np.searchsorted(log.t, middle, side="right") - 1, 0, None)].astype(bool)
    added = np.hstack([disturbed.omega_ib_b - clean.omega_ib_b, disturbed.f_ib_b - clean.f_ib_b])[rest].mean(axis=0)
    shifted = {name: sensor.coefficients.get(name, 0.0) + float(m) for name, m in zip(BIASES, added, strict=True)}
    return replace(sensor, coefficients={**sensor.coefficients, **shifted})
