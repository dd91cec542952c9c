"""One test with one fault in it: simulated, spoilt, calibrated, joined with the truth."""

from __future__ import annotations

import traceback
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from rate_table_sim.core import TableMotion, phase_changes, table_motion
from sdimu_calibration.core.data.arrival import arrange
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording, origin_ns, seconds
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model
from sdimu_sim.core.faults import Fault
from sdimu_sim.core.generator import simulate_imu
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_study.run import true_values

OK, NOTED, WARNED, REFUSED, WRONG, TRACEBACK = "ok", "noted", "warned", "refused", "SILENT WRONG", "traceback"
LIMIT = 5.0
"""Error in sigmas from which a result without a warning is wrong."""


@dataclass(frozen=True)
class Outcome:
    """What became of a test with a fault.

    Attributes
    ----------
    fault : str
    size : float
    seed : int
    verdict : str
        ``ok`` (within `LIMIT`, nothing noted), ``noted`` (within it, and the data section names a fault), ``warned``
        (outside, and the result says that it is not to be trusted), ``refused`` (`DataError`), ``SILENT WRONG``,
        ``traceback``.
    worst : float
        Largest error in sigmas; NaN without a result.
    said : tuple of str
        What the result, or the refusal, says.
    """

    fault: str
    size: float
    seed: int
    verdict: str
    worst: float
    said: tuple[str, ...]


def run_fault(scenario: Scenario, model: Model, fault: Fault, size: float, seed: int) -> Outcome:
    """Simulate a test with a seed, spoil it, calibrate it as from a bag, compare with the truth."""
    scenario = replace(scenario, seed=seed)
    try:
        result = calibrate(spoilt(scenario, fault, size), scenario.site, scenario.imu, model)
    except DataError as error:
        return Outcome(fault.name, size, seed, REFUSED, float("nan"), (str(error),))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return Outcome(fault.name, size, seed, TRACEBACK, float("nan"), (f"{error!r} at {last.name}:{last.lineno}",))
    worst = largest_error(scenario, result)
    inside = NOTED if result.notes else OK
    outside = WARNED if result.warnings else WRONG
    verdict = inside if worst < LIMIT else outside
    return Outcome(fault.name, size, seed, verdict, worst, result.notes)


def largest_error(scenario: Scenario, result: Calibration) -> float:
    """Largest error of a coefficient in its sigma, of those the body frame does not make zero."""
    truth = true_values(imu_truth(scenario), result.names, result.body_frame)
    sigma = np.sqrt(np.diag(result.covariance))
    free = sigma > 1e-9 * np.array([scenario.imu.prior[n.rsplit("_", 1)[0]] for n in result.names])
    return float(np.max(np.abs(result.values - truth)[free] / sigma[free]))


def spoilt(scenario: Scenario, fault: Fault, size: float) -> Recording:
    """Make the recording of a scenario with a fault in it, as the reader of bags would give it."""
    rng = np.random.default_rng([scenario.seed, *fault.name.encode()])
    motion = _table_motion(scenario)
    platform = PlatformMotion(motion.t, motion.q_nt, motion.omega_nt_t)
    phase = PhaseLog(*phase_changes(motion))
    if fault.motion is not None:
        empty = np.empty((0, 3))
        platform = fault.motion(platform, Recording(0, motion.t, empty, empty, phase), size, rng)
    samples = simulate_imu(platform, imu_truth(scenario), scenario.site, scenario.rate_hz, scenario.seed)
    recording = Recording(scenario.start_ns, samples.t, samples.omega_ib_b, samples.f_ib_b, phase)
    return as_read(fault.samples(recording, size, rng) if fault.samples is not None else recording)


def as_read(arrived: Recording) -> Recording:
    """Put a recording in the order of arrival through what the reader of bags does."""
    ns = arrived.start_ns + np.rint(arrived.t * 1e9).astype(np.int64)
    done = arrange(ns, arrived.omega_ib_b, arrived.f_ib_b, "/imu/data_raw")
    start = origin_ns(ns[done.rows])
    phase = arrived.phase
    if phase is not None:
        phase = replace(phase, t=phase.t + (arrived.start_ns - start) * 1e-9)
    return replace(
        arrived, start_ns=start, t=seconds(ns[done.rows], start), omega_ib_b=arrived.omega_ib_b[done.rows],
        f_ib_b=arrived.f_ib_b[done.rows], phase=phase, rejected=len(ns) - len(done.rows), notes=done.notes,
    )  # fmt: skip


@lru_cache(maxsize=2)
def _motion_of(plan: object, table: object) -> TableMotion:
    return table_motion(plan, table, 0)  # type: ignore[arg-type]


def _table_motion(scenario: Scenario) -> TableMotion:
    return _motion_of(scenario.plan, scenario.table)
