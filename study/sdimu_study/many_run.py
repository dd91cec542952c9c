"""One run of the study of many effects: hide five to twelve at once, diagnose, score each by name."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.grade_run import LATITUDES_DEG, drawn_effect, simulated_test
from sdimu_study.hidden_draw import Truth
from sdimu_study.hidden_score import baseline_z, same_effect

_SPAN = (3.0, 50.0)
"""Size of each effect, in the sigma of the clean test."""
_NUMBER = (5, 13)
"""Least number of effects, and one more than the largest."""
_PLANS = ("kim18_signed", "recommended")
"""Plans that show most of the catalogue."""


@dataclass(frozen=True)
class ManyRun:
    """Hide many effects in a test of one IMU file and diagnose it.

    Attributes
    ----------
    imu : str
        Name in config/imu.
    """

    imu: str

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: which effects were named, which names are wrong, errors over sigma of the coefficients.

        Raises
        ------
        DataError
            When the test cannot be calibrated.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(f"many {self.imu}".encode())]))
        imu, model = load_imu(self.imu), load_model("baseline")
        plan, site = str(rng.choice(_PLANS)), Site(math.radians(float(rng.choice(LATITUDES_DEG))), 0.0)
        fit = solve(simulated_test(self.imu, imu, plan, site, seed, ())[0], model)
        truths: dict[str, Truth] = {}
        for _ in range(int(rng.integers(*_NUMBER))):
            drawn = drawn_effect(rng, fit, _SPAN)
            truths.setdefault(drawn.name, drawn)
        test, sensor = simulated_test(self.imu, imu, plan, site, seed, tuple(t.text for t in truths.values()))
        began = time.process_time()
        found = climb(solve(test, model))
        seconds = time.process_time() - began
        # From here on the truth is known; nothing before this line has seen it.
        stops = found.evidence.times.stops
        named = [[f.candidate.label, *f.alike] for f in found_effects(found)]
        hits = [
            {"text": t.text, "sigmas": t.sigmas, "named": any(same_effect(n, t, stops) for one in named for n in one)}
            for t in truths.values()
        ]
        wrong = [one[0] for one in named if not any(same_effect(n, t, stops) for t in truths.values() for n in one)]
        z = baseline_z(found.after, sensor)
        return {
            "plan": plan, "latitude_deg": math.degrees(site.latitude_rad), "verdict": found.verdict, "effects": hits,
            "found": len(named), "wrong": wrong, "noise": list(found.noise), "seconds": seconds,
            "z2": float(np.sum(z**2)), "count": len(z), "largest_z": float(np.max(np.abs(z))),
        }  # fmt: skip
