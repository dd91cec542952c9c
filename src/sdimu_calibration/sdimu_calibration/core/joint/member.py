"""The work on one recording of a set: open, fit, linearise about the estimate of the set, reduce."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.candidates import catalogue, without
from sdimu_calibration.core.diagnosis.measured_noise import measured_noise
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.effects.imu_model import told_apart
from sdimu_calibration.core.estimation.azimuth_words import NO_AZIMUTH
from sdimu_calibration.core.estimation.fit import Fit, Start
from sdimu_calibration.core.estimation.free_inertial import FreeInertialRun, OfOthers, navigation_with
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.noise_estimate import term_in_words
from sdimu_calibration.core.estimation.noise_learning import in_noise, noise_of
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO, fit_about, solve
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.handheld.run_rows import RunRows
from sdimu_calibration.core.joint.equation_share import EquationShare, asked, equation_share, name_of_candidate
from sdimu_calibration.core.joint.reduction import Reduction, reduced
from sdimu_calibration.core.joint.rival_noises import InOneNoise, rival_noises
from sdimu_calibration.core.joint.scope import is_local, tagged
from sdimu_calibration.core.joint.shared_function import SharedFunction, beside, noise_beside
from sdimu_calibration.core.joint.stretch_rows import Places, stretch_rows
from sdimu_calibration.core.noise_term import NoiseTerm, may_be_an_effect
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

_HEADING = 1e-3
"""Heading sigma (rad) from which a recording alone does not know its heading: five sigmas of it change how a
coefficient shows by half a percent."""


@dataclass(frozen=True)
class Member:
    """A recording of a set."""

    name: str
    """What the user calls the recording; no other of the set has it."""
    open: Callable[[], PreparedTest]
    """``() -> PreparedTest``; another process can call it too."""
    serial: str = ""
    power_on: str = ""
    """`serial`, `power_on`: of the unit, and from which switching-on; empty power-on: one of its own."""


@dataclass(frozen=True)
class Job:
    """What is to be done with a recording."""

    member: Member
    model: Model
    """With the effects that were found in all recordings."""
    estimator: str = AUTO
    local: tuple[str, ...] = ()
    """Keys of effects of this recording alone, in the model behind the others. What all have of them it has not: its
    own value stands in the place of theirs."""
    candidates: tuple[str | Effect, ...] = ()
    """Effects whose signatures are wanted."""
    with_local: bool = False
    """Also those of effects that are of one recording."""
    about: Mapping[str, float] | None = None
    """Coefficients of the estimator (SI), by name, about which the rows are linear; None is the recording's own fit."""
    imu: ImuSpecification | None = None
    """With the noise that the recording shows, where it is known."""
    start: Start | None = None
    """Where an earlier fit of the recording ended: gives the attitude."""
    noise: tuple[NoiseTerm, ...] | None = None
    """Noise with a memory, where it is known; None learns it."""
    scatter: Floats | None = None
    """Of a run by hand, sigmas beyond white noise that the set tells, shape (3,); None learns them."""
    stretches: bool = False
    """Signatures of an error of each sensor in each dwell and turn, in place of candidates."""
    function: SharedFunction | None = None
    """Whose weights are coefficients, too; noise is learned beside them."""
    rivals: bool = False
    """Also what the recording says in each noise that it may have."""
    others: tuple[OfOthers, ...] = ()
    """Coefficients with which the recording is navigated without aid, in place of candidates."""
    equations: tuple[str, ...] | None = None
    """Coefficients that were told, beside which the recording says what it holds of equations; None: nothing."""

    @property
    def of_fit(self) -> str:
        """All that the fit of the recording follows from, but for the recording; equal for equal fits."""
        start, function = self.start, self.function
        asked = (
            *(self.model, self.estimator, self.local, self.imu, self.noise),
            None if self.about is None else sorted(self.about.items()),
            None
            if start is None
            else (start.names, start.coefficients.tobytes(), start.C_nb.tobytes(), start.more.tobytes()),
            None if self.scatter is None else self.scatter.tobytes(),
            None
            if function is None
            else (function.functions.knots.tobytes(), function.sensors, sorted(function.size.items())),
        )
        return repr(asked)


@dataclass(frozen=True)
class Report:
    """What a recording says."""

    name: str
    serial: str
    power_on: str
    reduction: Reduction
    """Coefficients and candidates of this recording alone have its name behind theirs."""
    estimator: str
    reason: str
    """`estimator`, `reason`: and why it was taken."""
    imu: ImuSpecification
    """With the noise that the recording shows."""
    start: Start
    """Where the fit ended."""
    start_ns: int
    times: Timetable
    temperature_degc: float
    """Mean; NaN where it is not recorded."""
    data: Mapping[str, float]
    """As in a result."""
    statistics: FitStatistics
    names: tuple[str, ...]
    """Coefficients as reported, length p."""
    values: Floats
    sigma: Floats
    """`values`, `sigma`: shape (p,). Of the recording's own fit (SI), in the frame of the report; empty for a fit about
    given coefficients."""
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())
    heading_rad: float = 0.0
    """Sigma of the heading at the end of the recording's own fit (rad); 0 where none is estimated."""
    noise: tuple[NoiseTerm, ...] = ()
    """Noise with a memory that was learned."""
    widened: bool = False
    """The recording alone contradicts priors of the IMU file."""
    places: Places | None = None
    """Of its dwells and turns, where they were asked for."""
    site: Site | None = None
    rivals: tuple[InOneNoise, ...] = ()
    """What it says in each noise that it may have, where it was asked for; empty for a run by hand, which learns its
    scatter instead."""
    by_hand: RunRows | None = None
    """Equations of a run by hand, from which the set learns the scatter."""
    scatter: Floats | None = None
    """That of the set in which the rows are, shape (3,); None is the run's own."""
    fault_kinds: tuple[str, ...] = ()
    """Kinds of the faults of the recording, as of `DataFault`."""
    in_use: FreeInertialRun | None = None
    """Navigations without aid, where they were asked for and the recording is long enough."""
    equations: EquationShare | None = None
    """What it says of equations, where that was asked for."""

    @property
    def stands_alone(self) -> bool:
        """Whether the recording's own fit is a place about which the recording is linear."""
        return len(self.values) > 0 and self.heading_rad < _HEADING and not self.widened

    @property
    def has_temperature(self) -> bool:
        """Whether the recording has a temperature."""
        return bool(np.isfinite(self.temperature_degc))


def run(job: Job) -> Report:
    """Do a job."""
    try:
        return _report(job, fitted(job))
    except DataError as error:
        raise DataError(f"{job.member.name}: {error}") from error


def tried(job: Job) -> Report | DataError:
    """Do a job; give the reason where the recording cannot be used."""
    try:
        return run(job)
    except DataError as error:
        return error


def fitted(job: Job) -> Fit:
    """Fit the recording of a job; where the last job of it asked for the same fit, that one."""
    test = job.member.open()
    return test.last(job.of_fit, lambda: _fitted(job, test))


def _fitted(job: Job, test: PreparedTest) -> Fit:
    model = replace(job.model, effects=(*_of_all(job.model.effects, job), *job.local))
    if job.imu is not None:
        test = test.with_imu(job.imu)
    test = replace(test, scatter=job.scatter)
    if job.about is None or test.why_handheld or job.estimator == HandheldFit.estimator:
        # A run by hand is fitted anew: its attitudes are parameters, and a least squares about others is no nearer.
        return _own(test, model, job)
    fit = fit_about(test, model, _untagged(job.about, job.member.name), job.start)
    if job.noise:
        return in_noise(fit, job.noise, wander_in(fit.bare, job.noise), held_out=False)
    learned = noise_of(fit) if job.noise is None and not job.function else ()
    return in_noise(fit, learned) if learned else fit


def _of_all(effects: Sequence[str | Effect], job: Job) -> tuple[str, ...]:
    """Leave out of effects that all recordings have what this one has for itself."""
    own = {label for key in job.local for label in selection.resolve(key).labels}
    kept: list[str | Effect] = []
    for effect in effects:
        whole = asked(effect)
        kept += [effect] if own.isdisjoint(whole.labels) else map(name_of_candidate, without(whole, own))
    return cast("tuple[str, ...]", tuple(kept))


def _own(test: PreparedTest, model: Model, job: Job) -> Fit:
    """Fit the recording by itself, in the white noise that it shows."""
    fit = solve(test, model, job.estimator)
    noise, imu = measured_noise(fit.consistency(), fit)
    if not noise or job.imu is not None:
        return fit
    return replace(solve(test.with_imu(imu), model, fit.estimator), reason=fit.reason)


def _untagged(about: Mapping[str, float], name: str) -> dict[str, float]:
    """Coefficients of this recording alone by the names that its model has for them."""
    end = tagged("", name)
    return {key.removesuffix(end): value for key, value in about.items()}


def _report(job: Job, fit: Fit) -> Report:
    name, recording = job.member.name, fit.test.recording
    tried_in_all = _of_all(job.candidates, job)
    shared = [asked(e) for e in tried_in_all]
    own = _local_candidates(fit) if job.with_local else []
    rivals: tuple[InOneNoise, ...] = ()
    terms = fit.noise_terms
    if job.stretches:
        found, places = stretch_rows(fit)
    else:
        evidence, terms = _with_function(fit.evidence([*shared, *own]), fit, job)
        weighed = job.rivals and fit.estimator != HandheldFit.estimator
        wander = wander_in(evidence, terms) if weighed or terms else None
        found, places = reduced(evidence, terms, wander), None
        beside = () if job.function is None else job.function.sensors
        rivals = rival_noises(evidence, wander, beside) if weighed and wander else ()
    log = recording.temperature
    rows = _named(found, job, shared)
    return Report(
        name,
        job.member.serial,
        job.member.power_on,
        rows,
        fit.estimator,
        fit.reason,
        fit.test.imu,
        fit.start,
        recording.start_ns,
        fit.timetable,
        float("nan") if log is None or not len(log.t) else float(np.mean(log.value)),
        fit.data_counts(),
        _statistics(fit, job),
        fit.names,
        fit.values if job.about is None else np.empty(0),
        np.sqrt(np.diag(fit.covariance)) if job.about is None else np.empty(0),
        (*recording.notes, *map(term_in_words, terms), *((NO_AZIMUTH,) if fit.azimuth_free else ())),
        tuple(f.text for f in fit.faults if f.grave),
        _heading(fit),
        terms,
        _widened(fit),
        places,
        fit.test.site,
        tuple(replace(one, names=(*rows.names, *rows.labels)) for one in rivals),
        _equations(fit, job),
        job.scatter,
        tuple(dict.fromkeys(f.kind for f in fit.faults)),
        _in_use(fit, job),
        None if job.equations is None else equation_share(fit, job.equations),
    )


def _in_use(fit: Fit, job: Job) -> FreeInertialRun | None:
    """Navigate the recording with what others tell of the unit; None where that was not asked for, or cannot be."""
    if not job.others or not isinstance(fit, NavigationFit):
        return None
    try:
        return replace(navigation_with(fit, job.others), recording=job.member.name)
    except DataError:
        return None


def _with_function(evidence: LinearEvidence, fit: Fit, job: Job) -> tuple[LinearEvidence, tuple[NoiseTerm, ...]]:
    """Put the function of a job into the model of an evidence; that, and the noise beside it."""
    if job.function is None or not isinstance(fit, NavigationFit):
        return evidence, fit.noise_terms
    wide = beside(evidence, job.function)
    return wide, fit.noise_terms if job.noise is not None else noise_beside(wide, fit.wander.in_white)


def _equations(fit: Fit, job: Job) -> RunRows | None:
    """Equations of a run by hand in the names of the set."""
    if not isinstance(fit, HandheldFit):
        return None
    rows, local = fit.rows(), _local_names(job)
    return replace(rows, names=tuple(tagged(n, job.member.name) if n in local else n for n in rows.names))


def _statistics(fit: Fit, job: Job) -> FitStatistics:
    """State how well the recording is fitted; where its noise may be a missing effect, how well without that, too."""
    white = fit.statistics()
    looked_at = not (job.candidates or job.stretches or job.function)
    return replace(white, held_out_rms=fit.held_out_rms()) if looked_at and may_be_an_effect(fit.noise_terms) else white


def _heading(fit: Fit) -> float:
    """Sigma of the heading at the end (rad); 0 where none is estimated."""
    sigma = fit.history().attitude_sigma
    return float(sigma[-1, 2]) if len(sigma) else 0.0


def _widened(fit: Fit) -> bool:
    """Whether a fit widened priors that its data contradict."""
    if not isinstance(fit, NavigationFit):
        return False
    sensors = fit.setup.sensors
    return bool(np.any(sensors.prior > sensors.stated))


def _local_candidates(fit: Fit) -> list[Effect]:
    """Effects of one recording or power-on that its model lacks."""
    return [e for e in catalogue(fit.timetable, set(fit.labels), fit.has_temperature) if is_local(e)]


def _named(found: Reduction, job: Job, shared: Sequence[Effect]) -> Reduction:
    """Put the name of the recording behind what is of the recording alone."""
    name = job.member.name
    local = _local_names(job)
    count = sum(len(effect.parameters) for effect in shared)
    labels = tuple(label if k < count else tagged(label, name) for k, label in enumerate(found.labels))
    return replace(found, names=tuple(tagged(n, name) if n in local else n for n in found.names), labels=labels)


def _local_names(job: Job) -> set[str]:
    """Names that the model of a job has for coefficients of its recording alone.

    Beside another variant that all recordings have it is not the plain one.
    """
    shared = _of_all(job.model.effects, job)
    effects = told_apart([selection.resolve(e) for e in (*shared, *job.local)])
    return {p.name for effect in effects[len(shared) :] for p in effect.parameters}
