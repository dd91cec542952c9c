"""Monte-Carlo runs: a test simulated and calibrated in memory, estimate and truth side by side, and what they sum to.

The data file has the format ``sdimu-monte-carlo/1``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.alignment.prepared import set_up
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.batch.batch import bound_covariance
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.filter.pass_loop import MOST_PASSES
from sdimu_calibration.core.planning.predict import predict
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model
from sdimu_sim.core.hidden import parse_effects
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth
from sdimu_study import statistics
from sdimu_study.shards import failed
from sdimu_study.study import Study, good
from sdimu_study.worlds import simulate, true_values

FORMAT = "sdimu-monte-carlo/1"
KINDS = ("position", "velocity", "rate", "force")
"""Kinds of measurement, three rows each."""
CHANNELS = tuple(f"{kind}_{axis}" for kind in KINDS for axis in ("NED" if kind in KINDS[:2] else "xyz"))
"""Rows of the filter's measurement. The whitening mixes a row with those before it."""
MOUNTS = 8
"""Mounts that stand for all: the bound moves by a few per cent between 0 and 3 deg."""
_PINNED_SHARE = 1e-6
"""A sigma below this share of its prior is rounding: the body frame makes the coefficient zero."""


@dataclass(frozen=True)
class Campaign:
    """Simulate a scenario, its seed replaced (coefficients and mount drawn where it leaves them open); fit a model."""

    scenario: Scenario
    model: Model


@dataclass(frozen=True)
class Simulated:
    """A simulated test with its sensor."""

    test: PreparedTest
    model: Model
    sensor: ImuTruth


def world(case: Campaign, seed: int) -> Simulated:
    """Simulate a seed."""
    scenario = replace(case.scenario, seed=seed)
    sensor = imu_truth(scenario)
    return Simulated(PreparedTest(simulate(scenario, sensor), scenario.imu, scenario.site), case.model, sensor)


def run(world: Simulated) -> Fit:
    """Calibrate."""
    return solve(world.test, world.model)


def score(world: Simulated, fit: Fit) -> dict[str, Any]:
    """Join estimate and truth.

    Returns
    -------
    dict
        ``names`` of the coefficients, then in this order and the reported frame ``estimate``, ``truth``,
        ``sigma`` (SI) and ``covariance`` (lower triangle by rows); ``free``: coefficients that the frame does not
        make zero; ``nees`` over these; ``nis`` and ``nis_dof`` (sum and number) by `KINDS`; ``lag1`` and
        ``lag1_count`` by `CHANNELS`; ``passes``.
    """
    if not isinstance(fit, NavigationFit):
        raise DataError(f"IMU '{world.test.imu.name}': a handheld fit has no innovations to study; choose another")
    P, estimate, sigma = fit.covariance, fit.values, np.sqrt(np.diag(fit.covariance))
    truth = true_values(world.sensor, fit.names, fit.body_frame)
    free = sigma > _PINNED_SHARE * fit.sensors.prior
    output = fit.last.output
    products, count = lag_one(output.normalised, fit.prepared.phases.stop)
    return {
        "names": fit.names,
        "estimate": estimate,
        "truth": truth,
        "sigma": sigma,
        "covariance": P[np.tril_indices(len(P))],
        "free": free,
        "nees": nees(estimate - truth, P, free),
        "nis": np.nansum(output.nis, axis=0),
        "nis_dof": 3 * np.isfinite(output.nis).sum(axis=0),
        "lag1": products,
        "lag1_count": count,
        "passes": fit.passes,
    }


STUDY = Study("monte-carlo", world, run, score)


def nees(error: Floats, P: Floats, free: Bools) -> float:
    """Normalised estimation error squared of the coefficients `free` (p,): ``e' P^-1 e``."""
    e, part = error[free], P[np.ix_(free, free)]
    # Scaled by sigma first: the units differ by many orders of magnitude.
    s = np.sqrt(np.diag(part))
    return float((e / s) @ np.linalg.solve(part / np.outer(s, s), e / s))


def lag_one(normalised: Floats, stop: Ints) -> tuple[Floats, Ints]:
    """Sum of products of normalised innovations with those of the epoch before at the same stop.

    Parameters
    ----------
    normalised : ndarray, shape (e, 12)
        NaN where nothing was measured.
    stop : ndarray of int, shape (e,)

    Returns
    -------
    products : ndarray, shape (12,)
        For white innovations of unit variance: mean 0, variance `count`.
    count : ndarray of int, shape (12,)
    """
    pairs = np.where((stop[1:] == stop[:-1])[:, None], normalised[1:] * normalised[:-1], np.nan)
    return np.nansum(pairs, axis=0), np.isfinite(pairs).sum(axis=0)


def plan_bound(case: Campaign, seeds: Iterable[int]) -> dict[str, float]:
    """Bound of the plan by covariance of the batch estimator, without data.

    Parameters
    ----------
    case : Campaign
    seeds : iterable of int
        Of the campaign; the first `MOUNTS` of them give mounts, over which the variance is averaged.

    Returns
    -------
    dict of str to float
        Sigma (SI) by coefficient name, in the reported body frame.
    """
    scenario = case.scenario
    variances = []
    names: tuple[str, ...] = ()
    for _, seed in zip(range(1 if scenario.mount_rad is not None else MOUNTS), seeds, strict=False):
        mount = np.asarray(imu_truth(replace(scenario, seed=seed)).mount_rad)
        found = predict(scenario.plan, scenario.site, scenario.imu, case.model, mount_rad=mount, bound=bound_covariance)
        names = found.names
        variances.append(found.bound**2)
    return dict(zip(names, np.sqrt(np.mean(variances, axis=0)).tolist(), strict=True))


def check(case: Campaign, number: int, seed: int) -> None:
    """Refuse what would make every run fail."""
    scenario = case.scenario
    if number < 2:
        raise DataError(f"-n {number}: expected at least 2 runs")
    if seed < 0:
        raise DataError(f"--seed {seed}: expected a whole number from 0")
    if not 10.0 <= scenario.rate_hz <= 1000.0:
        raise DataError(f"--rate {scenario.rate_hz:g} Hz: expected 10 to 1000 Hz")
    if parse_effects(scenario.effects).needs_temperature and scenario.temperature is None:
        raise DataError("a hidden effect needs the temperature: give --temperature")
    set_up(scenario.site, scenario.imu, case.model)


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
        Of `STUDY` for every seed; failed runs among them.
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
    """
    done = good(rows)
    if len(done) < 2:
        reasons = "; ".join(sorted({str(row["error"]) for row in failed(rows)})) or "none was made"
        raise DataError(f"{len(done)} finished runs are too few for statistics: expected at least 2 ({reasons})")
    free = np.all(np.array([row["free"] for row in done], dtype=bool), axis=0)
    names = [name for name, is_free in zip(done[0]["names"], free, strict=True) if is_free]
    errors = (statistics.stack(done, "estimate") - statistics.stack(done, "truth"))[:, free]
    sigmas = statistics.stack(done, "sigma")[:, free]
    found = statistics.coefficient_statistics(names, errors, sigmas, bound)
    n, p = errors.shape
    nees, lag1, counts = (statistics.stack(done, key) for key in ("nees", "lag1", "lag1_count"))
    nis, dof = statistics.stack(done, "nis"), statistics.stack(done, "nis_dof")
    checks = [
        statistics.bias_check(found, n),
        *statistics.sigma_checks(found, n),
        statistics.bound_check(found, n),
        statistics.nees_check(nees, p),
        statistics.nis_check(nis.sum(axis=1), dof.sum(axis=1)),
        statistics.lag_check(lag1, counts, CHANNELS),
    ]
    z_low, z_high = statistics.rms_interval(n, p)
    return {
        "format": FORMAT,
        "runs": n,
        "unconverged": [row["seed"] for row in done if row["passes"] >= MOST_PASSES],
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
            "values": nis.sum(axis=1) / dof.sum(axis=1),
            "dof": dof.sum(axis=1),
            "by_kind": dict(zip(KINDS, _ratio(nis.sum(axis=0), dof.sum(axis=0)), strict=True)),
        },
        "autocorrelation": _autocorrelation(lag1, counts),
        "time": {
            name: float(np.mean([row[key] for row in done]))
            for name, key in (("wall_s_per_run", "wall_s"), ("cpu_s_per_run", "cpu_s"), ("passes", "passes"))
        },
    }


def _coefficients(
    names: Sequence[str], found: statistics.CoefficientStatistics, model: Model, imu: ImuSpecification
) -> list[dict[str, Any]]:
    """Errors of every coefficient, with its units."""
    units = {q.name: (q.unit, q.display_unit) for q in imu_model.build(model.effects, imu).parameters}
    return [
        {
            "name": name,
            "unit": units[name][0],
            "display_unit": units[name][1],
            "bias": found.bias[k],
            "bias_error": found.bias_error[k],
            "rms": found.rms[k],
            "sigma": found.sigma[k],
            "bound": found.bound[k],
            "rms_z": found.rms_z[k],
        }
        for k, name in enumerate(names)
    ]


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
