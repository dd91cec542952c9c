"""The study of adaptive tests as a page: minutes, errors over sigma, what was named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.planning.predict import predict
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_calibration.storage.files.goal_file import load_goals
from sdimu_study.adaptive_run import FIXED, KINDS

Row = dict[str, Any]


def page(results: Mapping[str, Sequence[Row]], fixed: Mapping[str, Mapping[str, float | None]], seed: int) -> str:
    """Write the tables.

    Parameters
    ----------
    results : mapping of str to sequence of dict
        Rows of `AdaptiveRun` by kind.
    fixed : mapping of str to mapping of str to float or None
        Minutes of each goal by plan, as of `fixed_minutes`.
    seed : int
        First seed.
    """
    parts = [f"Seeds from {seed}.", "", *_minutes(results, fixed), ""]
    hidden = _good(results.get("hidden", ()))
    if hidden:
        parts += _hidden(hidden)
    return "\n".join(parts) + "\n"


def fixed_minutes(plan: str, goal: str, site: Site, imu: ImuSpecification, model: Model) -> float | None:
    """Minutes from which a plan, by its covariance, meets all limits of a goal; None where it does not."""
    goals, told = load_goals(goal), predict(load_plan(plan), site, imu, model)
    limited, limit = goals.of(told.names, told.body_frame)
    late = np.flatnonzero((told.history[:, limited] > limit).any(axis=1))
    if len(late) and late[-1] == len(told.t) - 1:
        return None
    return float(told.t[late[-1] + 1] / 60.0) if len(late) else 0.0


def _good(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if "error" not in row]


def _minutes(results: Mapping[str, Sequence[Row]], fixed: Mapping[str, Mapping[str, float | None]]) -> list[str]:
    lines = [
        "| test | goals | runs | minutes, median (range) | limits hold | RMS z | RMS error / limit | an effect named |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        rows = _good(results.get(kind, ()))
        if not rows:
            continue
        minutes = np.array([row["minutes"] for row in rows])
        z, errors = (np.concatenate([row[name] for row in rows]) for name in ("z", "errors"))
        holds, named = (sum(test(row) for row in rows) for test in (_holds, lambda row: bool(row["named"])))
        goal = "table33" if kind == "table33" else "kim18"
        lines.append(
            f"| adaptive, {'hidden effect' if kind == 'hidden' else 'clean'} | {goal} | {len(rows)} | "
            f"{np.median(minutes):.1f} ({minutes.min():.1f}-{minutes.max():.1f}) | {holds} | "
            f"{np.sqrt(np.mean(z**2)):.2f} | {np.sqrt(np.mean(errors**2)):.2f} | {named} |"
        )
    for plan, told in fixed.items():
        cells = (f"{goal}: {'not reached' if m is None else f'{m:.1f} min'}" for goal, m in told.items())
        lines.append(f"| {plan}, by its covariance | {'; '.join(cells)} | | | | | | |")
    return lines


def _holds(row: Row) -> bool:
    return bool(row["worst"] <= 1.0)


def _hidden(rows: Sequence[Row]) -> list[str]:
    lines = [
        "| hidden effect, 10 to 30 sigma on kim18 | ends with one effect | of these the right one | in its class |",
        "|---|---|---|---|",
    ]
    tests = {"adaptive": rows} | {plan: [row["fixed"][plan] for row in rows] for plan in FIXED}
    for name, scored in tests.items():
        one = [row for row in scored if row["one"]]
        right, seen = sum(row["right"] for row in one), sum(row["in_class"] for row in scored)
        lines.append(f"| {name} | {len(one)} of {len(scored)} | {right} of {len(one)} | {seen} of {len(scored)} |")
    return lines
