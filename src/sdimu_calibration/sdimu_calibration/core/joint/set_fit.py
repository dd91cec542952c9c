"""A joint fit of all recordings of a set, linearised again about its own estimate until it stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.accelerometer_frame import are_large
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.solve import AUTO
from sdimu_calibration.core.filter.solution import MOST_WIDENINGS
from sdimu_calibration.core.joint.combine import Combination, Component, JointEstimate, Rows, spread_out, stacked
from sdimu_calibration.core.joint.joint_prior import prior_weight, widened
from sdimu_calibration.core.joint.member import Job, Member, Report, fitted
from sdimu_calibration.core.joint.same_unit import check_one_unit
from sdimu_calibration.core.joint.scope import by_name, split_tag, tagged, varying_effects
from sdimu_calibration.core.joint.set_order import (
    check_different,
    check_members,
    check_one_grade,
    check_one_site,
    in_order,
)
from sdimu_calibration.core.joint.shared_function import SharedFunction, is_weight
from sdimu_calibration.core.joint.shared_scatter import shared_scatter
from sdimu_calibration.core.joint.turn_on import in_scatter, turn_on_scatter
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import TurnOn
from sdimu_calibration.core.specification import Model

Run = Callable[[Sequence[Job]], Sequence[Report | DataError]]
"""Does jobs, in any process; in the order of the jobs a report, or why there is none."""
_FAR = 5.0
"""Distance of the joint estimate from where a recording was linearised (sigmas of that recording alone) from which it
is linearised again, where squares of errors do not count: the rows then change by less than their rounding."""
_NEAR = 2.0
"""The same where squares count, or a recording does not know its heading (sigmas of the joint estimate): what is left
of the squares is then below the sigma."""
_MOST_ROUNDS = 6
"""Number of linearisations at most: where recordings know their heading the second already moves the estimate by less
than a sigma."""


@dataclass(frozen=True)
class SetFit:
    """A joint fit."""

    members: tuple[Member, ...]
    """Those that could be used, in the order of `reports`."""
    model: Model
    local: Mapping[str, tuple[str, ...]]
    """By recording, the keys of effects of this recording alone."""
    varying: Mapping[str, tuple[str, ...]]
    """Effects that differ from power-on to power-on, with their coefficients."""
    reports: tuple[Report, ...]
    """By start and samples, whatever the order in which they were named and their names: so are all digits."""
    names: tuple[str, ...]
    """Coefficients of the estimator, then those of single recordings, length P."""
    estimate: JointEstimate
    weight: Floats
    """Prior information of the coefficients (1/SI^2), of those that contradict their prior in the wider one,
    shape (P,)."""
    turn_on: tuple[TurnOn, ...]
    """Empty with one power-on."""
    left_out: tuple[tuple[str, str], ...] = ()
    """Recordings that could not be used, and why."""
    asked: tuple[str, ...] = ()
    """Names of the recordings in the order of the user."""
    function: SharedFunction | None = None
    """Unknown function of the attitude beside which the estimate stands."""
    unit_doubt: str = ""
    """Which recording may be of another unit; empty where the data tell that none is."""

    @cached_property
    def power_ons(self) -> tuple[str, ...]:
        """Names of the power-ons, in the order of their first recordings."""
        return tuple(dict.fromkeys(map(power_on, self.reports)))

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Places of the reports of each power-on."""
        own = [power_on(r) for r in self.reports]
        return tuple(tuple(k for k, name in enumerate(own) if name == one) for one in self.power_ons)

    @cached_property
    def shown(self) -> tuple[int, ...]:
        """Places of the reports as tables list them: by start, those of one start in the order of the user."""

        def place(k: int) -> tuple[int, int]:
            return self.reports[k].start_ns, self.asked.index(self.reports[k].name)

        return tuple(sorted(range(len(self.reports)), key=place))

    @property
    def tau(self) -> Floats:
        """Sigma of each component that varies.

        Returns
        -------
        ndarray, shape (c,)
            SI.
        """
        return np.array([t.sigma for t in self.turn_on])

    @property
    def varying_names(self) -> tuple[str, ...]:
        """Coefficients that vary, in the order of the columns of `estimate.deviation`."""
        return tuple(n for effect in self.varying.values() for n in effect) if self.turn_on else ()

    @cached_property
    def base(self) -> Fit:
        """Fit of one recording about the joint estimate: it gives the names and the frame of the report."""
        by_name = {m.name: m for m in self.members}
        # The last of those with most stops: the frame needs a recording that shows much, and one is as good as another.
        report = max(reversed(self.reports), key=lambda r: len(r.times.stops))
        return fitted(job_of(by_name[report.name], SetOptions(self.model), self))

    @property
    def has_own_functions(self) -> bool:
        """Whether recordings have functions of the attitude of their own in it."""
        return any(is_weight(name) and split_tag(name)[1] for name in self.names)

    def values_of(self, report: Report) -> dict[str, float]:
        """Coefficients (SI) of the estimator in one recording, deviations of its power-on included, by name."""
        values = dict(zip(self.names, self.estimate.values.tolist(), strict=True))
        row = self.power_ons.index(power_on(report))
        for name, deviation in zip(self.varying_names, self.estimate.deviation[row].tolist(), strict=True):
            values[name] += deviation
        return {n: v for n, v in values.items() if split_tag(n)[1] in {"", report.name} and not is_weight(n)}


def power_on(report: Report) -> str:
    """Power-on of a recording; its own where none is stated."""
    return report.power_on or f"that of {report.name}"


@dataclass(frozen=True)
class SetOptions:
    """How a set is to be fitted."""

    model: Model
    estimator: str = AUTO
    local: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """By recording, keys of effects in it alone."""
    scopes: Mapping[str, str] = field(default_factory=dict)
    """``unit`` or ``power-on`` for effects whose scope is not that of their trait."""


def fit_set(
    members: Sequence[Member], options: SetOptions, run: Run, before: SetFit | None = None, progress: Progress = silent
) -> SetFit:
    """Fit all recordings of a set together.

    Parameters
    ----------
    members : sequence of Member
        Recordings of one unit.
    run : callable
        Does the jobs.
    before : SetFit, optional
        Of the same members with nearly the same model: the recordings are linearised about it.
    """
    check_members(members)
    if options.model.priors:
        raise DataError(
            f"priors.{options.model.priors[0].name}: a set takes the priors of the IMU's file alone: leave them out of "
            "the model"
        )
    effects = cast("tuple[str, ...]", tuple(by_name(e) for e in options.model.effects))
    options = replace(options, model=replace(options.model, effects=effects))
    progress("recordings", 0.1)
    jobs = [_first_job(member, options, before) for member in members]
    in_white = {job.member.name for job in jobs if job.noise == ()}
    done = run(jobs)
    left = {job.member.name: _why(job.member, d) for job, d in zip(jobs, done, strict=True) if isinstance(d, DataError)}
    earlier = {r.name: r for r in (before.reports if before else ())}
    reports = [with_own(d, earlier.get(d.name)) for d in done if not isinstance(d, DataError)]
    if not reports:
        first, why = next(iter(left.items()))
        raise DataError(f"no recording of the set can be used: {first}: {why}")
    reports = in_order(reports)
    check_different(reports)
    check_one_grade(reports)
    check_one_site(reports)
    doubt = check_one_unit(reports) if before is None else before.unit_doubt
    _check_one_frame(options.model, reports)
    firm, late = [r for r in reports if r.stands_alone], {}
    if firm and before is None:
        # Where a recording alone may end is no place to linearise it; what the others know of the unit is.
        late = {r.name: r for r in reports if not r.stands_alone}
        left |= dict.fromkeys(late, "")
        reports = firm
    function = None if before is None else before.function
    fit = _combined(members, options, reports, function)
    for turn in range(_MOST_ROUNDS):
        progress("joint fit", 0.5 + 0.1 * turn)
        again = [m for m in members if m.name in left or _moved(fit, m.name)]
        if not again:
            break
        jobs = [job_of(member, options, fit, reports[0].estimator, learn=False) for member in again]
        fresh = run([replace(j, imu=late[j.member.name].imu) if j.member.name in late else j for j in jobs])
        came = {m.name: d for m, d in zip(again, fresh, strict=True) if not isinstance(d, DataError)}
        lost = {m.name: _why(m, d) for m, d in zip(again, fresh, strict=True) if isinstance(d, DataError)}
        stuck = set(lost) <= set(left) and not came
        left = lost
        kept = {r.name: with_own(came.get(r.name, r), r) for r in fit.reports}
        reports = [kept.get(m.name) or came[m.name] for m in members if m.name in kept or m.name in came]
        fit = _combined(members, options, reports, function)
        if stuck:
            break
    if left and len(fit.reports) < 2:
        why = "; ".join(f"{name} is left out: {text}" for name, text in left.items())
        raise DataError(f"only one of {len(members)} recordings can be used: mend or omit the others ({why})")
    fit = _in_shared_scatter(fit, options, run)
    waiting = {*late, *in_white} - {*left}
    if waiting:
        # In white noise until now: the point stands.
        fit = _renewed(fit, [job_of(m, options, fit) for m in fit.members if m.name in waiting], run)
    return replace(fit, left_out=tuple(left.items()), unit_doubt=doubt)


def _first_job(member: Member, options: SetOptions, before: SetFit | None) -> Job:
    """Make the job of a recording with which a fit begins: in white noise until the point stands."""
    # About a point that lacks what is new in the model noise takes up what that leaves, and the point stays.
    job = job_of(member, options, before)
    by_itself = job.about is None or job.estimator == HandheldFit.estimator
    return job if by_itself else replace(job, noise=())


def _renewed(fit: SetFit, jobs: Sequence[Job], run: Run) -> SetFit:
    """Return the fit with the rows that jobs give; a recording whose job fails keeps its own, as those without one."""
    fresh = {job.member.name: d for job, d in zip(jobs, run(jobs), strict=True) if not isinstance(d, DataError)}
    return with_reports(fit, [with_own(fresh.get(r.name, r), r) for r in fit.reports])


def _in_shared_scatter(fit: SetFit, options: SetOptions, run: Run) -> SetFit:
    """Let runs by hand learn their scatter together, and fit each in it."""
    runs = {r.name: r.by_hand for r in fit.reports if r.by_hand is not None}
    varying = [n for names in fit.varying.values() for n in names] if len(fit.power_ons) > 1 else []
    own = {r.name: {n: tagged(n, power_on(r)) for n in varying} for r in fit.reports}
    found = shared_scatter(runs, dict(zip(fit.names, fit.weight.tolist(), strict=True)), own)
    jobs = [
        replace(job_of(member, options, fit), scatter=found.get(r.name), noise=())
        for member, r in zip(fit.members, fit.reports, strict=True)
        if r.name in runs and not _same(r.scatter, found.get(r.name))
    ]
    return _renewed(fit, jobs, run) if jobs else fit


def _same(one: Floats | None, other: Floats | None) -> bool:
    """Whether two scatters are the same, or both a run's own."""
    return one is other if one is None or other is None else bool(np.array_equal(one, other))


def _why(member: Member, error: DataError) -> str:
    """Say why a recording cannot be used, without its name."""
    return str(error).removeprefix(f"{member.name}: ")


def job_of(member: Member, options: SetOptions, about: SetFit | None, estimator: str = "", learn: bool = True) -> Job:
    """Make the job of a recording.

    Parameters
    ----------
    about : SetFit or None
        Estimate about which the recording is linearised; None is its own fit.
    estimator : str
        In place of that of the options.
    learn : bool
        Learn the noise anew; else that of the report is kept, as about a point that is still wrong the noise would
        take up what the point leaves.
    """
    local = tuple(options.local.get(member.name, ()))
    if about is None:
        return Job(member, options.model, estimator or options.estimator, local)
    report = next((r for r in about.reports if r.name == member.name), None)
    if report is None:
        values = dict(zip(about.names, about.estimate.values.tolist(), strict=True))
        estimator = estimator or about.reports[0].estimator
        return Job(member, options.model, estimator, local, about=values, noise=(), function=about.function)
    job = Job(member, options.model, report.estimator, local, imu=report.imu, function=about.function)
    if local != tuple(about.local.get(member.name, ())):
        # What is new in it alone may be far outside its prior, which its own fit widens: else noise takes the rest.
        return job
    noise = None if learn else report.noise
    return replace(job, about=about.values_of(report), start=report.start, noise=noise, scatter=report.scatter)


def asked_again(fit: SetFit, run: Run, places: Sequence[int] | None = None, **wanted: Any) -> list[Report]:
    """Ask recordings for other rows about the joint estimate, in the noise that they have.

    Parameters
    ----------
    places : sequence of int, optional
        Of the reports that are asked, all without; the others stay as they are.
    wanted : object
        What a `Job` has besides.
    """
    options, asked = SetOptions(fit.model, local=fit.local), range(len(fit.reports)) if places is None else places
    jobs = [replace(job_of(fit.members[k], options, fit, learn=False), **wanted) for k in asked]
    reports = list(fit.reports)
    for k, fresh in zip(asked, run(jobs), strict=True):
        if isinstance(fresh, DataError):
            raise fresh
        reports[k] = with_own(fresh, fit.reports[k])
    return reports


def with_own(fresh: Report, old: Report | None) -> Report:
    """Keep what a recording's own fit says beside rows about other coefficients: its values, and priors it widened.

    How well it is fitted is said without a function that all recordings share.
    """
    if old is None or len(fresh.values):
        return fresh
    own = old.reduction
    known = {n: w for n, w in zip(own.names, own.weight.tolist(), strict=True) if not is_weight(n)}
    rows = fresh.reduction.in_prior(known)
    if any(map(is_weight, rows.names)):
        fresh = replace(fresh, statistics=old.statistics)
    return replace(
        fresh, reduction=rows, values=old.values, sigma=old.sigma, heading_rad=old.heading_rad, widened=old.widened
    )


def _check_one_frame(model: Model, reports: Sequence[Report]) -> None:
    """Refuse runs by hand beside recordings on a table where the model leaves these in another frame."""
    by_hand = [r.estimator == HandheldFit.estimator for r in reports]
    labels = {label for effect in model.effects for label in resolve(effect).labels}
    turns = model.body_frame == body_frame.FRAMES[0] and set(body_frame.pinned_names()) <= labels
    if any(by_hand) and not all(by_hand) and not turns:
        raise DataError(
            "recordings by hand and on a table share the accelerometers' frame alone: add accel_misalignment to the "
            f"model, and leave body_frame at {body_frame.FRAMES[0]}"
        )


def joint_names(reports: Sequence[Report]) -> tuple[str, ...]:
    """Coefficients that all recordings share, in their order, then those of single ones, then weights of a function."""
    every = dict.fromkeys(n for r in reports for n in r.reduction.names)
    names = [n for n in every if not is_weight(n)]
    shared = [n for n in names if not split_tag(n)[1]]
    return (*shared, *(n for n in names if split_tag(n)[1]), *(n for n in every if is_weight(n)))


def grouped_rows(reports: Sequence[Report], names: Sequence[str]) -> list[Rows]:
    """Rows of every power-on in the parameters of the set, in the order of their first recordings."""
    groups: dict[str, list[Rows]] = {}
    for report in reports:
        groups.setdefault(power_on(report), []).append(spread_out(report.reduction, names))
    return [stacked(rows) for rows in groups.values()]


def columns_of(varying: Mapping[str, tuple[str, ...]], names: Sequence[str]) -> list[Component]:
    """Components of the random effects at their places among the parameters of the set."""

    def places(own: Sequence[str]) -> Ints:
        return np.array([list(names).index(n) for n in own], dtype=np.int64)

    return [Component(effect, places(own)) for effect, own in varying.items()]


def _combined(
    members: Sequence[Member], options: SetOptions, reports: Sequence[Report], function: SharedFunction | None
) -> SetFit:
    reports = in_order(reports)
    names = joint_names(reports)
    varying = varying_effects(options.model, options.scopes, names)
    estimate, weight, turn_on = _estimated(reports, names, varying)
    by_name = {m.name: m for m in members}
    return SetFit(
        tuple(by_name[r.name] for r in reports),
        options.model,
        dict(options.local),
        varying,
        tuple(reports),
        names,
        estimate,
        weight,
        turn_on,
        asked=tuple(by_name),
        function=function,
    )


def _estimated(
    reports: Sequence[Report], names: tuple[str, ...], varying: Mapping[str, tuple[str, ...]]
) -> tuple[JointEstimate, Floats, tuple[TurnOn, ...]]:
    """Estimate, prior information of the coefficients, and scatter of what differs from power-on to power-on."""
    groups = grouped_rows(reports, names)
    components = columns_of(varying, names) if len(groups) > 1 else []
    weight = prior_weight(reports, names)
    estimate, turn_on = _in_prior(groups, weight, components)
    for _ in range(MOST_WIDENINGS):
        wider = widened(weight, names, estimate.values, estimate.covariance)
        if wider is weight:
            break
        weight = wider
        estimate, turn_on = _in_prior(groups, weight, components)
    return estimate, weight, turn_on


def _in_prior(
    groups: Sequence[Rows], weight: Floats, components: Sequence[Component]
) -> tuple[JointEstimate, tuple[TurnOn, ...]]:
    combined = Combination(groups, weight, components)
    turn_on = turn_on_scatter(combined)
    return in_scatter(combined, turn_on), turn_on


def with_reports(fit: SetFit, reports: Sequence[Report]) -> SetFit:
    """Return the fit to other rows of the same recordings.

    Parameters
    ----------
    reports : sequence of Report
        In the order of its own.
    """
    names = joint_names(reports)
    estimate, weight, turn_on = _estimated(reports, names, fit.varying)
    return replace(fit, reports=tuple(reports), names=names, estimate=estimate, weight=weight, turn_on=turn_on)


def _moved(fit: SetFit, name: str) -> bool:
    """Whether a recording was linearised too far from the joint estimate."""
    report = next((r for r in fit.reports if r.name == name), None)
    if report is None or report.estimator == HandheldFit.estimator:
        return False
    values, own = fit.values_of(report), report.reduction
    # Weights of a function are linear anywhere.
    kept = [k for k, n in enumerate(own.names) if not is_weight(n)]
    far = np.abs(np.array([values[own.names[k]] for k in kept]) - own.point[kept])
    if are_large(own.names, own.weight) or not report.stands_alone:
        places = [fit.names.index(own.names[k]) for k in kept]
        sigma = np.sqrt(np.diag(fit.estimate.covariance)[places])
        return bool(np.any(far > _NEAR * sigma))
    p = len(own.names)
    sigma = np.sqrt(np.diag(Combination([Rows(own.A[:, :p], own.y)], own.weight, []).estimate(np.empty(0)).covariance))
    return bool(np.any(far > _FAR * sigma[kept]))
