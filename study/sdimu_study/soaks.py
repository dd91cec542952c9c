"""Sets of soaks and a ramp: is every polynomial of the temperature right, and does it compensate a ramp."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation.compensator import compensate_recording, compensator
from sdimu_calibration.core.effects import body_frame, registry
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model, Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.hidden import parse_effects
from sdimu_sim.core.scenario import Scenario
from sdimu_sim.core.true_coefficients import POWERS, SEEN_OF_TURNS, true_coefficients
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.noise import drawn_noise
from sdimu_study.plans import FILED
from sdimu_study.set_world import Unit, here, members_of, opened
from sdimu_study.sets import covered
from sdimu_study.soak_world import TURN_ON, SoakWorld, block_rms, drawn_polynomials, in_the_frame, noise_of, polynomials
from sdimu_study.study import Key, Rows, Study, Table, good, of
from sdimu_study.worlds import place_told, rng_of

LAG = "soaks-lag"
SOAK_KINDS = ("soaks", LAG, "soaks-flicker", "soaks-markov")
"""Questions of the study: white noise, a lag of the sensors, noise with a memory."""
RATES = ("temperature_rate", "temperature_rate_linear")
"""Rates of the first powers of the temperature, as they stand in the names of effects."""
ORDERS = 2
"""Highest power of the temperature."""
_LATITUDES_DEG = (-50.0, 60.0)
"""Range from which the latitude is drawn (deg)."""
_LAGS_S = (20.0, 60.0)
"""Range from which the lag of the sensors is drawn (s): an instrument of some 100 g in its case."""
_WIDE = 3.0
"""Errors that count as inside (sigma)."""
_WORDS = ("at T0", "first power", "second power", "third power", "rate terms")


@dataclass(frozen=True)
class Soaks:
    """Simulated recordings of a set, a ramp last, and one ramp more that is not in it."""

    drawn: SoakWorld
    model: Model
    scenarios: list[Scenario]
    tests: list[PreparedTest]


def world(case: Key, seed: int) -> Soaks:
    """Simulate a set of a kind of `SOAK_KINDS` and an IMU file."""
    kind, _ = case
    one = drawn(case, seed)
    scenarios = one.scenarios()
    return Soaks(one, model_of(kind), scenarios, [opened(scenario) for scenario in scenarios])


def drawn(case: Key, seed: int) -> SoakWorld:
    """Draw unit, site, plan, scatter of the power-ons, lag and noise."""
    kind, name = case
    rng, imu = rng_of(seed, *case), load_imu(name)
    plan, latitude = load_plan(str(rng.choice(FILED))), math.radians(float(rng.uniform(*_LATITUDES_DEG)))
    low, high = np.log(TURN_ON)
    shares = np.exp(rng.uniform(low, high, 2)).tolist()
    biases = [e for e in load_model("baseline").effects if registry.get(e).scope == "power-on"]
    turn_on = {name: share * imu.prior[name] for name, share in zip(biases, shares, strict=True)}
    effects = drawn_polynomials(imu, ORDERS, rng)
    one = SoakWorld(Unit(imu, seed, rng), Site(latitude, 0.0), plan, effects, turn_on)
    if kind == LAG:
        return replace(one, lag_s=float(rng.uniform(*_LAGS_S)))
    _, _, noise = kind.partition("-")
    return replace(one, noise=drawn_noise(imu, noise, rng)) if noise else one


def model_of(kind: str) -> Model:
    """Return the baseline with its polynomials, as `sdimu calibrate --add` makes it."""
    baseline = load_model("baseline")
    rates = RATES[:ORDERS] if kind == LAG else ()
    lagging = [f"{base}_{rate}" for rate in rates for base in baseline.effects]
    return with_effects(baseline, list(dict.fromkeys((*polynomials(ORDERS), *SEEN_OF_TURNS[:ORDERS], *lagging))))


def run(world: Soaks) -> Calibration:
    """Fit all but the last ramp."""
    return set_outcome(fit_set(members_of(world.tests[:-1]), SetOptions(world.model), here))


def score(world: Soaks, result: Calibration) -> dict[str, Any]:
    """Errors over sigma of all coefficients by name, and the compensated ramps over their noise."""
    (scenario, last), (ramp, other_ramp) = world.scenarios[-2:], (test.recording for test in world.tests[-2:])
    one, of_set = world.drawn, result.of_set
    own = of_power_on(result, members_of(world.tests[:-1])[-1].name)
    other, mean_bias = ratios([own, result], last, other_ramp)
    return {
        **place_told(one.plan.name, one.site),
        "lag_s": one.lag_s,
        "noise": list(one.noise),
        "z": errors(result, one),
        "scatter": [
            {"effect": t.effect, "true": one.turn_on.get(t.effect, 0.0), "sigma": t.sigma, "low": t.low, "high": t.high}
            for t in (of_set.turn_on if of_set else ())
        ],
        "ramp": ratios([own], scenario, ramp)[0],
        "other_ramp": other,
        "mean_bias": mean_bias,
        "left_out": [f"{name}: {why}" for name, why in (of_set.left_out if of_set else ())],
        "warnings": list(result.warnings),
    }


STUDY = Study("soaks", world, run, score)


def errors(result: Calibration, world: SoakWorld) -> dict[str, float]:
    """Error over sigma of every coefficient that the body frame leaves free, by name."""
    truth = with_lag(world.unit.sensor(world.effects), result.body_frame, world.lag_s)
    sigma = np.sqrt(np.diag(result.covariance))
    pinned = body_frame.pinned_in(result.names, result.body_frame)
    return {
        name: float((value - truth.get(name, 0.0)) / s)
        for name, value, s in zip(result.names, result.values.tolist(), sigma.tolist(), strict=True)
        if name not in pinned and s > 0.0
    }


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


def tables(kind: str, rows: Rows) -> list[Table]:
    """Sum the sets of one kind up: the whole, then each kind of coefficient and power over all sets."""
    done = good(rows)
    bases, places = map(str, load_model("baseline").effects), range(len(_WORDS))
    lines = [[base, *(_rms(_of(done, place, base)) for place in places)] for base in bases]
    every = ["all", *(_rms(_of(done, place)) for place in places)]
    return [Table((kind, ""), _whole(rows)), Table(("RMS z", *_WORDS), [every, *lines])]


def _whole(rows: Rows) -> list[tuple[str, str]]:
    """Sum all coefficients and ramps up, a line each."""
    done = good(rows)
    z = np.array([value for row in done for value in row["z"].values()])
    return [
        ("sets", of(len(done), rows)),
        ("coefficients", str(len(z))),
        ("RMS z", _rms(z)),
        ("inside 3 sigma", f"{100.0 * np.mean(np.abs(z) < _WIDE):.1f} %" if len(z) else ""),
        ("largest z", f"{np.max(np.abs(z), initial=0.0):.1f}"),
        ("true scatter inside its interval", of(*covered(done))),
        ("compensated ramp over its noise, the one of the set", _ratio(done, "ramp")),
        ("another ramp of the same power-on", _ratio(done, "other_ramp")),
        ("the same with the mean biases of the set", _ratio(done, "mean_bias")),
    ]


def place_of(name: str) -> tuple[str, int]:
    """Effect of the baseline that a coefficient is of, and which of `_WORDS` it is."""
    stem = name.rpartition("_")[0]
    bases = [base for base in map(str, load_model("baseline").effects) if f"{stem}_".startswith(f"{base}_")]
    if not bases:
        return stem, len(_WORDS) - 1
    rest = stem.removeprefix(bases[0]).removeprefix("_")
    known = ("", *POWERS)
    return bases[0], known.index(rest) if rest in known else len(_WORDS) - 1


def _of(rows: Rows, place: int, base: str | None = None) -> Floats:
    places = {name: place_of(name) for name in {n for row in rows for n in row["z"]}}
    return np.array(
        [
            value
            for row in rows
            for name, value in row["z"].items()
            if places[name][1] == place and base in (None, places[name][0])
        ]
    )


def _rms(z: Floats) -> str:
    return f"{np.sqrt(np.mean(z**2)):.2f}" if len(z) else ""


def _ratio(rows: Rows, key: str) -> str:
    """Median and largest ratio of a compensated ramp to its noise, gyros and accelerometers."""
    if not rows:
        return ""
    both = [(word, np.array([row[key][word] for row in rows])) for word in ("gyro", "accel")]
    return "; ".join(f"{word} {np.median(v):.2f} ({v.max():.2f})" for word, v in both)


def with_lag(truth: ImuTruth, frame: str, lag_s: float) -> dict[str, float]:
    """State sensors that lag behind their thermometer by what a calibration without a lag finds.

    To first order of the lag L, ``k1 (T - L dT/dt - T0) + k2 (T - L dT/dt - T0)^2`` is the polynomial and rate terms
    ``-k1 L dT/dt`` and ``-2 k2 L (T - T0) dT/dt``. The frame is that of accelerometers without the lag, so rate terms
    of axes are those as built.

    Parameters
    ----------
    frame : str
        ``prior`` or ``accelerometer_triad``.
    lag_s : float
        s.

    Returns
    -------
    dict of str to float
        As `true_coefficients` (SI).
    """
    out = true_coefficients(truth, frame)
    for name, size in parse_effects(truth.effects).sizes.items():
        stem, _, part = name.rpartition("_")
        for times, (power, rate) in enumerate(zip(POWERS, RATES, strict=False), start=1):
            if stem.endswith(f"_{power}"):
                late = f"{stem.removesuffix(power)}{rate}_{part}"
                out[late] = out.get(late, 0.0) - times * lag_s * size
    return out
