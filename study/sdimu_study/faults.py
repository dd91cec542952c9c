"""Faults in the data: every kind at every size; no test with one may end silently wrong."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from rate_table_sim.core import phase_changes
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.arrival import RawStatus, RawTemperature, RawTest, in_order
from sdimu_calibration.core.data.gaps import LINEAR_RAD
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model
from sdimu_sim.core.generator import simulate_imu
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_study.fault_kinds import FAULTS, Fault
from sdimu_study.study import Row, Study, Table, head
from sdimu_study.worlds import motion_of, true_values

OK, NOTED, WARNED, REFUSED, WRONG, TRACEBACK = "ok", "noted", "warned", "refused", "SILENT WRONG", "traceback"
LIMIT = 5.0
"""Error in sigmas from which a result without a warning is wrong."""
_HURRY_RAD_S = float(np.radians(9.0))
_DWELL_S = 20.0


@dataclass(frozen=True)
class Outcome:
    """What became of a test with a fault."""

    fault: str
    size: float
    seed: int
    verdict: str
    """``ok`` (within `LIMIT`, nothing noted), ``noted`` (within it, and the data section names a fault), ``warned``
    (outside, and the result says that it is not to be trusted), ``refused`` (`DataError`), ``SILENT WRONG``,
    ``traceback``."""
    worst: float
    """Largest error in sigmas; NaN without a result."""
    said: tuple[str, ...]
    """What the result, or the refusal, says."""


@dataclass(frozen=True)
class FaultCase:
    """A fault of one size in the tests of a scenario."""

    scenario: Scenario
    model: Model
    fault: Fault
    size: float


@dataclass(frozen=True)
class Spoilt:
    """A test to be spoilt; whether it can be read at all is a part of the run."""

    case: FaultCase
    scenario: Scenario


def world(case: FaultCase, seed: int) -> Spoilt:
    """Give the test of a seed."""
    return Spoilt(case, replace(case.scenario, seed=seed))


def run(world: Spoilt) -> Calibration | Exception:
    """Simulate the test, spoil it, and calibrate it as from a bag."""
    scenario, case = world.scenario, world.case
    try:
        return calibrate(spoilt(scenario, case.fault, case.size), scenario.site, scenario.imu, case.model)
    except Exception as error:
        return error


def score(world: Spoilt, found: Calibration | Exception) -> Row:
    """Say what became of a test; the row is an `Outcome`."""
    return asdict(_outcome(world, found))


def _outcome(world: Spoilt, found: Calibration | Exception) -> Outcome:
    of = (world.case.fault.name, world.case.size, world.scenario.seed)
    if isinstance(found, DataError):
        return Outcome(*of, REFUSED, float("nan"), (str(found),))
    if isinstance(found, Exception):
        last = traceback.extract_tb(found.__traceback__)[-1]
        return Outcome(*of, TRACEBACK, float("nan"), (f"{found!r} at {last.name}:{last.lineno}",))
    worst = largest_error(world.scenario, found)
    inside = NOTED if found.notes else OK
    outside = WARNED if found.warnings else WRONG
    return Outcome(*of, inside if worst < LIMIT else outside, worst, found.notes)


STUDY = Study("faults", world, run, score)


def run_fault(scenario: Scenario, model: Model, fault: Fault, size: float, seed: int) -> Outcome:
    """Run one fault of a size in the test of a seed."""
    return Outcome(**STUDY.of(FaultCase(scenario, model, fault, size))(seed))


def fault_study(
    scenario: Scenario,
    model: Model,
    seeds: Iterable[int],
    faults: Iterable[Fault] = FAULTS,
    progress: Callable[[str, float], None] | None = None,
) -> list[Outcome]:
    """Run all kinds and sizes; `progress` is called with a word and the fraction done."""
    cases = [(fault, size, seed) for fault in faults for size in fault.sizes for seed in seeds]
    out = []
    for k, (fault, size, seed) in enumerate(cases):
        if progress is not None:
            progress(fault.name, k / len(cases))
        out.append(run_fault(scenario, model, fault, size, seed))
    return out


def hurried(plan: Plan) -> Plan:
    """Plan the same attitudes in ten minutes: dwells of 20 s and turns at 9 deg/s."""
    turns = tuple(replace(turn, rate_rad_s=_HURRY_RAD_S) for turn in plan.turns)
    return Plan(f"{plan.name} in a hurry", (_DWELL_S,) * len(plan.dwell_s), turns, _HURRY_RAD_S)


def largest_error(scenario: Scenario, result: Calibration) -> float:
    """Largest error of a coefficient in its sigma, of those the body frame does not make zero."""
    truth = true_values(imu_truth(scenario), result.names, result.body_frame)
    sigma = np.sqrt(np.diag(result.covariance))
    free = sigma > 1e-9 * np.array([scenario.imu.prior[n.rsplit("_", 1)[0]] for n in result.names])
    return float(np.max(np.abs(result.values - truth)[free] / sigma[free]))


def spoilt(scenario: Scenario, fault: Fault, size: float) -> Recording:
    """Make the recording of a scenario with a fault in it, as the reader of bags would give it."""
    rng = np.random.default_rng([scenario.seed, *fault.name.encode()])
    motion = motion_of(scenario.plan, scenario.table)
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

    def stamps(t: Floats) -> Ints:
        return arrived.start_ns + np.rint(t * 1e9).astype(np.int64)

    phase, heat = arrived.phase, arrived.temperature
    return in_order(
        RawTest(
            stamps(arrived.t),
            arrived.omega_ib_b,
            arrived.f_ib_b,
            None if phase is None else RawStatus(stamps(phase.t), phase.dwell, phase.stop),
            None if heat is None else RawTemperature(stamps(heat.t), heat.value),
        )
    )


def cell(outcomes: Sequence[Outcome]) -> str:
    """One cell of the table: verdicts of the seeds, and the largest error in sigmas."""
    counts = {verdict: [o.verdict for o in outcomes].count(verdict) for verdict in {o.verdict for o in outcomes}}
    text = ", ".join(f"{v} {n}" if len(counts) > 1 else v for v, n in sorted(counts.items(), key=lambda c: -c[1]))
    worst = [o.worst for o in outcomes if np.isfinite(o.worst)]
    return f"{text} ({max(worst):.2g})" if worst else text


def table(outcomes: Sequence[Outcome]) -> list[tuple[str, str, list[str]]]:
    """Rows of name, what it is with its unit, and five cells ``size: verdicts (largest error)``."""
    rows = []
    for fault in FAULTS:
        mine = [o for o in outcomes if o.fault == fault.name]
        if mine:
            cells = [f"{size:g}: {cell([o for o in mine if o.size == size])}" for size in fault.sizes]
            rows.append((fault.name, f"{fault.what} ({fault.unit})", cells))
    return rows


def totals(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """How many of each verdict, `OK` first."""
    verdicts = sorted({o.verdict for o in outcomes}, key=lambda v: (v != OK, v))
    return {verdict: sum(o.verdict == verdict for o in outcomes) for verdict in verdicts}


def content(outcomes: Sequence[Outcome]) -> dict[str, object]:
    """Everything for a JSON file."""
    return {"totals": totals(outcomes), "runs": [asdict(o) for o in outcomes]}


def page(outcomes: Sequence[Outcome]) -> str:
    """Make the page, doc/faults.md: how each fault is met, and the table of the study."""
    above = head(
        "faults",
        limit=LIMIT,
        linear=LINEAR_RAD * 1e3,
        runs=len(outcomes),
        totals=", ".join(f"{n} {verdict}" for verdict, n in totals(outcomes).items()),
        seeds=", ".join(map(str, sorted({o.seed for o in outcomes}))),
    )
    return above + Table(("fault", *[""] * 5), [(what, *cells) for _, what, cells in table(outcomes)]).markdown()
