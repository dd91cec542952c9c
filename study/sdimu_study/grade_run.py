"""One run of the study over IMU files: simulate a clean test, or one with a hidden effect, and diagnose it."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.effect_key import parse_key, sized
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import choose_estimator, solve
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, against_gravity, by_hand_recording
from sdimu_sim.core.hidden import one_sided, size_unit
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth
from sdimu_sim.core.truth import Truth as TestTruth
from sdimu_study.hidden_draw import PLAUSIBLE, TESTABLE, Truth, hideable_names
from sdimu_study.hidden_score import baseline_z, same_effect
from sdimu_study.plan_draw import FILED, study_plan, study_table
from sdimu_study.run import in_the_mean, simulate

PLANS = FILED
"""Plans that are drawn."""
LATITUDES_DEG = (-50.0, -20.0, 20.0, 36.4, 52.0, 60.0)
"""Latitudes that are drawn (deg)."""
HANDHELD = "mems_by_hand"
"""IMU file of runs by hand."""
RESTS = 24
"""Attitudes of a run by hand."""
_RATE_HZ = 20.0
"""Sample rate on the table (Hz) where none is drawn: navigation cycles are 0.1 s at any rate, so this costs no
information."""
_SPAN = (10.0, 30.0)
"""Size of a hidden effect, in the sigma of the clean test."""


@dataclass(frozen=True)
class GradeRun:
    """Simulate a test of one IMU file, diagnose it with nothing but the file and the site, and score by name.

    Attributes
    ----------
    imu : str
        Name in config/imu.
    hidden : bool
        Hide one effect of 10 to 30 sigma.
    """

    imu: str
    hidden: bool

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: verdict, estimator, errors over sigma of the coefficients, whether the effect was named.

        Raises
        ------
        DataError
            When the test cannot be calibrated.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(self.imu.encode())]))
        imu = load_imu(self.imu)
        plan, site = str(rng.choice(PLANS)), Site(math.radians(float(rng.choice(LATITUDES_DEG))), 0.0)
        test, sensor = simulated_test(self.imu, imu, plan, site, seed, ())
        model = _model(self.imu)
        fit, truth = solve(test, model), None
        if self.hidden:
            truth = drawn_effect(rng, fit)
            test, sensor = simulated_test(self.imu, imu, plan, site, seed, (truth.text,))
            fit = solve(test, model)
        found = climb(fit)
        # From here on the truth is known; nothing before this line has seen it.
        return scored_row(found, sensor, truth) | {"plan": plan, "latitude_deg": math.degrees(site.latitude_rad)}


def simulated_test(
    name: str, imu: ImuSpecification, plan: str, site: Site, seed: int, effects: tuple[str, ...],
    noise: tuple[str, ...] = (), rate_hz: float = _RATE_HZ,
) -> tuple[PreparedTest, ImuTruth]:  # fmt: skip
    """Simulate a test and open it as every recording is opened; a run by hand states no site and has its own rate."""
    if name == HANDHELD:
        run = ByHand(RESTS, imu, site, seed=seed, effects=effects)
        recording, truth = by_hand_recording(run)
        true_gravity = float(earth.normal_gravity(site.latitude_rad, site.height_m))
        told: TestTruth = against_gravity(truth, STANDARD_GRAVITY, true_gravity)
        return _opened(recording, imu, site, assumed="any"), told.imu
    scenario = Scenario(
        study_plan(plan, seed), imu, site, study_table(plan), rate_hz=rate_hz, seed=seed, effects=effects, noise=noise
    )
    sensor = imu_truth(scenario)
    recording = simulate(scenario, sensor)
    return _opened(recording, imu, site, assumed=""), in_the_mean(sensor, recording, seed)


def _opened(recording: Recording, imu: ImuSpecification, site: Site, assumed: str) -> PreparedTest:
    return PreparedTest(*open_test(recording, OpeningOptions(imu, site, assumed)))


def choice(name: str, plan: str, seed: int) -> str:
    """Name the estimator that a clean test of an IMU file on a plan gets."""
    test, _ = simulated_test(name, load_imu(name), plan, Site(math.radians(36.4), 0.0), seed, ())
    return choose_estimator(test, _model(name)).estimator


def _model(name: str) -> Model:
    return load_model("hand" if name == HANDHELD else "baseline")


def drawn_effect(
    rng: np.random.Generator, fit: Fit, span: tuple[float, float] = _SPAN, families: Collection[str] = (),
    options: bool = False, noise: Sequence[NoiseTerm] = (),
) -> Truth:  # fmt: skip
    """Draw family, then parameter, among what a clean test can see at a plausible size.

    Parameters
    ----------
    rng : Generator
    fit : Fit
        Of the clean test.
    span : (float, float)
        Size, in the sigma of the clean test.
    families : collection of str
        Those to draw from; all without any.
    options : bool
        Draw effects with a time constant or the like, too: those that the scan tries.
    noise : sequence of NoiseTerm
        Noise with a memory that the sigmas count.

    Raises
    ------
    DataError
        When the test sees none of them.
    """
    known = catalogue(fit.timetable, set(fit.labels), has_temperature=False)
    evidence = fit.evidence([e for e in known if not (fit.learns_scatter and (e.options or e.needs_table))])
    if noise:
        evidence = evidence.with_noise(wander_in(fit.evidence(), noise).modes(noise).columns)
    scanned = scan(evidence.information, evidence.model, evidence.weight)
    p, hideable = len(evidence.weight), hideable_names()
    # What a coefficient of the model is but for its prior is not missing: mass unbalance is a sensitivity to force.
    free = scan(evidence.information, evidence.model, 1e-9 * evidence.weight).retention
    size = float(np.exp(rng.uniform(*np.log(span))))
    pool: dict[str, list[int]] = {}
    for k, candidate in enumerate(evidence.candidates):
        name = candidate.parameter.name
        left = min(scanned.retention[p + k], free[p + k])
        wanted = candidate.family in families if families else name in hideable
        seen = wanted and (options or not candidate.effect.options) and left >= TESTABLE
        if seen and size * scanned.sigma[p + k] <= PLAUSIBLE * evidence.prior[k]:
            pool.setdefault(candidate.family, []).append(k)
    if not pool:
        what = ", ".join(families) or "the catalogue"
        raise DataError(f"nothing of {what} can be seen in this test at {size:.0f} sigma")
    family = str(rng.choice(sorted(pool)))
    candidate = evidence.candidates[k := int(rng.choice(pool[family]))]
    name = candidate.parameter.name
    value = size * float(scanned.sigma[p + k]) * float(rng.choice((-1.0, 1.0)))
    value = abs(value) if one_sided(name) or candidate.effect.positive else value
    return Truth(name, family, _option(candidate.label), value, size, sized(candidate.label, value, size_unit(name)))


def _option(label: str) -> tuple[str, float] | None:
    """First option of a label, such as ``("tau", 300.0)``."""
    for key, text in parse_key(label).options.items():
        return key, float(text.split()[0])
    return None


def scored_row(found: Diagnosis, sensor: ImuTruth, truth: Truth | None) -> dict[str, Any]:
    """Score a diagnosis by the truth: errors over sigma of the coefficients, whether the effect was named."""
    z = baseline_z(found.after, sensor)
    named = [[f.candidate.label, *f.alike] for f in found_effects(found)]
    stops = found.evidence.times.stops
    row = {
        "estimator": found.fit.estimator, "verdict": found.verdict, "sentence": found.sentence, "named": named,
        "z2": float(np.sum(z**2)), "count": len(z), "largest_z": float(np.max(np.abs(z))),
        "held_out": found.after.fit["held_out_rms"], "accuses": any(f.grave for f in found.findings),
    }  # fmt: skip
    if truth is None:
        return row
    first = bool(named) and same_effect(named[0][0], truth, stops)
    in_class = any(same_effect(label, truth, stops) for one in named for label in one)
    return row | {"truth": truth.text, "sigmas": truth.sigmas, "in_class": in_class, "first": first}
