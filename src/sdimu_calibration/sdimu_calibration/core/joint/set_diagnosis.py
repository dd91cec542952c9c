"""What the model of a set misses: search, what is taken back, what comes back, verdict and advice, in this order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sdimu_calibration.core.advice import Advice, Kind
from sdimu_calibration.core.diagnosis.advice import adding, recorded_first
from sdimu_calibration.core.diagnosis.closing import Closing, closing_advice, next_recording
from sdimu_calibration.core.diagnosis.grades import LISTED, size
from sdimu_calibration.core.diagnosis.rounds import TO_AND_FRO
from sdimu_calibration.core.diagnosis.search import Search
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.references import LATITUDE, SEEN_AS_GRAVITY
from sdimu_calibration.core.evidence.known import Standing
from sdimu_calibration.core.joint.changed import is_change
from sdimu_calibration.core.joint.function_fit import unknown_functions
from sdimu_calibration.core.joint.function_search import searched
from sdimu_calibration.core.joint.leftovers import StopError
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.recurrence import Recurrence
from sdimu_calibration.core.joint.recurrence_words import listed, next_steps
from sdimu_calibration.core.joint.scope import split_tag
from sdimu_calibration.core.joint.set_evidence import SetEvidence, differences
from sdimu_calibration.core.joint.set_fit import Run, SetFit, SetOptions
from sdimu_calibration.core.joint.set_found import FunctionShare, SetSearch
from sdimu_calibration.core.joint.set_ladder import SetLadder, set_ladder
from sdimu_calibration.core.joint.set_result import SCATTERS, averaged, set_outcome
from sdimu_calibration.core.joint.set_search import SetRequest, place_of
from sdimu_calibration.core.joint.set_verdict import SetFacts, SetFinding, statements, verdict_of_set
from sdimu_calibration.core.noise_term import unexplained
from sdimu_calibration.core.plain_text import capital, first_of, listing
from sdimu_calibration.core.plan_search import Question
from sdimu_calibration.core.posterior.told import Probabilities, probabilities
from sdimu_calibration.core.posterior.unknown import UnknownFunction
from sdimu_calibration.core.probability import chi2_tail, in_percent
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.core.wording import Work


@dataclass(frozen=True)
class SetDiagnosis:
    """What was found in a set."""

    verdict: Verdict
    statements: tuple[str, ...]
    """The verdict for people: what was found by how sure it is, then what is left, and what comes back."""
    findings: tuple[SetFinding, ...]
    before: Calibration
    after: Calibration
    """`before`, `after`: with the model as given, and with what was found."""
    advice: tuple[Advice, ...]
    standing: Standing
    """What the set knows of the unit: what a plan for the next recording begins with."""
    first: Search[SetEvidence]
    """Of the first round, with every candidate beside the model as given."""
    recurrence: Recurrence | None
    """What comes back of that what the model leaves in the stops; None where it leaves nothing."""
    refused: tuple[SetFinding, ...] = ()
    """Effects that were found and taken back, as an unknown function of the attitude explains them."""
    ladder: SetLadder = field(default_factory=SetLadder)
    """Models from that as given to that with what was found in all recordings, in the noise of the last. By itself the
    model as given learns in each recording what it lacks as noise, and its own error hides it."""
    probabilities: Probabilities | None = None
    """Of nothing, and of each family of effects in all recordings, at the end of the search; None where it did not come
    to an end."""
    unknown: tuple[UnknownFunction, ...] = ()
    """The function of the attitude that explains what is left, at all stops; empty without one."""
    functions: tuple[FunctionShare, ...] = ()
    """How probable such a function is in all recordings, then in each alone; empty where none was looked for."""
    where: tuple[StopError, ...] = ()
    """What is left in each stop of the recordings, of many of some, without a function."""

    @property
    def function(self) -> float | None:
        """Probability that an unknown function of the attitude is in all recordings; None where none was looked for."""
        return next((one.probability for one in self.functions if one.is_common), None)

    @property
    def sentence(self) -> str:
        """The statements in one text."""
        return " ".join(self.statements)


def diagnose_set(
    members: Sequence[Member],
    options: SetOptions,
    run: Run,
    extra: Sequence[Effect] = (),
    progress: Progress = silent,
    fitted: SetFit | None = None,
) -> SetDiagnosis:
    """Find what the model of a set misses; parameters as for `SetRequest` and `search_set`."""
    if len(members) < 2:
        raise DataError(f"a set of one recording: diagnose it by itself ({Work.DIAGNOSE} BAG)")
    done = searched(members, SetRequest(options, run, tuple(extra), progress), fitted)
    progress("report", 0.95)
    found, again, without = done.found, done.again, done.without
    before, facts = set_outcome(found.before), _facts(found, again)
    tags = {f.tag for f in facts.findings}
    refused = () if without is None else tuple(f for f in _findings(without) if f.tag not in tags)
    why = _explained(again, found, [f.tag for f in refused]) if done.beside_function else ()
    word = verdict_of_set(facts)
    why = why if found.stood else (*why, f"{capital(TO_AND_FRO)}.")
    test = found.after.base.test
    standing = replace(found.standing, imu=test.origin.imu_file or found.standing.imu, site=test.origin.site_stated)
    steps = (
        _look_at(facts.functions)
        if facts.is_of_each
        else next_steps(again, word == Verdict.UNEXPLAINED, facts.beside_function)
    )
    kept = [] if word == Verdict.UNEXPLAINED else _added(found, facts.findings)
    return SetDiagnosis(
        word,
        (*statements(word, facts), *why),
        tuple(facts.findings),
        before,
        facts.after if found.stood else facts.after.warned(TO_AND_FRO),
        recorded_first((*kept, *_advice(word, facts.findings, _closing(found.after, standing), steps))),
        standing,
        found.first,
        again,
        refused,
        set_ladder(found, run),
        facts.told,
        unknown_functions(found.after) if facts.beside_function else (),
        done.functions,
        done.where,
    )


def _facts(found: SetSearch, again: Recurrence | None) -> SetFacts:
    """Put together what the verdict follows from: the estimate is that over all models where the search has an end."""
    after = set_outcome(found.after)
    after = averaged(after, found.after, found.posterior) if found.stood else after
    told = probabilities(found.posterior) if found.stood else None
    # In a single rest nothing changes that a cause could follow.
    moved = [(k, r) for k, r in enumerate(found.after.reports) if len(r.times.stops) > 1]
    own = {r.name: unexplained(found.drawn_in(k), r.fault_kinds, r.notes) for k, r in moved}
    drawn = {name: terms for name, terms in own.items() if terms}
    return SetFacts(_findings(found), after, found.after, again, told, found.told_functions, drawn)


def _explained(again: Recurrence | None, found: SetSearch, labels: Sequence[str]) -> tuple[str, ...]:
    """Say what an unknown function explains, and how likely it is; labels of one recording have its name behind."""
    names = [f"{name} in {recording}" if recording else name for name, recording in map(split_tag, labels)]
    common = next((one for one in found.told_functions if one.is_common), None)
    if common is None:
        return (f"Functions of single recordings also explain {', '.join(names)}: not told.",) if names else ()
    too = (f"It also explains {', '.join(names)}: not told.",) if names else ()
    of_what = "attitude" if again is None or again.apart or not again.answer else listed(again.answer, "or")
    # Where the search went to and fro no probabilities are told.
    share = f" ({in_percent(common.probability)})" if found.stood else ""
    where = f"{listing(common.sensors)}{share}"
    return (f"An unknown function of the {of_what} in {where}, the same in all recordings, explains it.", *too)


def _findings(found: SetSearch) -> tuple[SetFinding, ...]:
    names, recordings = list(found.after.names), [report.name for report in found.after.reports]
    # Those of one recording as differences from those of all others.
    T, estimate = differences(names), found.after.estimate
    values, sigma = T @ estimate.values, np.sqrt(np.diag(T @ estimate.covariance @ T.T))
    out = []
    for find in found.finds:
        one, place = find.candidate, place_of(names, find.candidate)
        label = split_tag(one.label)[0] if one.recording else one.label
        unit, shown = one.parameter.unit, one.parameter.display_unit
        out.append(
            SetFinding(
                *(label, one.recording, float(values[place]), float(sigma[place]), find.z, unit, shown),
                *(find.alike, find.probability, find.may_be, _against(label, one.recording, recordings), one.family),
            )
        )
    return tuple(out)


def _added(found: SetSearch, findings: Sequence[SetFinding]) -> list[Advice]:
    """Advise how what was found of the unit gets into its model: no wrong site."""
    keys = {c.label: c.added for c in found.chosen if c.family != LATITUDE.name}
    return adding([(f.label, keys[f.label], f.decided) for f in findings if f.label in keys and not f.recording])


def _against(label: str, recording: str, recordings: Sequence[str]) -> str:
    """Name the other one of two recordings for a change that is told of one; empty for all else."""
    others = [name for name in recordings if name != recording]
    return others[0] if recording and len(others) == 1 and is_change(label) else ""


def sites_to_check(findings: Sequence[SetFinding]) -> list[Advice]:
    """Advise to check the site of a recording in which the accelerometers' scale factors changed all alike."""
    out = []
    for recording in dict.fromkeys(f.recording for f in findings if f.recording and is_change(f.label)):
        own = [f for f in findings if f.recording == recording and f.label in SEEN_AS_GRAVITY]
        weight = np.array([f.sigma for f in own]) ** -2.0
        values = np.array([f.value for f in own])
        if len(own) < len(SEEN_AS_GRAVITY):
            continue
        mean = float(np.average(values, weights=weight))
        if chi2_tail(float(weight @ (values - mean) ** 2), len(own) - 1.0) > SCATTERS:
            share = size(mean, float(np.sum(weight)) ** -0.5, own[0].display_unit)
            out.append(Advice(Kind.LOOK_AT_SITE, (recording, share)))
    return out


def _closing(fit: SetFit, standing: Standing) -> Closing:
    """Find what to record next; nothing where there is no site."""
    test = fit.base.test
    if test.site is None:
        return []
    values = dict(zip(fit.names, fit.estimate.values.tolist(), strict=True))
    return next_recording(standing, Question(test.site, test.imu, fit.model), values)


def _of_recordings(findings: Sequence[SetFinding]) -> dict[tuple[str, str], str]:
    """List what each recording alone shows, by the recording and that against which it stands."""
    found: dict[tuple[str, str], list[str]] = {}
    for f in findings:
        if f.recording:
            found.setdefault((f.recording, f.against), []).append(f.label)
    return {place: first_of(labels, LISTED) for place, labels in found.items()}


def _look_at(functions: Sequence[FunctionShare]) -> list[Advice]:
    """Advise where to look for the cause of functions of single recordings."""
    if len(functions) > 1:
        return [Advice(Kind.LOOK_AT_MOUNT)]
    return [Advice(Kind.LOOK_AT_RECORDING, (functions[0].recording, "an error that follows the attitude"))]


def _advice(
    word: Verdict, findings: Sequence[SetFinding], closing: Closing, steps: Sequence[Advice]
) -> tuple[Advice, ...]:
    out = [*steps, *sites_to_check(findings)]
    closed = {members[0] for members, _ in closing}
    for (recording, against), labels in _of_recordings(findings).items():
        if against:
            out.append(Advice(Kind.RECORD_A_THIRD, (labels, against, recording)))
        else:
            out.append(Advice(Kind.LOOK_AT_RECORDING, (recording, labels)))
    out += [
        Advice(Kind.NO_PLAN_TELLS, (f.label, f.alike[0]))
        for f in findings
        if not f.recording and f.alike and f.label not in closed
    ]
    out += closing_advice(closing)
    if word == Verdict.CLASS_OF_EFFECTS and not findings:
        out.append(Advice(Kind.RECORD_MORE))
    if word == Verdict.UNEXPLAINED and not any(one.kind == Kind.LOOK_AT_RECORDING for one in steps):
        out.append(Advice(Kind.ONE_BY_ONE))
    return tuple(out)
