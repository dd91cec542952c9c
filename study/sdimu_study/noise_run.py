"""One run of the study of noise with a memory: simulate a test in it, diagnose it, score terms and coefficients."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import from_si, to_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.coloured import KINDS, parse_noise
from sdimu_study.grade_run import LATITUDES_DEG, PLANS, drawn_effect, simulated_test
from sdimu_study.hidden_score import baseline_z, same_effect

_INSTABILITY = {"gyro": to_si(0.01, "deg/h"), "accel": to_si(2.0, "ug")}
"""Bias instability (rad/s, m/s^2) where the IMU file states none: of navigation-grade sensors."""
_TAUS_S = (100.0, 1000.0)
"""Range of the time constant of Markov noise (s)."""
_WALK_S = 1000.0
"""Averaging time (s) at which the Allan deviation of a random walk is the bias instability."""


@dataclass(frozen=True)
class NoiseRun:
    """Simulate a test of one IMU file in one kind of noise of data-sheet size, and diagnose it.

    Attributes
    ----------
    imu : str
        Name in config/imu.
    kind : str
        One of `sdimu_sim.core.coloured.KINDS`, or ``white``.
    sigmas : float
        Size of one effect to hide, in the sigma that the test gives it in the true noise; 0 hides none.
    """

    imu: str
    kind: str
    sigmas: float = 0.0

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: verdict, terms and effects that were found, errors over sigma of the coefficients.

        Raises
        ------
        DataError
            When the test cannot be calibrated.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(f"{self.imu} {self.kind}".encode())]))
        imu = load_imu(self.imu)
        plan, site = str(rng.choice(PLANS)), Site(math.radians(float(rng.choice(LATITUDES_DEG))), 0.0)
        noise = () if self.kind == "white" else drawn_noise(imu, self.kind, rng)
        model, hidden = load_model("baseline"), None
        keys = list(map(parse_noise, noise))
        if self.sigmas:
            clean = solve(simulated_test(self.imu, imu, plan, site, seed, ())[0], model)
            true = [NoiseTerm(key.triad, key.kind, key.tau, key.size) for key in keys]
            hidden = drawn_effect(rng, clean, (self.sigmas, self.sigmas), noise=true)
        effects = () if hidden is None else (hidden.text,)
        test, sensor = simulated_test(self.imu, imu, plan, site, seed, effects, noise)
        found = climb(solve(test, model))
        # From here on the truth is known; nothing before this line has seen it.
        z = baseline_z(found.after, sensor)
        truth = {key.triad: key.size for key in keys}
        stops = found.evidence.times.stops
        named = [[f.candidate.label, *f.alike] for f in found_effects(found)]
        right = [hidden is not None and any(same_effect(n, hidden, stops) for n in one) for one in named]
        terms = [
            {"triad": t.triad, "kind": t.kind, "size": t.size, "low": t.low, "high": t.high, "alike": list(t.alike),
             "true": truth.get(t.triad, 0.0)}
            for t in found.found.noise
        ]  # fmt: skip
        return {
            "plan": plan, "estimator": found.fit.estimator, "verdict": found.verdict, "noise": list(noise),
            "terms": terms, "hidden": hidden.text if hidden else "", "named": any(right),
            "effects": [one[0] for one, true in zip(named, right, strict=True) if not true],
            "z2": float(np.sum(z**2)), "count": len(z), "largest_z": float(np.max(np.abs(z))),
        }  # fmt: skip


def drawn_noise(imu: ImuSpecification, kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """Noise of a kind for both triads, of the size that the IMU file states as bias instability."""
    if kind not in KINDS:
        raise ValueError(f"noise '{kind}': expected one of {', '.join(KINDS)}")
    stated = {"gyro": imu.gyro_bias_instability, "accel": imu.accel_bias_instability}
    out = []
    for triad, unit in (("gyro", "deg/h"), ("accel", "ug")):
        size, shown = stated[triad] or _INSTABILITY[triad], unit
        if kind == "random_walk":
            size, shown = 0.664 * size * math.sqrt(3.0 / _WALK_S), f"{unit}/sqrt(h)"
        tau = f"(tau={float(np.exp(rng.uniform(*np.log(_TAUS_S)))):.0f} s)" if kind == "markov" else ""
        out.append(f"{triad}_noise_{kind}{tau}={float(from_si(size, shown)):.5g} {shown}")
    return tuple(out)
