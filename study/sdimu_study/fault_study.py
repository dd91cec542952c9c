"""The matrix of faults: every kind at every size with several seeds, and what became of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, replace

import numpy as np

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.specification import Model
from sdimu_sim.core.faults import FAULTS, Fault
from sdimu_sim.core.scenario import Scenario
from sdimu_study.fault_run import OK, Outcome, run_fault

_HURRY_RAD_S = float(np.radians(9.0))
_DWELL_S = 20.0


def hurried(plan: Plan) -> Plan:
    """Plan the same attitudes in ten minutes: dwells of 20 s and turns at 9 deg/s."""
    turns = tuple(replace(turn, rate_rad_s=_HURRY_RAD_S) for turn in plan.turns)
    return Plan(f"{plan.name} in a hurry", (_DWELL_S,) * len(plan.dwell_s), turns, _HURRY_RAD_S)


def fault_study(
    scenario: Scenario,
    model: Model,
    seeds: Iterable[int],
    faults: Iterable[Fault] = FAULTS,
    progress: Callable[[str, float], None] | None = None,
) -> list[Outcome]:
    """Run all kinds and sizes.

    Parameters
    ----------
    scenario : Scenario
        Its seed is replaced.
    model : Model
    seeds, faults : iterable
    progress : callable, optional
        Called with a word and the fraction done.
    """
    cases = [(fault, size, seed) for fault in faults for size in fault.sizes for seed in seeds]
    out = []
    for k, (fault, size, seed) in enumerate(cases):
        if progress is not None:
            progress(fault.name, k / len(cases))
        out.append(run_fault(scenario, model, fault, size, seed))
    return out


def cell(outcomes: list[Outcome]) -> str:
    """One cell of the table: verdicts of the seeds, and the largest error in sigmas."""
    counts = {verdict: [o.verdict for o in outcomes].count(verdict) for verdict in {o.verdict for o in outcomes}}
    text = ", ".join(f"{v} {n}" if len(counts) > 1 else v for v, n in sorted(counts.items(), key=lambda c: -c[1]))
    worst = [o.worst for o in outcomes if np.isfinite(o.worst)]
    return f"{text} ({max(worst):.2g})" if worst else text


def table(outcomes: list[Outcome]) -> list[tuple[str, str, list[str]]]:
    """Rows of name, what it is with its unit, and five cells ``size: verdicts (largest error)``."""
    rows = []
    for fault in FAULTS:
        mine = [o for o in outcomes if o.fault == fault.name]
        if mine:
            cells = [f"{size:g}: {cell([o for o in mine if o.size == size])}" for size in fault.sizes]
            rows.append((fault.name, f"{fault.what} ({fault.unit})", cells))
    return rows


def totals(outcomes: list[Outcome]) -> dict[str, int]:
    """How many of each verdict, `OK` first."""
    verdicts = sorted({o.verdict for o in outcomes}, key=lambda v: (v != OK, v))
    return {verdict: sum(o.verdict == verdict for o in outcomes) for verdict in verdicts}


def content(outcomes: list[Outcome]) -> dict[str, object]:
    """Everything for a JSON file."""
    return {"totals": totals(outcomes), "runs": [asdict(o) for o in outcomes]}
