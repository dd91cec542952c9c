"""From the rows of a campaign to its data file (format ``sdimu-monte-carlo/1``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.filter.passes import MOST_PASSES
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model
from sdimu_study import statistics
from sdimu_study.run import CHANNELS, KINDS
from sdimu_study.shards import failed

FORMAT = "sdimu-monte-carlo/1"


def summarise(
    rows: Sequence[Mapping[str, Any]],
    model: Model,
    imu: ImuSpecification,
    bound: Mapping[str, float] | None = None,
    bound_from: str = "mean reported sigma",
) -> dict[str, Any]:
    """Judge the runs of a campaign.

    Parameters
    ----------
    rows : sequence of mapping
        What `sdimu_study.run.CalibrationRun` gave for every seed; failed runs among them.
    model, imu : Model, ImuSpecification
        Of the campaign.
    bound : mapping of str to float, optional
        Least possible sigma (SI) by coefficient name.
    bound_from : str
        Where it comes from.

    Returns
    -------
    dict
        Content of the data file; SI.

    Raises
    ------
    DataError
        When fewer than two runs were finished.
    """
    good = [row for row in rows if "error" not in row]
    if len(good) < 2:
        reasons = "; ".join(sorted({str(row["error"]) for row in failed(rows)})) or "none was made"
        raise DataError(f"{len(good)} finished runs are too few for statistics: expected at least 2 ({reasons})")
    free = np.all(np.array([row["free"] for row in good], dtype=bool), axis=0)
    names = [name for name, is_free in zip(good[0]["names"], free, strict=True) if is_free]
    errors = (statistics.stack(good, "estimate") - statistics.stack(good, "truth"))[:, free]
    sigmas = statistics.stack(good, "sigma")[:, free]
    found = statistics.coefficient_statistics(names, errors, sigmas, bound)
    n, p = errors.shape
    nees, lag1, counts = (statistics.stack(good, key) for key in ("nees", "lag1", "lag1_count"))
    nis, dof = statistics.stack(good, "nis"), statistics.stack(good, "nis_dof")
    checks = [
        statistics.bias_check(found, n),
        *statistics.sigma_checks(found, n),
        statistics.bound_check(found),
        statistics.nees_check(nees, p),
        statistics.nis_check(nis.sum(axis=1), dof.sum(axis=1)),
        statistics.lag_check(lag1, counts, CHANNELS),
    ]
    z_low, z_high = statistics.rms_interval(n, p)
    return {
        "format": FORMAT,
        "runs": n,
        "unconverged": [row["seed"] for row in good if row["passes"] >= MOST_PASSES],
        "failed": [{"seed": row["seed"], "error": row["error"]} for row in failed(rows)],
        "body_frame": model.body_frame,
        "model": list(model.effects),
        "level": statistics.LEVEL,
        "bound_from": bound_from,
        "checks": [
            {"name": c.name, "value": c.value, "low": c.low, "high": c.high, "passed": c.passed} for c in checks
        ],
        "rms_z_interval": [z_low, z_high],
        "coefficients": _coefficients(names, found, model, imu),
        "nees": {"dof": p, "values": nees},
        "nis": {
            "values": nis.sum(axis=1) / dof.sum(axis=1), "dof": dof.sum(axis=1),
            "by_kind": dict(zip(KINDS, _ratio(nis.sum(axis=0), dof.sum(axis=0)), strict=True)),
        },
        "autocorrelation": _autocorrelation(lag1, counts),
        "time": {
            name: float(np.mean([row[key] for row in good]))
            for name, key in (("wall_s_per_run", "wall_s"), ("cpu_s_per_run", "cpu_s"), ("passes", "passes"))
        },
    }  # fmt: skip


def _coefficients(
    names: Sequence[str], found: statistics.CoefficientStatistics, model: Model, imu: ImuSpecification
) -> list[dict[str, Any]]:
    """Errors of every coefficient, with its units."""
    units = {q.name: (q.unit, q.display_unit) for q in imu_model.build(model.effects, imu).parameters}
    return [
        {
            "name": name, "unit": units[name][0], "display_unit": units[name][1], "bias": found.bias[k],
            "bias_error": found.bias_error[k], "rms": found.rms[k], "sigma": found.sigma[k],
            "bound": found.bound[k], "rms_z": found.rms_z[k],
        }
        for k, name in enumerate(names)
    ]  # fmt: skip


def _autocorrelation(lag1: Floats, counts: Floats) -> list[dict[str, Any]]:
    """Correlation of successive innovations of every channel."""
    pairs = counts.sum(axis=0)
    columns = (CHANNELS, _ratio(lag1.sum(axis=0), pairs), statistics.lag_scores(lag1, counts), pairs)
    return [
        {"channel": channel, "value": value, "standard_errors": score, "pairs": int(number)}
        for channel, value, score, number in zip(*columns, strict=True)
    ]


def _ratio(top: Floats, below: Floats) -> list[float]:
    return [float(t / b) if b else float("nan") for t, b in zip(top, below, strict=True)]
