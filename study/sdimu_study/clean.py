"""Clean tests: what a diagnosis names where nothing is hidden, of any IMU file on any plan at any site."""

from __future__ import annotations

import math
from typing import Any

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu
from sdimu_study.plans import PLANS
from sdimu_study.score import scored
from sdimu_study.study import Results, Study, head, largest_z, rms_cell
from sdimu_study.worlds import HANDHELD, OneTest, diagnosed, drawn_site, model_of, rng_of, simulated_test

BY_HAND = "by hand"
"""In the place of a plan: a run by hand."""
RATES_HZ = (20.0, 50.0, 100.0)
"""Sample rates that are drawn (Hz): what is found in the samples, such as rests, depends on the rate."""


def world(case: tuple[str, str], seed: int) -> OneTest:
    """Simulate a test of an IMU file on a plan of `PLANS`; a run by hand has none."""
    imu, plan = case
    rng = rng_of(seed, "clean", imu, plan)
    site, rate_hz = drawn_site(rng), float(rng.choice(RATES_HZ))
    # Draws of a seed are the same in any file and plan: a chance that makes a false alarm would make one in all.
    own = int(rng.integers(2**31))
    test, sensor = simulated_test(imu, load_imu(imu), plan, site, own, (), rate_hz=rate_hz)
    told = {"latitude_deg": math.degrees(site.latitude_rad), "rate_hz": rate_hz}
    return OneTest(test, model_of(imu), sensor, told=told)


def score(world: OneTest, found: Diagnosis) -> dict[str, Any]:
    """Verdict, what was named, errors over sigma of the coefficients."""
    return scored(world, found) | {"noise": list(found.noise), "estimator": found.before.estimator}


STUDY = Study(
    "clean",
    world,
    diagnosed,
    score,
    (
        ("IMU file", lambda g: g.key[0]),
        ("plan", lambda g: g.key[1]),
        ("runs", lambda g: str(len(g.rows))),
        ("effect", lambda g: str(g.count(lambda r: r["named"]))),
        ("noise", lambda g: str(g.count(lambda r: not r["named"] and r["noise"]))),
        ("other", lambda g: str(g.count(_other))),
        ("refused", lambda g: str(len(g.rows) - len(g.good))),
        ("RMS z", lambda g: rms_cell(g.good)),
        ("largest z", lambda g: largest_z(g.good)),
    ),
)


def _other(row: Any) -> bool:
    return not row["named"] and not row["noise"] and row["verdict"] != Verdict.CONSISTENT


def plans_of(imu: str) -> tuple[str, ...]:
    """Name the plans on which an IMU file is tested: all, or none for runs by hand."""
    return (BY_HAND,) if imu == HANDHELD else PLANS


def page(results: Results, first: int) -> str:
    """Make the page, doc/clean.md, of results by IMU file and plan; `first` is the first seed."""
    refused = [
        f"- {imu} on {plan}, seed {row['seed']}: {row['error']}\n"
        for (imu, plan), rows in results.items()
        for row in rows
        if "error" in row
    ]
    why = "".join(["\nRefused:\n\n", *refused]) if refused else ""
    return head("clean", first=first) + STUDY.table(results, ("**all**", "")).markdown() + why
