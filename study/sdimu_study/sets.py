"""Sets of recordings of one unit: what is found of what was hidden, and do the errors hold their sigmas."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import Excitation
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis, diagnose_set
from sdimu_calibration.core.joint.set_fit import SetFit, SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.plan_search import Question, next_turn
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_study.plans import FILED
from sdimu_study.score import among, classes, errors
from sdimu_study.set_world import Unit, here, members_of
from sdimu_study.study import Group, Key, Rows, Study, largest_z, of, rms_z
from sdimu_study.worlds import Truth, drawn_effect, drawn_site, rng_of

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
_TOUCH = 1e-6
"""Width of the range of a size that is not drawn."""


@dataclass(frozen=True)
class SetWorld:
    """Recordings of one unit: `truth` is hidden in all; `turn_on` is the scatter of the biases (SI), by effect.

    `advised` makes one recording more of the labels that the diagnosis of the first one leaves open.
    """

    kind: str
    unit: Unit
    tests: Sequence[PreparedTest]
    turn_on: Mapping[str, float]
    truth: Truth | None = None
    advised: Callable[[Sequence[str]], PreparedTest] | None = None
    told: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class SetFound:
    """What was found in a set, `together` in all; `alone` are the classes named in the first recording."""

    together: SetDiagnosis | SetFit
    alone: list[list[str]] = field(default_factory=list)


def world(case: Key, seed: int) -> SetWorld:
    """Draw a set of a kind of `KINDS` and an IMU file."""
    kind, name = case
    unit = Unit(load_imu(name), seed, rng_of(seed, *case))
    return {"weak": _weak, "clean": _clean, "class": _class, "turn-on": _turn_on}[kind](unit)


def _options() -> SetOptions:
    return SetOptions(load_model("baseline"))


def _sizes(unit: Unit, test: PreparedTest) -> dict[str, float]:
    """Draw the scatter of both biases from power-on to power-on (SI), about what one recording can see."""
    fit = solve(test, load_model("baseline"))
    sigma = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)).tolist(), strict=True))
    groups = [e for e in fit.sensors.effects if e.scope == "power-on"]
    low, high = np.log(_TURN_ON)
    factors = np.exp(unit.rng.uniform(low, high, len(groups)))
    return {
        e.name: float(f * np.median([sigma[p.name] for p in e.parameters]))
        for e, f in zip(groups, factors, strict=True)
    }


def _unit_families() -> list[str]:
    return [n for n in registry.names() if registry.get(n).scope == "unit" and registry.get(n).group != "The baseline"]


def _weak(unit: Unit) -> SetWorld:
    """Hide an effect of 2.5 sigma in each of 20 recordings."""
    plan, site, (count, size) = load_plan(str(unit.rng.choice(FILED[1:]))), drawn_site(unit.rng), _WEAK
    clean = unit.recording(0, plan, site, {})
    truth = drawn_effect(unit.rng, solve(clean, load_model("baseline")), (size, size + _TOUCH), _unit_families())
    turn_on = _sizes(unit, clean)
    tests = [unit.recording(k, plan, site, turn_on, (truth.text,)) for k in range(1, count + 1)]
    return SetWorld("weak", unit, tests, turn_on, truth, told={"plan": plan.name})


def _clean(unit: Unit) -> SetWorld:
    """Make a set of three to ten clean recordings, plans mixed."""
    site, count = drawn_site(unit.rng), int(unit.rng.integers(*_CLEAN))
    plans = [load_plan(str(unit.rng.choice(FILED))) for _ in range(count)]
    turn_on = _sizes(unit, unit.recording(0, plans[0], site, {}))
    tests = [unit.recording(k + 1, plan, site, turn_on) for k, plan in enumerate(plans)]
    return SetWorld("clean", unit, tests, turn_on, told={"recordings": count})


def _class(unit: Unit) -> SetWorld:
    """Leave effects open by one rate in the first recording."""
    site, plan = drawn_site(unit.rng), load_plan("kim18_signed")
    clean = unit.recording(0, plan, site, {})
    fit = solve(clean, load_model("baseline"))
    families = [n for n in _unit_families() if registry.get(n).excitation >= _ONE_RATE]
    truth = drawn_effect(unit.rng, fit, (_OPEN, _OPEN + _TOUCH), (str(unit.rng.choice(families)),))
    turn_on = _sizes(unit, clean)

    def advised(named: Sequence[str]) -> PreparedTest:
        turns = _asked(plan, site, unit, named)
        return unit.recording(2, _there_and_back(plan, turns), site, turn_on, (truth.text,))

    first = unit.recording(1, plan, site, turn_on, (truth.text,))
    return SetWorld("class", unit, [first], turn_on, truth, advised)


def _asked(plan: Plan, site: Site, unit: Unit, named: Sequence[str]) -> Sequence[Turn]:
    """Ask for turns that would tell apart what is named."""
    question = Question(site, unit.imu, load_model("baseline"))
    return next_turn(plan, question, list(named))[0].turns if len(named) > 1 else ()


def _there_and_back(plan: Plan, turns: Sequence[Turn]) -> Plan:
    """Plan of the advised turns, three times there and back."""
    back = [replace(turn, angle_rad=-turn.angle_rad) for turn in reversed(turns)]
    way = (*turns, *back) * 3
    return Plan("advised", (_DWELL_S,) * (len(way) + 1), way, max(plan.acceleration_rad_s2, math.radians(20.0)))


def _turn_on(unit: Unit) -> SetWorld:
    """Switch the unit on eight times."""
    site, plan = drawn_site(unit.rng), load_plan(str(unit.rng.choice(FILED[1:])))
    turn_on = _sizes(unit, unit.recording(0, plan, site, {}))
    return SetWorld("turn-on", unit, [unit.recording(k + 1, plan, site, turn_on) for k in range(_POWER_ONS)], turn_on)


def run(world: SetWorld) -> SetFound:
    """Fit the set for the scatter of its power-ons, or diagnose it, with the recording that is advised."""
    tests, alone = list(world.tests), list[list[str]]()
    if world.kind == "turn-on":
        return SetFound(fit_set(members_of(tests), _options(), here))
    if world.kind in {"weak", "class"}:
        alone = classes(climb(solve(tests[0], load_model("baseline"))))
    if world.advised is not None:
        tests.append(world.advised(alone[0] if alone else ()))
    return SetFound(diagnose_set(members_of(tests), _options(), here), alone)


def score(world: SetWorld, found: SetFound) -> dict[str, Any]:
    """Say what was found of what was hidden, and the errors over sigma of the coefficients."""
    together, truth = found.together, world.truth
    if isinstance(together, SetFit):
        scatter = [
            {"effect": t.effect, "true": world.turn_on[t.effect], "sigma": t.sigma, "low": t.low, "high": t.high}
            for t in together.turn_on
        ]
        return {"scatter": scatter, **errors(set_outcome(together), world.unit.sensor())}
    labels = [[f.label, *f.alike] for f in together.findings if not f.recording]
    of_kind: dict[str, dict[str, Any]] = {
        "weak": {"in_one": any(among(truth, one, ()) for one in found.alone)},
        "class": {"open": found.alone[0] if found.alone else []},
    }
    return {
        "verdict": together.verdict,
        "hidden": truth.text if truth else "",
        "named": any(among(truth, one, ()) for one in labels),
        "alone": len(labels) == 1 and len(labels[0]) == 1 and among(truth, labels[0], ()),
        "labels": [one[0] for one in labels],
        "local": [f"{f.label} {f.recording}" for f in together.findings if f.recording],
        "held_out": [together.before.fit["held_out_rms"], together.after.fit["held_out_rms"]],
        **errors(together.after, world.unit.sensor((truth.text,) if truth else ())),
        **world.told,
        **of_kind.get(world.kind, {}),
    }


def _right(g: Group) -> tuple[int, int, str]:
    """How many are right, of how many, and what that means."""
    kind, rows = g.key[0], g.good
    if kind == "weak":
        single = sum(row["in_one"] for row in rows)
        return sum(row["named"] for row in rows), len(rows), f"named in the set (in one recording: {single})"
    if kind == "clean":
        return sum(row["verdict"] == Verdict.CONSISTENT for row in rows), len(rows), "consistent"
    if kind == "class":
        asked = [row for row in rows if len(row["open"]) > 1]
        told = f"the right one alone ({len(rows)} drawn, these open in one)"
        return sum(row["alone"] for row in asked), len(asked), told
    return (*covered(rows), "true scatter inside its interval")


def covered(rows: Rows) -> tuple[int, int]:
    """How many intervals of a scatter hold the true one, of how many."""
    pairs = [s for row in rows for s in row["scatter"]]
    return sum(s["low"] <= s["true"] <= s["high"] for s in pairs), len(pairs)


def _false(g: Group) -> str:
    return "" if g.key[0] == "turn-on" else str(g.count(lambda row: row["labels"] and not row["named"]))


STUDY = Study(
    "sets",
    world,
    run,
    score,
    (
        ("sets of", lambda g: g.key[0]),
        ("runs", lambda g: of(len(g.good), g.rows)),
        ("right", lambda g: of(*_right(g)[:2])),
        ("what is right", lambda g: _right(g)[2]),
        ("false", _false),
        ("RMS z", lambda g: f"{rms_z(g.good):.2f}"),
        ("largest z", lambda g: largest_z(g.good) or "0.0"),
    ),
)
