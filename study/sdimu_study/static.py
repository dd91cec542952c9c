"""Static recordings as one set, in noise with a memory: is it one result in every order, and do its sigmas hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis, diagnose_set
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.plan import Turn
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.hand import stated_instability
from sdimu_study.set_world import here
from sdimu_study.static_world import CUBE, GRADES, PAIR, beyond_prior, rests, truth
from sdimu_study.study import Group, Key, Study, largest_z, of, rms_cell
from sdimu_study.worlds import rng_of

KINDS: Mapping[str, tuple[Turn, ...]] = {"cube": CUBE, "up and down": PAIR}
"""Sets of rests, by the turns between them."""
NOISES = ("data sheet", "walk")
"""Bias instability of the IMU's file, and a walk in a rest ten times the white noise in its mean."""
GROUPS = ("gyro_bias", "accel_bias", "accel_scale")
"""Coefficients that rests tell, of which the errors are also summed up apart."""

_DIAGNOSED = 5
"""Number of units of which one is also diagnosed: that takes the time of ten fits."""


@dataclass(frozen=True)
class StaticWorld:
    """Rests of a unit, in the order of the test and shuffled under other names; whether they are also diagnosed."""

    kind: str
    grade: str
    seed: int
    noise: tuple[str, ...] | None
    members: tuple[Member, ...]
    shuffled: tuple[Member, ...]
    diagnosed: bool


@dataclass(frozen=True)
class StaticFound:
    """Results of both orders, and the diagnosis where one was asked for."""

    result: Calibration
    other: Calibration
    left_out: int
    diagnosis: SetDiagnosis | None


def world(case: Key, seed: int) -> StaticWorld:
    """Simulate the rests of a kind of `KINDS` and an IMU file, in one of two kinds of noise with a memory."""
    kind, grade = case
    rng = rng_of(seed, "static", *case)
    walks = bool(rng.integers(2))
    noise = None if walks else tuple(stated_instability(load_imu(grade)))
    members = rests(grade, seed, KINDS[kind], noise)
    order = rng.permutation(len(members))
    shuffled = tuple(replace(members[k], name=f"file {number}") for number, k in enumerate(order))
    return StaticWorld(kind, grade, seed, noise, members, shuffled, seed % _DIAGNOSED == 0)


def run(world: StaticWorld) -> StaticFound:
    """Fit the rests together in both orders, and diagnose them."""
    options = SetOptions(load_model("baseline"))
    fit = fit_set(world.members, options, here)
    other = set_outcome(fit_set(world.shuffled, options, here))
    found = diagnose_set(world.members, options, here, fitted=fit) if world.diagnosed else None
    return StaticFound(set_outcome(fit), other, len(fit.left_out), found)


def score(world: StaticWorld, found: StaticFound) -> dict[str, Any]:
    """Squares of the errors over the sigmas, of all coefficients and by group, and what the diagnosis says."""
    result = found.result
    true = truth(world.grade, world.seed, KINDS[world.kind], result.body_frame, world.noise)
    sigma = np.sqrt(np.diag(result.covariance))
    without = beyond_prior(world.grade) if world.noise is None else ()
    z = {
        name: (value - true[name]) / s
        for name, value, s in zip(result.names, result.values.tolist(), sigma.tolist(), strict=True)
        if s > 0.0 and name in true and name not in without
    }
    row: dict[str, Any] = {
        "noise": NOISES[world.noise is None],
        "left_out": found.left_out,
        "same": bool(
            np.array_equal(result.values, found.other.values)
            and np.array_equal(result.covariance, found.other.covariance)
        ),
    }
    if found.diagnosis is not None:
        row |= {"verdict": str(found.diagnosis.verdict), "named": [f.label for f in found.diagnosis.findings]}
    return row | _squares("", list(z.values())) | _by_group(z)


def _by_group(z: Mapping[str, float]) -> dict[str, Any]:
    return {key: value for group in GROUPS for key, value in _squares(f"{group} ", _of_group(z, group)).items()}


def _of_group(z: Mapping[str, float], group: str) -> list[float]:
    return [value for name, value in z.items() if name.removesuffix(f"_{name[-1]}") == group]


def _squares(prefix: str, z: Sequence[float]) -> dict[str, Any]:
    """Sum of squares, number and largest size of errors over sigmas."""
    largest = max(map(abs, z), default=0.0)
    return {f"{prefix}z2": float(np.sum(np.square(z))), f"{prefix}count": len(z), f"{prefix}largest_z": largest}


def _rms_of(name: str, group: Group) -> str:
    return rms_cell([{"z2": row[f"{name} z2"], "count": row[f"{name} count"]} for row in group.good])


def _nothing_named(group: Group) -> str:
    told = [row["verdict"] for row in group.good if "verdict" in row]
    return of(told.count(str(Verdict.CONSISTENT)), told)


STUDY = Study(
    "static",
    world,
    run,
    score,
    (
        ("set", lambda group: group.key[0]),
        ("IMU file", lambda group: group.key[-1]),
        ("failed", lambda group: of(len(group.rows) - len(group.good), group.rows)),
        ("recordings left out", lambda group: str(sum(row["left_out"] for row in group.good))),
        ("same digits in any order", lambda group: of(group.count(lambda row: row["same"]), group.good)),
        ("RMS z", lambda group: rms_cell(group.good)),
        *((f"{name} RMS z", partial(_rms_of, name)) for name in GROUPS),
        ("largest z", lambda group: largest_z(group.good)),
        ("nothing named", _nothing_named),
    ),
)
CASES = {(kind, grade): (kind, grade) for kind in KINDS for grade in GRADES}
"""One case a kind of set and IMU file."""
