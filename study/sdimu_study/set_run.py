"""One run of the study of sets: simulate recordings of one unit, fit and diagnose them together, score by name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import Excitation
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis, diagnose_set
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.plan_search import Question, next_turn
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.grade_run import PLANS, drawn_effect
from sdimu_study.hidden_draw import Truth
from sdimu_study.hidden_score import baseline_z, same_effect
from sdimu_study.set_world import World, here, members_of

KINDS = ("weak", "clean", "class", "turn-on")
"""Questions of the study."""
_WEAK = (20, 2.5)
"""Number of recordings with a weak effect, and its size in the sigma of one of them."""
_POWER_ONS = 8
"""Number of power-ons from which their scatter is estimated."""
_CLEAN = (3, 11)
"""Least number of recordings of a clean set, and one more than the largest."""
_OPEN = 15.0
"""Size of the effect of an open class, in the sigma of the first recording."""
_TURN_ON = (0.3, 10.0)
"""Size of the scatter from power-on to power-on, in the sigma of a bias in one recording."""
_ONE_RATE = frozenset({Excitation.BOTH_SENSES, Excitation.TWO_RATES})
"""What tells effects apart that look the same at one rate."""
_DWELL_S = 60.0
"""Length of the stops of an advised recording (s): that of the plan `recommended`."""


@dataclass(frozen=True)
class SetRun:
    """Simulate a set and fit or diagnose it.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    imu : str
        Name in config/imu.
    """

    kind: str
    imu: str

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed: what was found of what was hidden, errors over sigma of the coefficients.

        Raises
        ------
        DataError
            When the set cannot be fitted.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(f"{self.kind} {self.imu}".encode())]))
        work = {"weak": _weak, "clean": _clean, "class": _class, "turn-on": _turn_on}[self.kind]
        return work(World(self.imu, load_imu(self.imu), seed, rng))


def _options() -> SetOptions:
    return SetOptions(load_model("baseline"))


def _sizes(world: World, test: PreparedTest) -> dict[str, float]:
    """Draw the scatter of both biases from power-on to power-on (SI), about what one recording can see."""
    fit = solve(test, load_model("baseline"))
    sigma = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)).tolist(), strict=True))
    groups = [e for e in fit.sensors.effects if e.scope == "power-on"]
    low, high = np.log(_TURN_ON)
    factors = np.exp(world.rng.uniform(low, high, len(groups)))
    return {
        e.name: float(f * np.median([sigma[p.name] for p in e.parameters]))
        for e, f in zip(groups, factors, strict=True)
    }


def _unit_families() -> list[str]:
    return [n for n in registry.names() if registry.get(n).scope == "unit" and registry.get(n).group != "The baseline"]


def _weak(world: World) -> dict[str, Any]:
    """Hide an effect of 2.5 sigma in each of 20 recordings; diagnose one of them, then all together."""
    plan, site, (count, size) = load_plan(str(world.rng.choice(PLANS[1:]))), world.site(), _WEAK
    clean = world.recording(0, plan, site, {})
    truth = drawn_effect(world.rng, solve(clean, load_model("baseline")), (size, size + 1e-6), _unit_families())
    turn_on = _sizes(world, clean)
    tests = [world.recording(k, plan, site, turn_on, (truth.text,)) for k in range(1, count + 1)]
    alone = climb(solve(tests[0], load_model("baseline")))
    found = diagnose_set(members_of(tests), _options(), here)
    named = [[f.candidate.label, *f.alike] for f in found_effects(alone)]
    in_one = any(same_effect(n, truth, ()) for one in named for n in one)
    return _scored(found, truth, world.unit((truth.text,))) | {"plan": plan.name, "in_one": in_one}


def _clean(world: World) -> dict[str, Any]:
    """Diagnose a set of three to ten clean recordings, plans mixed."""
    site, count = world.site(), int(world.rng.integers(*_CLEAN))
    plans = [load_plan(str(world.rng.choice(PLANS))) for _ in range(count)]
    turn_on = _sizes(world, world.recording(0, plans[0], site, {}))
    tests = [world.recording(k + 1, plan, site, turn_on) for k, plan in enumerate(plans)]
    found = diagnose_set(members_of(tests), _options(), here)
    return _scored(found, None, world.unit()) | {"recordings": count}


def _class(world: World) -> dict[str, Any]:
    """Leave asymmetry and quadratic term of a gyro open by one rate; add the recording that is advised."""
    site, plan, model = world.site(), load_plan("kim18_signed"), load_model("baseline")
    clean = world.recording(0, plan, site, {})
    families = [n for n in _unit_families() if registry.get(n).excitation >= _ONE_RATE]
    truth = drawn_effect(world.rng, solve(clean, model), (_OPEN, _OPEN + 1e-6), (str(world.rng.choice(families)),))
    turn_on = _sizes(world, clean)
    first = world.recording(1, plan, site, turn_on, (truth.text,))
    alone = climb(solve(first, model))
    named = [n for f in found_effects(alone)[:1] for n in (f.candidate.label, *f.alike)]
    advised = next_turn(plan, Question(site, world.imu, model), named)[0].turns if len(named) > 1 else ()
    second = world.recording(2, _advised(plan, advised), site, turn_on, (truth.text,))
    found = diagnose_set(members_of([first, second]), _options(), here)
    return _scored(found, truth, world.unit((truth.text,))) | {"open": named}


def _advised(plan: Plan, turns: Sequence[Turn]) -> Plan:
    """Plan of the advised turns, three times there and back."""
    back = [replace(turn, angle_rad=-turn.angle_rad) for turn in reversed(turns)]
    way = (*turns, *back) * 3
    return Plan("advised", (_DWELL_S,) * (len(way) + 1), way, max(plan.acceleration_rad_s2, math.radians(20.0)))


def _turn_on(world: World) -> dict[str, Any]:
    """Estimate the scatter of the biases from eight power-ons."""
    site, plan = world.site(), load_plan(str(world.rng.choice(PLANS[1:])))
    sizes = _sizes(world, world.recording(0, plan, site, {}))
    tests = [world.recording(k + 1, plan, site, sizes) for k in range(_POWER_ONS)]
    fit = fit_set(members_of(tests), _options(), here)
    result = set_outcome(fit)
    z = baseline_z(result, world.unit())
    return {
        "scatter": [
            {"effect": t.effect, "true": sizes[t.effect], "sigma": t.sigma, "low": t.low, "high": t.high}
            for t in fit.turn_on
        ],
        **_errors(z),
    }  # fmt: skip


def _scored(found: SetDiagnosis, truth: Truth | None, unit: ImuTruth) -> dict[str, Any]:
    """Score a diagnosis; from here on the truth is known, nothing before has seen it."""
    labels = [[f.label, *f.alike] for f in found.findings if not f.recording]
    right = truth is not None and any(same_effect(n, truth, ()) for one in labels for n in one)
    alone = truth is not None and len(labels) == 1 and len(labels[0]) == 1 and same_effect(labels[0][0], truth, ())
    result: Calibration = found.after
    return {
        "verdict": found.verdict, "hidden": truth.text if truth else "", "named": bool(right), "alone": bool(alone),
        "labels": [one[0] for one in labels],
        "local": [f"{f.label} {f.recording}" for f in found.findings if f.recording],
        "held_out": [found.before.fit["held_out_rms"], result.fit["held_out_rms"]],
        **_errors(baseline_z(result, unit)),
    }  # fmt: skip


def _errors(z: np.ndarray[Any, Any]) -> dict[str, Any]:
    return {"z2": float(np.sum(z**2)), "count": len(z), "largest_z": float(np.max(np.abs(z)))}
