"""One run of a Monte-Carlo campaign: a test simulated and calibrated in memory, estimate and truth side by side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from rate_table_sim.core import TableMotion, TableSpecification, phase_changes, table_motion
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording
from sdimu_calibration.core.specification import Model
from sdimu_sim.core.generator import simulate_imu
from sdimu_sim.core.mean_bias import mean_bias
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, imu_truth, temperature_log
from sdimu_sim.core.true_coefficients import true_coefficients
from sdimu_sim.core.truth import ImuTruth

KINDS = ("position", "velocity", "rate", "force")
"""Kinds of measurement, three rows each."""
CHANNELS = tuple(f"{kind}_{axis}" for kind in KINDS for axis in ("NED" if kind in KINDS[:2] else "xyz"))
"""Rows of the filter's measurement. The whitening mixes a row with those before it."""

_PINNED_SHARE = 1e-6
"""A sigma below this share of its prior is rounding: the body frame makes the coefficient zero."""


@dataclass(frozen=True)
class CalibrationRun:
    """Simulate and calibrate one test for a seed.

    Attributes
    ----------
    scenario : Scenario
        Its seed is replaced; coefficients and mount are drawn anew when it leaves them open.
    model : Model
        What is estimated.
    """

    scenario: Scenario
    model: Model

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed.

        Returns
        -------
        dict
            ``names`` of the coefficients, then in this order and the reported frame ``estimate``, ``truth``,
            ``sigma`` (SI) and ``covariance`` (lower triangle by rows); ``free``: coefficients that the frame does not
            make zero; ``nees`` over these; ``nis`` and ``nis_dof`` (sum and number) by `KINDS`; ``lag1`` and
            ``lag1_count`` by `CHANNELS`; ``passes``.

        Raises
        ------
        DataError
            When the scenario or the model cannot be used, or the filter diverges.
        """
        scenario = replace(self.scenario, seed=seed)
        sensor = imu_truth(scenario)
        fit = solve(PreparedTest(simulate(scenario, sensor), scenario.imu, scenario.site), self.model)
        if not isinstance(fit, NavigationFit):
            raise DataError(f"IMU '{scenario.imu.name}': a handheld fit has no innovations to study; choose another")
        names, frame, P, estimate = fit.names, fit.body_frame, fit.covariance, fit.values
        truth = true_values(sensor, names, frame)
        sigma = np.sqrt(np.diag(P))
        free = sigma > _PINNED_SHARE * fit.sensors.prior
        output = fit.last.output
        products, count = lag_one(output.normalised, fit.prepared.phases.stop)
        nis = output.nis
        return {
            "names": names, "estimate": estimate, "truth": truth, "sigma": sigma,
            "covariance": P[np.tril_indices(len(P))], "free": free, "nees": nees(estimate - truth, P, free),
            "nis": np.nansum(nis, axis=0), "nis_dof": 3 * np.isfinite(nis).sum(axis=0),
            "lag1": products, "lag1_count": count, "passes": fit.passes,
        }  # fmt: skip


def in_the_mean(sensor: ImuTruth, recording: Recording, seed: int) -> ImuTruth:
    """Return a sensor with its biases in the mean over the dwells: what a calibration states of a bias that drifts."""
    if recording.phase is None:
        return sensor
    mean = mean_bias(sensor, recording.t, recording.phase, recording.interval_s, seed)
    return replace(sensor, coefficients={**sensor.coefficients, **mean})


def simulate(scenario: Scenario, sensor: ImuTruth) -> Recording:
    """Make the recording of a scenario, as `sdimu_sim.core.scenario.generate` does, but without table angles.

    The table's motion does not depend on the seed (its encoders do, which no estimator reads), so that each process
    makes it once.
    """
    motion = _table_motion(scenario.plan, scenario.table)
    platform = PlatformMotion(motion.t, motion.q_nt, motion.omega_nt_t)
    samples = simulate_imu(platform, sensor, scenario.site, scenario.rate_hz, scenario.seed, scenario.temperature)
    return Recording(
        scenario.start_ns, samples.t, samples.omega_ib_b, samples.f_ib_b, PhaseLog(*phase_changes(motion)),
        temperature_log(scenario, float(motion.t[-1])),
    )  # fmt: skip


@lru_cache(maxsize=2)
def _table_motion(plan: Plan, table: TableSpecification) -> TableMotion:
    return table_motion(plan, table, 0)


def true_values(sensor: ImuTruth, names: tuple[str, ...], frame: str) -> Floats:
    """Truth of the estimated coefficients by name, shape (p,); what the simulator does not have is zero."""
    truth = true_coefficients(sensor, frame)
    return np.array([truth.get(name, 0.0) for name in names])


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


