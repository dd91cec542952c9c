"""Many effects at once: hide five to twelve in a test, diagnose, score each by name."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.score import among, classes, errors
from sdimu_study.study import Group, Key, Study, of, rms_z
from sdimu_study.worlds import (
    OneTest,
    diagnosed,
    drawn_effect,
    drawn_place,
    place_told,
    rng_of,
    simulated_test,
    with_effects,
)

_SPAN = (3.0, 50.0)
"""Size of each effect, in the sigma of the clean test."""
_NUMBER = (5, 13)
"""Least number of effects, and one more than the largest."""
_PLANS = ("kim18_signed", "recommended")
"""Plans that show most of the catalogue."""


def world(case: Key, seed: int) -> OneTest:
    """Hide many effects in a test of an IMU file."""
    (name,) = case
    rng, imu = rng_of(seed, "many", name), load_imu(name)
    plan, site = drawn_place(rng, _PLANS)
    return with_effects(
        lambda effects: simulated_test(name, imu, plan, site, seed, effects),
        load_model("baseline"),
        [lambda fit: drawn_effect(rng, fit, _SPAN)] * int(rng.integers(*_NUMBER)),
        place_told(plan, site),
    )


def run(world: OneTest) -> tuple[Diagnosis, float]:
    """Diagnose, and take the processor's time (s)."""
    began = time.process_time()
    return diagnosed(world), time.process_time() - began


def score(world: OneTest, outcome: tuple[Diagnosis, float]) -> dict[str, Any]:
    """Which effects were named, which names are wrong, errors over sigma of the coefficients."""
    found, seconds = outcome
    named, stops = classes(found), found.evidence.times.stops
    return {
        **world.told,
        "verdict": found.verdict,
        "effects": [
            {"text": t.text, "sigmas": t.sigmas, "named": any(among(t, one, stops) for one in named)}
            for t in world.truths
        ],
        "found": len(named),
        "wrong": [one[0] for one in named if not any(among(t, one, stops) for t in world.truths)],
        "noise": list(found.noise),
        "seconds": seconds,
        **errors(found.after, world.sensor),
    }


def _named(low: float, high: float) -> Any:
    def cell(g: Group) -> str:
        hits = [effect["named"] for row in g.good for effect in row["effects"] if low <= effect["sigmas"] < high]
        return of(sum(hits), hits)

    return cell


STUDY = Study(
    "many",
    world,
    run,
    score,
    (
        ("IMU file", lambda g: g.key[0]),
        ("runs", lambda g: of(len(g.good), g.rows)),
        ("8 sigma or more, named", _named(8.0, np.inf)),
        ("5 to 8", _named(5.0, 8.0)),
        ("below", _named(0.0, 5.0)),
        ("wrong names", lambda g: of(sum(len(row["wrong"]) for row in g.good), sum(row["found"] for row in g.good))),
        ("RMS z", lambda g: f"{rms_z(g.good):.2f}"),
        ("s", lambda g: f"{np.median([row['seconds'] for row in g.good]) if g.good else np.nan:.0f}"),
    ),
)
