"""Physics that the catalogue lacks: hide an effect, diagnose as if the catalogue lacked it, and as it is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.hidden import effect_names
from sdimu_sim.core.mean_bias import BIASES
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.score import scored_row
from sdimu_study.study import Group, Key, Results, Rows, Study, head, of, rms_cell
from sdimu_study.worlds import OneTest, drawn_effect, drawn_place, place_told, rng_of, simulated_test, with_effects

_SPAN = (15.0, 30.0)
"""Size of the hidden effect, in the sigma of the clean test."""


@dataclass(frozen=True)
class Disturbed(OneTest):
    """A test with its hidden effect, and `clean`: the same samples without it."""

    clean: Recording | None = None


def world(case: Key, seed: int) -> Disturbed:
    """Hide an effect of a family (its name in the registry) in a test of an IMU file."""
    name, family = case
    rng, imu = rng_of(seed, name, family), load_imu(name)
    plan, site = drawn_place(rng)
    made: list[Recording] = []

    def simulated(effects: tuple[str, ...]) -> Any:
        test, sensor = simulated_test(name, imu, plan, site, seed, effects)
        made.append(test.recording)
        return test, sensor

    one = with_effects(
        simulated,
        load_model("baseline"),
        [lambda fit: drawn_effect(rng, fit, _SPAN, (family,), options=True)],
        place_told(plan, site),
    )
    return Disturbed(one.test, one.model, one.sensor, one.truths, one.told, made[0])


def run(world: Disturbed) -> tuple[Diagnosis, Diagnosis]:
    """Diagnose with the catalogue as it is, and without the family."""
    fit = solve(world.test, world.model)
    return climb(fit), climb(fit, without=tuple(truth.family for truth in world.truths))


def score(world: Disturbed, found: tuple[Diagnosis, Diagnosis]) -> dict[str, Any]:
    """Return ``with`` and ``without`` the effect in the catalogue, each a row as `scored_row` makes it."""
    known, lacking = found
    (truth,), meant = world.truths, world.sensor
    if registry.get(truth.family).wander_like and world.clean is not None:
        meant = with_mean_error(world.sensor, world.clean, world.test.recording)
    return {"with": scored_row(known, world.sensor, truth), "without": scored_row(lacking, meant, truth), **world.told}


def with_mean_error(sensor: ImuTruth, clean: Recording, disturbed: Recording) -> ImuTruth:
    """Return a sensor whose biases are means over the dwells of all that a transient adds.

    A transient of one sense after every turn is, for who does not know it, a part of the bias: the estimate states the
    bias in the mean over the dwells, and so does this truth. Noise is the same in both recordings, without the
    transient and with it, and cancels.
    """
    log = disturbed.phase
    if log is None:
        return sensor
    middle = disturbed.t - 0.5 * disturbed.interval_s
    rest = np.asarray(log.dwell)[np.clip(np.searchsorted(log.t, middle, side="right") - 1, 0, None)].astype(bool)
    added = np.hstack([disturbed.omega_ib_b - clean.omega_ib_b, disturbed.f_ib_b - clean.f_ib_b])[rest].mean(axis=0)
    shifted = {name: sensor.coefficients.get(name, 0.0) + float(m) for name, m in zip(BIASES, added, strict=True)}
    return replace(sensor, coefficients={**sensor.coefficients, **shifted})


def families(asked: list[str] | None) -> list[str]:
    """Effects of the catalogue that the simulator can hide, or those that are asked for."""
    unknown = sorted(set(asked or ()) - set(registry.names()))
    if unknown:
        whole = [n for n in registry.names() if unknown[0] in {p.name for p in registry.get(n).parameters}]
        if whole:
            raise DataError(f"--effect {unknown[0]}: a coefficient of {whole[0]}; name that")
        raise DataError(f"--effect {unknown[0]}: no effect of the catalogue; sdimu effects lists them")
    shown = frozenset(effect_names())
    known = [n for n in registry.names() if any(p.name in shown for p in registry.get(n).parameters)]
    return asked or [n for n in known if registry.get(n).needs != "temperature"]


def _rows(g: Group, word: str) -> Rows:
    return [row[word] for row in g.good]


def _seen(g: Group) -> Rows:
    return [row for row in _rows(g, "without") if row["verdict"] != Verdict.CONSISTENT]


STUDY = Study(
    "missing",
    world,
    run,
    score,
    (
        ("effect", lambda g: g.key[-1]),
        ("named", lambda g: of(g.count(lambda row: row["with"]["in_class"]), g.good)),
        ("RMS z", lambda g: rms_cell(_rows(g, "with"))),
        ("seen without it", lambda g: of(len(_seen(g)), g.good)),
        ("noise", lambda g: str(sum(row["verdict"] == Verdict.NOISE_MODEL_WRONG for row in _seen(g)))),
        ("RMS z without it", lambda g: rms_cell(_rows(g, "without"))),
        ("largest", lambda g: f"{max((row['largest_z'] for row in _rows(g, 'without')), default=float('nan')):.1f}"),
    ),
)


def page(imu: str, results: Results, first: int) -> str:
    """Make the page, doc/missing.md, of results by effect; `first` is the first seed."""
    above = head("missing", imu=imu, runs=max(map(len, results.values())), first=first)
    return above + STUDY.table(results, ("**all**",)).markdown()
