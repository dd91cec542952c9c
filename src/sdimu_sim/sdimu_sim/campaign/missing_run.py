"""One run of the study of missing physics: hide an effect, diagnose as if the catalogue lacked it, or had it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.config import load_imu, load_model
from sdimu_sim.campaign.grade_run import LATITUDES_DEG, PLANS, drawn_effect, scored_row, simulated_test

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
        truth = drawn_effect(rng, solve(test, model), _SPAN, (self.family,), options=True)
        test, sensor = simulated_test(self.imu, imu, plan, site, seed, (truth.text,))
        fit = solve(test, model)
        known, lacking = climb(fit), climb(fit, without=(self.family,))
        # From here on the truth is known; nothing before this line has seen it.
        return {
            "with": scored_row(known, sensor, truth), "without": scored_row(lacking, sensor, truth),
            "plan": plan, "latitude_deg": math.degrees(site.latitude_rad),
        }  # fmt: skip
