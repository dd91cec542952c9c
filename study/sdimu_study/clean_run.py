"""One run of the study of clean tests: any IMU file on any plan at any site, nothing hidden, diagnosed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.grade_run import HANDHELD, LATITUDES_DEG, scored_row, simulated_test
from sdimu_study.plan_draw import PLANS

BY_HAND = "by hand"
"""In the place of a plan: a run by hand."""
RATES_HZ = (20.0, 50.0, 100.0)
"""Sample rates that are drawn (Hz): what is found in the samples, such as rests, depends on the rate."""


@dataclass(frozen=True)
class CleanRun:
    """Simulate a test with nothing hidden in it and diagnose it with nothing but the IMU file and the site.

    Attributes
    ----------
    imu : str
        Name in config/imu.
    plan : str
        One of `sdimu_study.plan_draw.PLANS`; a run by hand has none.
    """

    imu: str
    plan: str

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: verdict, what was named, errors over sigma of the coefficients.

        Raises
        ------
        DataError
            When the test cannot be calibrated.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(f"clean {self.imu} {self.plan}".encode())]))
        site = Site(math.radians(float(rng.choice(LATITUDES_DEG))), 0.0)
        rate_hz = float(rng.choice(RATES_HZ))
        # Draws of a seed are the same in any file and plan: a chance that makes a false alarm would make one in all.
        own = int(rng.integers(2**31))
        test, sensor = simulated_test(self.imu, load_imu(self.imu), self.plan, site, own, (), rate_hz=rate_hz)
        found = climb(solve(test, load_model("hand" if self.imu == HANDHELD else "baseline")))
        # From here on the truth is known; nothing before this line has seen it.
        row = scored_row(found, sensor, None)
        return row | {
            "latitude_deg": math.degrees(site.latitude_rad), "rate_hz": rate_hz, "noise": list(found.noise),
            "estimator": found.before.estimator,
        }  # fmt: skip


def plans_of(imu: str) -> tuple[str, ...]:
    """Name the plans on which an IMU file is tested: all, or none for runs by hand."""
    return (BY_HAND,) if imu == HANDHELD else PLANS
