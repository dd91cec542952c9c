"""Worlds of studies: tests of any IMU file on any plan at any site, with noise and hidden effects, and their truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any
from zlib import crc32

import numpy as np

from rate_table_sim.core import TableMotion, TableSpecification, phase_changes, table_motion
from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.effect_key import parse_key, sized
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import choose_estimator, solve
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand, against_gravity, by_hand_recording
from sdimu_sim.core.generator import simulate_imu
from sdimu_sim.core.hidden import drawn_names, one_sided, size_unit
from sdimu_sim.core.mean_bias import mean_bias
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, imu_truth, temperature_log
from sdimu_sim.core.true_coefficients import true_coefficients
from sdimu_sim.core.truth import ImuTruth
from sdimu_sim.core.truth import Truth as TestTruth
from sdimu_study.plans import FILED, study_plan, study_table

LATITUDES_DEG = (-50.0, -20.0, 20.0, 36.4, 52.0, 60.0)
"""Latitudes that are drawn (deg)."""
HANDHELD = "mems_by_hand"
"""IMU file of runs by hand."""
RESTS = 24
"""Attitudes of a run by hand."""
TESTABLE = 0.05
"""Least share of the signature that the model must leave: less is as good as a coefficient of the model."""
PLAUSIBLE = 3.0
"""An effect is drawn only where this many of its physical one-sigma sizes reach the size to be drawn."""
_RATE_HZ = 20.0
"""Sample rate on the table (Hz) where none is drawn: navigation cycles are 0.1 s at any rate, so this costs no
information."""
_SPAN = (10.0, 30.0)
"""Size of a hidden effect, in the sigma of the clean test."""


@dataclass(frozen=True)
class Truth:
    """A hidden effect."""

    name: str
    """Of the parameter, as the registry has it."""
    family: str
    option: tuple[str, float] | None
    """What enters nonlinearly: ``("tau", 730.0)``."""
    value: float
    """SI."""
    sigmas: float
    """Size in the sigma of a clean test."""
    text: str
    """What the simulator takes."""


@dataclass(frozen=True)
class OneTest:
    """A simulated test, opened, with its truth."""

    test: PreparedTest
    model: Model
    """To be estimated."""
    sensor: ImuTruth
    """Biases in the mean over the dwells."""
    truths: tuple[Truth, ...] = ()
    """What is hidden in it."""
    told: Mapping[str, Any] = field(default_factory=dict)
    """What was drawn, for the row."""

    @property
    def truth(self) -> Truth | None:
        """The one hidden effect; None of a clean test."""
        return self.truths[0] if self.truths else None


def diagnosed(world: OneTest) -> Diagnosis:
    """Run a world: solve, then look for what is missing."""
    return climb(solve(world.test, world.model))


def rng_of(seed: int, *words: str) -> np.random.Generator:
    """Make the generator of a seed and of words, so that two studies draw apart."""
    return np.random.default_rng(np.random.SeedSequence([seed, crc32(" ".join(words).encode())]))


def drawn_site(rng: np.random.Generator) -> Site:
    """Draw the latitude of a site on the ellipsoid."""
    return Site(math.radians(float(rng.choice(LATITUDES_DEG))), 0.0)


def drawn_place(rng: np.random.Generator, plans: Sequence[str] = FILED) -> tuple[str, Site]:
    """Draw plan, then site."""
    return str(rng.choice(plans)), drawn_site(rng)


def place_told(plan: str, site: Site) -> dict[str, Any]:
    """Plan and latitude for a row."""
    return {"plan": plan, "latitude_deg": math.degrees(site.latitude_rad)}


def model_of(imu: str) -> Model:
    """Baseline of an IMU file."""
    return load_model("hand" if imu == HANDHELD else "baseline")


def simulate(scenario: Scenario, sensor: ImuTruth) -> Recording:
    """Make the recording of a scenario, as `sdimu_sim.core.scenario.generate` does, but without table angles.

    The table's motion does not depend on the seed (its encoders do, which no estimator reads), so that each process
    makes it once.
    """
    motion = motion_of(scenario.plan, scenario.table)
    platform = PlatformMotion(motion.t, motion.q_nt, motion.omega_nt_t)
    samples = simulate_imu(platform, sensor, scenario.site, scenario.rate_hz, scenario.seed, scenario.temperature)
    log = temperature_log(scenario, float(motion.t[-1]))
    phase = PhaseLog(*phase_changes(motion))
    return Recording(scenario.start_ns, samples.t, samples.omega_ib_b, samples.f_ib_b, phase, log)


@lru_cache(maxsize=2)
def motion_of(plan: Plan, table: TableSpecification) -> TableMotion:
    """Motion of the table, made once for each plan."""
    return table_motion(plan, table, 0)


def in_the_mean(sensor: ImuTruth, recording: Recording, seed: int) -> ImuTruth:
    """Return a sensor with its biases in the mean over the dwells: what a calibration states of a bias that drifts."""
    if recording.phase is None:
        return sensor
    mean = mean_bias(sensor, recording.t, recording.phase, recording.interval_s, seed)
    return replace(sensor, coefficients={**sensor.coefficients, **mean})


def true_values(sensor: ImuTruth, names: tuple[str, ...], frame: str) -> Floats:
    """Truth of the estimated coefficients by name, shape (p,), SI; what the simulator does not have is zero."""
    truth = true_coefficients(sensor, frame)
    return np.array([truth.get(name, 0.0) for name in names])


def simulated_test(
    name: str,
    imu: ImuSpecification,
    plan: str,
    site: Site,
    seed: int,
    effects: tuple[str, ...],
    noise: tuple[str, ...] = (),
    rate_hz: float = _RATE_HZ,
) -> tuple[PreparedTest, ImuTruth]:
    """Simulate a test and open it as every recording is opened; a run by hand states no site and has its own rate."""
    if name == HANDHELD:
        run = ByHand(RESTS, imu, site, seed=seed, effects=effects)
        recording, truth = by_hand_recording(run)
        return opened(recording, imu, site, "any"), felt(truth, site)
    recording, sensor = simulated_recording(imu, plan, site, seed, effects, noise, rate_hz)
    return opened(recording, imu, site), in_the_mean(sensor, recording, seed)


def simulated_recording(
    imu: ImuSpecification,
    plan: str,
    site: Site,
    seed: int,
    effects: tuple[str, ...],
    noise: tuple[str, ...] = (),
    rate_hz: float = _RATE_HZ,
) -> tuple[Recording, ImuTruth]:
    """Simulate the recording of a test on a table."""
    scenario = Scenario(
        study_plan(plan, seed), imu, site, study_table(plan), rate_hz=rate_hz, seed=seed, effects=effects, noise=noise
    )
    sensor = imu_truth(scenario)
    return simulate(scenario, sensor), sensor


def opened(recording: Recording, imu: ImuSpecification, site: Site, assumed: str = "") -> PreparedTest:
    """Open a recording as every recording is opened; `assumed` as of `OpeningOptions`."""
    return PreparedTest(*open_test(recording, OpeningOptions(imu, site, assumed)))


def felt(truth: TestTruth, site: Site) -> ImuTruth:
    """Sensor of a run without a site: its scale factors count against standard gravity."""
    true_gravity = float(earth.normal_gravity(site.latitude_rad, site.height_m))
    return against_gravity(truth, STANDARD_GRAVITY, true_gravity).imu


def choice(name: str, plan: str, seed: int) -> str:
    """Name the estimator that a clean test of an IMU file on a plan gets."""
    test, _ = simulated_test(name, load_imu(name), plan, Site(math.radians(36.4), 0.0), seed, ())
    return choose_estimator(test, model_of(name)).estimator


def hideable_names() -> frozenset[str]:
    """Parameters that both the simulator and the registry have."""
    return frozenset(drawn_names())


def with_effects(
    simulated: Callable[[tuple[str, ...]], tuple[PreparedTest, ImuTruth]],
    model: Model,
    draws: Sequence[Callable[[Fit], Truth | None]],
    told: Mapping[str, Any],
    clean: Callable[[], tuple[PreparedTest, ImuTruth]] | None = None,
) -> OneTest:
    """Draw effects by what the clean test of a world can see, and simulate the world once more with them.

    Parameters
    ----------
    simulated : callable
        Of the effects as the simulator takes them.
    model : Model
    draws : sequence of callable
        One an effect, called with the fit of the clean test; a parameter that is drawn twice counts once, and None is
        no effect.
    told : mapping
        For the row.
    clean : callable, optional
        Gives the clean test where it differs by more than its effects.
    """
    truths: dict[str, Truth] = {}
    if draws:
        fit = solve((clean() if clean else simulated(()))[0], model)
        for draw in draws:
            drawn = draw(fit)
            if drawn is not None:
                truths.setdefault(drawn.name, drawn)
    test, sensor = simulated(tuple(t.text for t in truths.values()))
    return OneTest(test, model, sensor, tuple(truths.values()), told)


def drawn_effect(
    rng: np.random.Generator,
    fit: Fit,
    span: tuple[float, float] = _SPAN,
    families: Collection[str] = (),
    options: bool = False,
    noise: Sequence[NoiseTerm] = (),
) -> Truth:
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
    option = option_of(candidate.label)
    return Truth(name, family, option, value, size, sized(candidate.label, value, size_unit(name)))


def option_of(label: str) -> tuple[str, float] | None:
    """First option of a label, such as ``("tau", 300.0)``."""
    return next(((key, float(text.split()[0])) for key, text in parse_key(label).options.items()), None)
