"""Adaptive tests: minutes to the limits, do the sigmas hold, is a hidden effect told apart; fixed plans beside them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.adaptive import Goals, Menu
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint.scope import is_shared
from sdimu_calibration.core.noise_term import FLICKER, RANDOM_WALK
from sdimu_calibration.core.planning.predict import predict
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_calibration.storage.files.goal_file import load_goals
from sdimu_calibration.storage.files.table_file import load_rate_table
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.adaptive_test import AdaptiveTest, adaptive_test
from sdimu_study.hidden_draw import RATE_HZ, WARM_UP, Sizes, drawn_of
from sdimu_study.noise import RATES_HZ, WHITE, drawn_noise, noise_terms
from sdimu_study.score import among, baseline_z
from sdimu_study.study import Group, Key, Results, Rows, Study, Table, good, of
from sdimu_study.worlds import (
    Truth,
    drawn_effect,
    drawn_site,
    hideable_names,
    in_the_mean,
    rng_of,
    simulate,
    true_values,
)

KINDS = ("table33", "clean", "hidden", "wide", "wide hidden")
"""Clean tests to the accuracy of Table 3.3; clean tests, and tests with a hidden effect, to that of kim18. Wide:
each of `IMUS`, at any latitude and sample rate, in any noise of `WIDE_NOISE`."""
IMUS = ("dtg", "fog_tactical", "mems_industrial", "rlg_navigation")
"""IMU files of the wide tests: gyros that see the rotation of the Earth, without which no turn of a table is chosen."""
FIXED = ("kim18", "recommended")
"""Plans that are run with the same hidden effect."""
SPAN = (10.0, 30.0)
"""Sizes of hidden effects: sigmas of a test with kim18."""
WIDE_NOISE = (WHITE, FLICKER, RANDOM_WALK)
"""Noise of the wide tests, each as often: white alone, or with a memory as well, of the size that the IMU file states.
A prediction knows these, and the limits are made by one."""
_SLACK = 1.2
"""Limits over the sigmas of kim18, as in config/goal/kim18.yaml."""
LOOK_S = {"table33": 60.0}
"""Length of test after which the data are looked at anew (s), where it is not `_LOOK_S`."""
_LOOK_S = 600.0
"""Length of test (s): a look costs seconds of computing."""
GOALS = ("table33", "kim18")


@dataclass(frozen=True)
class AdaptiveCase:
    """Tests of a kind of `KINDS` up to limits; `sizes` says how small an effect kim18 sees at the site."""

    kind: str
    imu: ImuSpecification
    site: Site
    model: Model
    goals: Goals
    sizes: Sizes


@dataclass(frozen=True)
class Bench:
    """A sensor on a table, ready for a test that chooses its turns."""

    model: Model
    goals: Goals
    look_s: float
    """Length of test after which the data are looked at anew."""
    scenario: Scenario
    sensor: ImuTruth
    truth: Truth | None = None
    told: Mapping[str, Any] = field(default_factory=dict)
    """What was drawn, for the row."""


@dataclass(frozen=True)
class Done:
    """An adaptive test, and the diagnoses of the fixed plans, by name."""

    test: AdaptiveTest
    fixed: Mapping[str, Diagnosis]


def world(case: AdaptiveCase | WideCase, seed: int) -> Bench:
    """Draw a sensor and what is hidden in it."""
    if isinstance(case, WideCase):
        return wide_world(case, seed)
    truth = hidden(case.sizes, seed) if case.kind == "hidden" else None
    scenario = scenario_of(case.imu, case.site, seed, () if truth is None else (truth.text,))
    return Bench(case.model, case.goals, LOOK_S.get(case.kind, _LOOK_S), scenario, imu_truth(scenario), truth)


def scenario_of(imu: ImuSpecification, site: Site, seed: int, effects: tuple[str, ...]) -> Scenario:
    """Scenario of a test that warms up."""
    return Scenario(load_plan("kim18"), imu, site, rate_hz=RATE_HZ, seed=seed, effects=effects, temperature=WARM_UP)


@dataclass(frozen=True)
class WideCase:
    """Tests of an IMU file at any latitude and sample rate, in any noise, to the accuracy that kim18 has there."""

    imu: str
    hides: bool
    """Whether an effect is hidden."""


def wide_world(case: WideCase, seed: int) -> Bench:
    """Draw site, sample rate, noise and what is hidden."""
    rng, imu, model = rng_of(seed, "adaptive", case.imu), load_imu(case.imu), load_model("baseline")
    site, kind, rate_hz = drawn_site(rng), str(rng.choice(WIDE_NOISE)), float(rng.choice(RATES_HZ))
    noise = () if kind == WHITE else drawn_noise(imu, kind, rng)
    scenario = replace(scenario_of(imu, site, seed, ()), rate_hz=rate_hz, noise=noise)
    truth = _seen_by_kim18(rng, scenario, model) if case.hides else None
    scenario = replace(scenario, effects=() if truth is None else (truth.text,))
    told = {"latitude_deg": math.degrees(site.latitude_rad), "rate_hz": rate_hz, "noise": list(noise)}
    return Bench(model, limits_of_kim18(scenario, model), _LOOK_S, scenario, imu_truth(scenario), truth, told)


def _seen_by_kim18(rng: np.random.Generator, scenario: Scenario, model: Model) -> Truth:
    recording = simulate(scenario, imu_truth(scenario))
    fit, terms = solve(PreparedTest(recording, scenario.imu, scenario.site), model), noise_terms(scenario.noise)
    while not is_shared(resolve((truth := drawn_effect(rng, fit, SPAN, noise=terms)).name)):
        pass
    return truth


def limits_of_kim18(scenario: Scenario, model: Model) -> Goals:
    """Make the limits of config/goal/kim18.yaml anew for the IMU, the site and the noise of a scenario."""
    sizes = {(term.triad, term.kind): term.size for term in noise_terms(scenario.noise)}
    imu = replace(
        scenario.imu,
        gyro_bias_instability=sizes.get(("gyro", FLICKER), 0.0),
        accel_bias_instability=sizes.get(("accel", FLICKER), 0.0),
        gyro_random_walk=sizes.get(("gyro", RANDOM_WALK), 0.0),
        accel_random_walk=sizes.get(("accel", RANDOM_WALK), 0.0),
    )
    told = predict(load_plan("kim18"), scenario.site, imu, model)
    limits = {
        effect: _SLACK * max(s for n, s in zip(told.names, told.in_noise, strict=True) if n.startswith(f"{effect}_"))
        for effect in load_goals("kim18").limits
        if effect in told.model
    }
    return Goals("kim18 of this IMU", limits, load_goals("kim18").minutes)


def run(world: Bench) -> Done:
    """Let the test choose its turns; diagnose fixed plans of a test with a hidden effect."""
    scenario, sensor = world.scenario, world.sensor
    table = load_rate_table("ideal")
    done = adaptive_test(scenario, sensor, table, world.model, world.goals, Menu(), world.look_s)
    fixed = {}
    for name in FIXED if world.truth else ():
        recording = simulate(replace(scenario, plan=load_plan(name)), sensor)
        fixed[name] = climb(solve(PreparedTest(recording, scenario.imu, scenario.site), world.model))
    return Done(done, fixed)


def score(world: Bench, outcome: Done) -> dict[str, Any]:
    """Score a test.

    Returns
    -------
    dict
        ``minutes``, ``stops``, ``worst`` (sigma over limit at the end), ``looks`` (minutes, worst, named), ``z`` of
        the baseline coefficients, ``errors`` (over their limits), and that of `_scored`; with a hidden effect
        ``truth`` and, by fixed plan, ``fixed``.
    """
    done, goals, truth = outcome.test, world.goals, world.truth
    found = done.last.found
    true = in_the_mean(world.sensor, found.fit.test.recording, world.scenario.seed)
    row: dict[str, Any] = {
        "minutes": done.plan.duration_s / 60.0,
        "stops": len(done.plan.dwell_s),
        "worst": float(done.last.known.ratio.max()),
        "looks": [[x.minutes, float(x.known.ratio.max()), list(x.known.named)] for x in done.looks],
        "z": baseline_z(found.after, true).tolist(),
        "errors": limit_errors(found.after, true, goals),
        "truth": None if truth is None else truth.text,
        **world.told,
        **_scored(found, truth),
    }
    fixed = {name: _scored(diagnosis, truth) for name, diagnosis in outcome.fixed.items()}
    return row | ({"fixed": fixed} if fixed else {})


def limit_errors(result: Calibration, true: ImuTruth, goals: Goals) -> list[float]:
    """Errors of the coefficients that have a limit, over that limit."""
    limited, limit = goals.of(result.names, result.body_frame)
    truth = true_values(true, result.names, result.body_frame)
    return list(map(float, (result.values - truth)[limited] / limit))


def hidden(sizes: Sizes, seed: int) -> Truth:
    """Draw an effect that any test of a sensor can show: no fault of one recording, nothing at one time of it."""
    rng = rng_of(seed, "adaptive")
    size = float(np.exp(rng.uniform(*np.log(SPAN))))
    return drawn_of(rng, sizes, size, frozenset(name for name in hideable_names() if is_shared(resolve(name))))


def _scored(found: Diagnosis, truth: Truth | None) -> dict[str, Any]:
    """Score a diagnosis.

    ``one``: ends with one effect, no other one beside it or alike (other time constants of the same one are no other
    effect); ``right``: the first one named is the hidden one.
    """
    named, stops = [c.label for c in found.chosen], found.evidence.times.stops
    labels = (*named, *found.alike)
    return {
        "verdict": found.verdict,
        "named": named,
        "alike": list(found.alike),
        "one": len({label.partition("(")[0] for label in labels}) == 1,
        "right": among(truth, named[:1], stops),
        "in_class": among(truth, labels, stops),
    }


def fixed_minutes(plan: str, goal: str, site: Site, imu: ImuSpecification, model: Model) -> float | None:
    """Minutes from which a plan, by its covariance, meets all limits of a goal; None where it does not."""
    goals, told = load_goals(goal), predict(load_plan(plan), site, imu, model)
    limited, limit = goals.of(told.names, told.body_frame)
    late = np.flatnonzero((told.history[:, limited] > limit).any(axis=1))
    if len(late) and late[-1] == len(told.t) - 1:
        return None
    return float(told.t[late[-1] + 1] / 60.0) if len(late) else 0.0


def _minutes(g: Group) -> str:
    minutes = np.array([row["minutes"] for row in g.good])
    return f"{np.median(minutes):.1f} ({minutes.min():.1f}-{minutes.max():.1f})"


def _rms(word: str) -> Any:
    return lambda g: f"{np.sqrt(np.mean(np.concatenate([row[word] for row in g.good]) ** 2)):.2f}"


STUDY = Study(
    "adaptive",
    world,
    run,
    score,
    (
        ("test", lambda g: f"adaptive, {'hidden effect' if 'hidden' in g.key[0] else 'clean'}"),
        ("goals", lambda g: "table33" if g.key == ("table33",) else " of ".join(("kim18", *g.key[1:]))),
        ("runs", lambda g: str(len(g.good))),
        ("minutes, median (range)", _minutes),
        ("limits hold", lambda g: str(g.count(lambda row: row["worst"] <= 1.0))),
        ("RMS z", _rms("z")),
        ("RMS error / limit", _rms("errors")),
        ("an effect named", lambda g: str(g.count(lambda row: row["named"]))),
        ("refused", lambda g: str(len(g.rows) - len(g.good))),
    ),
)


def page(results: Results, fixed: Mapping[str, Mapping[str, float | None]], seed: int) -> str:
    """Write the page: results by kind, minutes of each goal by plan (`fixed_minutes`), first seed."""
    text = STUDY.table({key: rows for key, rows in results.items() if good(rows)}).markdown()
    for plan, told in fixed.items():
        cells = (f"{goal}: {'not reached' if m is None else f'{m:.1f} min'}" for goal, m in told.items())
        text += f"| {plan}, by its covariance | {'; '.join(cells)} | | | | | | | |\n"
    tables = [_hidden(key, rows).markdown() for key in results if "hidden" in key[0] and (rows := good(results[key]))]
    return f"Seeds from {seed}.\n\n" + "\n".join((text, *tables))


def _hidden(key: Key, rows: Rows) -> Table:
    what = ", ".join((*key[1:], "hidden effect, 10 to 30 sigma on kim18"))
    headings = (what, "ends with one effect", "of these the right one", "in its class")
    tests: dict[str, Sequence[Any]] = {"adaptive": rows}
    tests |= {plan: [row["fixed"][plan] for row in rows] for plan in FIXED}
    lines = []
    for name, scored in tests.items():
        one = [row for row in scored if row["one"]]
        right, seen = sum(row["right"] for row in one), sum(row["in_class"] for row in scored)
        lines.append((name, of(len(one), scored), of(right, one), of(seen, scored)))
    return Table(headings, lines)
