"""Every IMU file, clean and with one hidden effect: what a diagnosis with nothing but file and site says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu
from sdimu_study.plans import FILED
from sdimu_study.score import scored
from sdimu_study.study import Group, Key, Results, Rows, Study, Table, head, of, rms_z
from sdimu_study.worlds import (
    HANDHELD,
    OneTest,
    choice,
    diagnosed,
    drawn_effect,
    drawn_place,
    model_of,
    place_told,
    rng_of,
    simulated_test,
    with_effects,
)

CLEAN, HIDDEN = "clean", "hidden"


def world(case: Key, seed: int) -> OneTest:
    """Simulate a test of an IMU file, `CLEAN` or with an effect of 10 to 30 sigma."""
    name, kind = case
    rng, imu = rng_of(seed, name), load_imu(name)
    plan, site = drawn_place(rng)
    draws = [lambda fit: drawn_effect(rng, fit)] if kind == HIDDEN else []
    return with_effects(
        lambda effects: simulated_test(name, imu, plan, site, seed, effects),
        model_of(name),
        draws,
        place_told(plan, site),
    )


STUDY = Study("grades", world, diagnosed, scored)


def choices(name: str, seed: int, draws: int) -> Rows:
    """Estimators that clean tests of an IMU file get on every plan."""
    plans = FILED[:1] if name == HANDHELD else FILED
    return [{"plan": plan, "estimator": choice(name, plan, seed + k)} for plan in plans for k in range(draws)]


def _share(group: Group, test: Any) -> str:
    return of(group.count(test), group.rows)


def _median(group: Group) -> str:
    return f"{np.median([row['largest_z'] for row in group.good]):.1f}" if group.good else ""


_LINES: tuple[tuple[str, str, Any], ...] = (
    ("estimator", CLEAN, lambda g: ", ".join(sorted({r["estimator"] for r in g.good}))),
    ("clean: consistent", CLEAN, lambda g: _share(g, lambda r: r["verdict"] == Verdict.CONSISTENT)),
    ("clean: refused", CLEAN, lambda g: str(len(g.rows) - len(g.good))),
    ("clean: accuses site or recording", CLEAN, lambda g: str(g.count(lambda r: r["accuses"]))),
    ("clean: RMS z of the coefficients", CLEAN, lambda g: f"{rms_z(g.good):.2f}"),
    ("hidden: in the class named", HIDDEN, lambda g: _share(g, lambda r: r["in_class"])),
    ("hidden: named first", HIDDEN, lambda g: _share(g, lambda r: r["first"])),
    ("hidden: RMS z of the coefficients", HIDDEN, lambda g: f"{rms_z(g.good):.2f}"),
    ("hidden: median of the largest z", HIDDEN, _median),
)
"""Word, kind of test, and cell of one IMU file."""


def page(results: Results, chosen: Mapping[str, Rows], first: int) -> str:
    """Make the page, doc/grades.md, of results by IMU file and kind, and of what `choices` gave; `first` is a seed."""
    names = list(dict.fromkeys(name for name, _ in results))
    lines = [[word, *(cell(Group((name,), results[name, kind])) for name in names)] for word, kind, cell in _LINES]
    lines.append(["choices of estimator, by plan", *(_choices(chosen.get(name, ())) for name in names)])
    runs = max(len(rows) for (_, kind), rows in results.items() if kind == CLEAN)
    return head("grades", runs=runs, first=first) + Table(["", *names], lines).markdown()


def _choices(rows: Rows) -> str:
    by_plan: dict[str, set[str]] = {}
    for row in rows:
        by_plan.setdefault(row["plan"], set()).add(row["estimator"])
    return f"{max(map(len, by_plan.values()))} a plan in {len(rows)} draws" if by_plan else ""
