"""One run of the study of soaks: fit five soaks and a ramp together, score every polynomial and a compensated ramp."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.compensation.compensator import compensate_recording, compensator
from sdimu_calibration.core.effects import body_frame, registry
from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model, Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario
from sdimu_sim.core.true_coefficients import RATES, SEEN_OF_TURNS, with_lag
from sdimu_study.grade_run import PLANS
from sdimu_study.noise_run import drawn_noise
from sdimu_study.set_world import World, here, members_of, opened
from sdimu_study.soak_world import (
    TURN_ON,
    SoakWorld,
    block_rms,
    drawn_polynomials,
    in_the_frame,
    noise_of,
    polynomials,
)

LAG = "soaks-lag"
SOAK_KINDS = ("soaks", LAG, "soaks-flicker", "soaks-markov")
"""Questions of the study: white noise, a lag of the sensors, noise with a memory."""
_LATITUDES_DEG = (-50.0, 60.0)
"""Range from which the latitude is drawn (deg)."""
_LAGS_S = (20.0, 60.0)
"""Range from which the lag of the sensors is drawn (s): an instrument of some 100 g in its case."""


@dataclass(frozen=True)
class SoakRun:
    """Simulate a set, fit it and compensate a ramp that is not in it.

    Attributes
    ----------
    kind : str
        One of `SOAK_KINDS`.
    imu : str
        Name in config/imu.
    orders : int
        Highest power of the temperature, 1 to 3.
    """

    kind: str
    imu: str
    orders: int = 2

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: errors over sigma of all coefficients by name, and the compensated ramps over their noise.

        Raises
        ------
        DataError
            When the set cannot be fitted.
        """
        world = self.drawn(seed)
        scenarios = world.scenarios()
        tests = [opened(scenario) for scenario in scenarios]
        members = members_of(tests[:-1])
        result = set_outcome(fit_set(members, SetOptions(self.model()), here))
        own = of_power_on(result, members[-1].name)
        # From here on the truth is known; nothing before this line has seen it.
        (ramp,) = ratios([own], scenarios[-2], tests[-2].recording)
        other, mean_bias = ratios([own, result], scenarios[-1], tests[-1].recording)
        return {
            "plan": world.plan.name, "latitude_deg": math.degrees(world.site.latitude_rad), "lag_s": world.lag_s,
            "noise": list(world.noise), "z": errors(result, world), "scatter": scatter(result, world),
            "ramp": ramp, "other_ramp": other, "mean_bias": mean_bias,
            "left_out": [f"{name}: {why}" for name, why in (result.of_set.left_out if result.of_set else ())],
            "warnings": list(result.warnings),
        }  # fmt: skip

    def drawn(self, seed: int) -> SoakWorld:
        """Draw unit, site, plan, scatter of the power-ons, lag and noise."""
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(f"{self.kind} {self.imu}".encode())]))
        imu = load_imu(self.imu)
        plan, latitude = load_plan(str(rng.choice(PLANS))), math.radians(float(rng.uniform(*_LATITUDES_DEG)))
        low, high = np.log(TURN_ON)
        shares = np.exp(rng.uniform(low, high, 2)).tolist()
        biases = [e for e in load_model("baseline").effects if registry.get(e).scope == "power-on"]
        turn_on = {name: share * imu.prior[name] for name, share in zip(biases, shares, strict=True)}
        effects = drawn_polynomials(imu, self.orders, rng)
        drawn = SoakWorld(World(self.imu, imu, seed, rng), Site(latitude, 0.0), plan, effects, turn_on)
        if self.kind == LAG:
            return replace(drawn, lag_s=float(rng.uniform(*_LAGS_S)))
        _, _, noise = self.kind.partition("-")
        return replace(drawn, noise=drawn_noise(imu, noise, rng)) if noise else drawn

    def model(self) -> Model:
        """Return the baseline with its polynomials, as `sdimu calibrate --add` makes it."""
        baseline = load_model("baseline")
        rates = RATES[: self.orders] if self.kind == LAG else ()
        lagging = [f"{base}_{rate}" for rate in rates for base in baseline.effects]
        added = dict.fromkeys((*polynomials(self.orders), *SEEN_OF_TURNS[: self.orders], *lagging))
        return with_effects(baseline, list(added))


def errors(result: Calibration, world: SoakWorld) -> dict[str, float]:
    """Error over sigma of every coefficient that the body frame leaves free, by name."""
    truth = with_lag(world.world.unit(world.effects), result.body_frame, world.lag_s)
    sigma = np.sqrt(np.diag(result.covariance))
    pinned = body_frame.pinned_in(result.names, result.body_frame)
    return {
        name: float((value - truth.get(name, 0.0)) / s)
        for name, value, s in zip(result.names, result.values.tolist(), sigma.tolist(), strict=True)
        if name not in pinned and s > 0.0
    }


def scatter(result: Calibration, world: SoakWorld) -> list[dict[str, Any]]:
    """Scatter of the biases from power-on to power-on: found, its interval, and true (SI)."""
    turn_on = result.of_set.turn_on if result.of_set else ()
    return [
        {"effect": t.effect, "true": world.turn_on.get(t.effect, 0.0), "sigma": t.sigma, "low": t.low, "high": t.high}
        for t in turn_on
    ]


def of_power_on(result: Calibration, recording: str) -> Calibration:
    """Return the result with the biases that a recording was switched on with: the mean and the deviation it states."""
    deviations = result.of_set.deviations if result.of_set else ()
    own = {d.name: d.value for d in deviations if d.power_on.endswith(recording)}
    return replace(result, values=result.values + np.array([own.get(name, 0.0) for name in result.names]))


def ratios(results: Sequence[Calibration], scenario: Scenario, recording: Recording) -> list[dict[str, float]]:
    """RMS of compensated rates and forces less the true ones over that of their noise, in means over ten seconds.

    Parameters
    ----------
    results : sequence of Calibration
        To compensate with.
    scenario, recording : Scenario, Recording
        A ramp, and its samples.

    Returns
    -------
    list of dict
        Of each result, ``gyro`` and ``accel`` (1).
    """
    true = in_the_frame(scenario)
    noise = [block_rms(values, recording.interval_s) for values in noise_of(scenario, recording)]
    out = []
    for result in results:
        done = compensate_recording(compensator(result, scenario.imu, has_temperature=True), recording)
        left = (done.omega_ib_b - true[0], done.f_ib_b - true[1])
        rms = [block_rms(values, recording.interval_s) / own for values, own in zip(left, noise, strict=True)]
        out.append(dict(zip(("gyro", "accel"), rms, strict=True)))
    return out
