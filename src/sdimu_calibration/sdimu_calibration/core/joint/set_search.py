"""What does the model of a set miss? The search of one recording, on the evidence of all of them.

An effect that is the same in all recordings, a fault of the data of one, a drift of one power-on, a coefficient that is
another one in one recording: each is a candidate, and all are weighed in one posterior. What was chosen is a candidate
again in the next round, about the fit that has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.candidates import catalogue, without
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Search, search, with_steps
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.joint.changed import change_of, stable_effects, with_changes
from sdimu_calibration.core.joint.equation_share import name_of_candidate
from sdimu_calibration.core.joint.function_fit import in_size, with_function, with_own_functions
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.scope import by_name, is_shared, split_tag, tagged
from sdimu_calibration.core.joint.set_board import SetBoard
from sdimu_calibration.core.joint.set_evidence import SetEvidence, set_evidence
from sdimu_calibration.core.joint.set_fit import Run, SetFit, SetOptions, asked_again, fit_set, with_reports
from sdimu_calibration.core.joint.set_found import Find, SetSearch, following, likeliest_alone, of_one_recording
from sdimu_calibration.core.joint.set_standing import set_standing
from sdimu_calibration.core.posterior.posterior import PROBABLE, Posterior
from sdimu_calibration.core.posterior.told import Share, may_be, of_coefficients
from sdimu_calibration.core.progress import Progress, silent

_MOST_ROUNDS = 12
"""Number of rounds at most: strong effects take one each, with one more that sharpens it; the others come together."""
_STRONG = 20.0
"""Score (1) from which an effect is put into the fit before others are sought: what its linear model leaves of it, some
percent, would be taken for them."""
_FAILS = 1.3
"""Mean squared innovation of a recording over that of noise (1) from which the same holds: deviations of the power-ons
take up so much of a strong effect that its score is small."""
_DOUBLE = 0.995
"""Correlation of two columns (1) from which one of them already is the other: they differ by a tenth of their
length."""


@dataclass(frozen=True)
class SetRequest:
    """What is searched for in a set, and by what means."""

    options: SetOptions
    run: Run
    """Does the jobs."""
    extra: tuple[Effect, ...] = ()
    """The user's own effects, tried with the catalogue."""
    progress: Progress = silent

    def fit(self, told: Sequence[Candidate], before: SetFit) -> SetFit:
        """Fit the members of an earlier fit with what is told."""
        fit = fit_set(before.members, _with(self.options, told), self.run, before, self.progress)
        return replace(fit, left_out=(*before.left_out, *fit.left_out))


def search_set(members: Sequence[Member], request: SetRequest, fitted: SetFit | None = None) -> SetSearch:
    """Find what the model of a set misses.

    Parameters
    ----------
    members : sequence of Member
        At least two.
    fitted : SetFit, optional
        The set with the model as given, where it was fitted already.
    """
    before = fitted or fit_set(members, request.options, request.run, progress=request.progress)
    return _searched(before, before, (), request)


def search_without(found: SetSearch, request: SetRequest) -> SetSearch:
    """Search again without the function that a search asked for; what was found is a candidate again."""
    again = _searched(found.before, request.fit(found.told, found.before), found.told, request, asks=False)
    return replace(again, first=found.first)


def search_about(found: SetSearch, fit: SetFit, request: SetRequest, asks: bool = False) -> SetSearch:
    """Search again about a fit with what was found, beside a function or with more candidates: all is one again.

    Parameters
    ----------
    asks : bool
        As of `_searched`.
    """
    again = _searched(found.before, fit, found.told, request, asks)
    return replace(again, first=found.first, alone=found.alone)


def _searched(
    before: SetFit, fit: SetFit, told: tuple[Candidate, ...], request: SetRequest, asks: bool = True
) -> SetSearch:
    """Search about a fit with what is told, until the choice stands.

    Parameters
    ----------
    asks : bool
        Put a function of the attitude beside the fit as soon as some recording is likely to have one: effects that are
        chosen without it would be parts of it, one after the other.
    """
    alone: SetFit | None = None
    finer: tuple[Effect, ...] = ()
    seen: set[frozenset[str]] = {frozenset(c.label for c in told)}
    found: Search[SetEvidence] | None = None
    first: Search[SetEvidence] | None = None
    stood = False
    for turn in range(_MOST_ROUNDS):
        request.progress("candidates", min(0.9, 0.4 + 0.1 * turn))
        full, evidence = _evidence(fit, request, finer)
        columns, tried = _reopened(evidence, told)
        again = evidence.as_candidates(columns, tried)
        names = {c.label: evidence.names[column] for c, column in zip(tried, columns.tolist(), strict=True)}
        boards, limit = partial(SetBoard, full, names), first.threshold if first else None
        found = search(again, _singles(again), None, FALSE_ALARM, limit, found, tell_noise=False, make=boards)
        beside = _beside_function(fit, found, request.run) if asks and turn + 1 < _MOST_ROUNDS else fit
        if beside is not fit:
            first, found, alone, fit = first or with_steps(found), None, alone or fit, beside
            continue
        found = with_steps(found)
        first = first or found
        chosen = _first_ones(fit, found, told)
        nearer = _nearer(chosen, told, finer)
        if nearer:
            finer = (*finer, *nearer)
            continue
        labels = frozenset(c.label for c in chosen)
        stood = labels == {c.label for c in told}
        if stood or labels in seen:
            break
        seen.add(labels)
        told = chosen
        fit = in_size(request.fit(told, fit))
    if first is None or found is None:
        raise AssertionError("a search has one round at least")
    result = _in_own_functions(_result(before, fit, told, evidence, (first, found), stood), full, evidence)
    return result if alone is None else replace(result, alone=alone)


def _beside_function(fit: SetFit, found: Search[SetEvidence], run: Run) -> SetFit:
    """Put a function of the attitude beside a fit for all sensors that are likely to have one in some recording."""
    likely = () if found.posterior is None else following(found.posterior, PROBABLE)
    have = () if fit.function is None else fit.function.sensors
    if set(likely) <= set(have):
        return fit
    return with_function(fit, (*have, *likely), run)


def _result(
    before: SetFit,
    fit: SetFit,
    told: Sequence[Candidate],
    evidence: SetEvidence,
    searches: tuple[Search[SetEvidence], Search[SetEvidence]],
    stood: bool,
) -> SetSearch:
    """Put the result together of the fit with what is told, and of the first and the last search."""
    first, last = searches
    window = last.posterior
    if window is None:
        raise AssertionError("a search weighs models")
    z = {step.label: step.z for step in last.steps}
    # A window that chooses something else does not say how probable this is.
    nothing: tuple[tuple[str, ...], float, tuple[Share, ...]] = ((), float("nan"), ())
    finds: list[Find] = []
    for one in sorted(told, key=lambda c: bool(c.recording)):
        alike, probability, shares = _class(window, one.label) if stood else nothing
        own = of_one_recording(one.label) if one.recording else one
        finds.append(Find(own, z.get(one.label, float("nan")), () if one.recording else alike, probability, shares))
    shared = [find for find in finds if not find.candidate.recording]
    standing = set_standing(fit, evidence if shared else set_evidence(fit, ()), shared)
    result = SetSearch(before, fit, tuple(finds), first, standing, window, stood, fit)
    function = fit.function
    if function is None:
        return result
    common = tuple(s for one in result.told_functions if one.is_common for s in one.sensors)
    return replace(result, after=replace(fit, function=replace(function, told=common)))


def _in_own_functions(found: SetSearch, full: SetFit, evidence: SetEvidence) -> SetSearch:
    """Let the fit, and what the set knows of the unit, stand in functions of single recordings where none is common.

    Parameters
    ----------
    full : SetFit
        Its reports have the signatures of the candidates of the evidence.
    """
    board, noise, functions = found.posterior.board, likeliest_alone(found.posterior), found.told_functions
    common = not functions or any(one.is_common for one in functions)
    if common or not found.stood or noise is None or not isinstance(board, SetBoard):
        return found
    own = [board.functions.own(sizes) for sizes in noise.own_functions]
    fit, shared = with_own_functions(found.after, own), [f for f in found.finds if not f.candidate.recording]
    about = set_evidence(with_own_functions(full, own), evidence.candidates) if shared else set_evidence(fit, ())
    return replace(found, after=fit, standing=set_standing(fit, about, shared))


def _with(options: SetOptions, told: Sequence[Candidate]) -> SetOptions:
    """Return the options with what is told, in all recordings or in one."""
    local = dict(options.local)
    for one in told:
        if one.recording:
            local[one.recording] = (*local.get(one.recording, ()), split_tag(one.label)[0])
    shared = [by_name(c.effect) for c in told if not c.recording]
    # The same in all recordings, or another one in some: so the search weighs it, and a scatter of power-ons would take
    # the place of its mean where the prior is too narrow for that.
    scopes = {c.effect.family or c.effect.name: "unit" for c in told if not c.recording}
    model = with_effects(options.model, shared)
    return replace(options, model=model, local=local, scopes={**scopes, **options.scopes})


def _evidence(fit: SetFit, request: SetRequest, finer: Sequence[Effect]) -> tuple[SetFit, SetEvidence]:
    """Take the evidence about a fit, with all that its model may lack in all recordings or in one.

    Returns
    -------
    full : SetFit
        Its reports have the signatures of the candidates, and what each recording says in each noise.
    evidence : SetEvidence
    """
    effects = _candidates(fit, request.extra, finer)
    full = _gathered(fit, effects, request.run)
    every = [label for report in full.reports for label in report.reduction.labels]
    local = [of_one_recording(label) for label in every if split_tag(label)[1]]
    reports, labels = with_changes(full.reports, stable_effects(full.model, full.varying))
    changes = [change_of(label, reports[0].imu) for label in labels]
    shared = [c for effect in effects for c in split(effect)]
    full = replace(full, reports=tuple(reports))
    return full, set_evidence(full, [*shared, *local, *changes])


def _reopened(evidence: SetEvidence, told: Sequence[Candidate]) -> tuple[Ints, list[Candidate]]:
    """Columns of what is told in the model of a fit, and the same as candidates."""
    columns = np.array([place_of(evidence.names, c) for c in told], dtype=np.int64)
    return columns, [replace(c, effect=replace(c.effect, nearer=None)) for c in told]


def _first_ones(fit: SetFit, found: Search[SetEvidence], told: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Take what was found; of what is new the first alone where it is so strong that the linear model fails.

    The others may be what the linear model leaves of it.
    """
    known = {c.label: c for c in told}
    chosen = [known.get(c.label, c) for c in found.candidates]
    new = [c.label for c in chosen if c.label not in known]
    worst = max(r.statistics.nis_mean for r in fit.reports)
    z = {step.label: abs(step.z) for step in found.steps}
    if len(new) > 1 and (z[new[0]] > _STRONG or worst > _FAILS):
        chosen = [c for c in chosen if c.label not in new[1:]]
    return tuple(chosen)


def _singles(evidence: SetEvidence) -> Ints:
    """Columns of the candidates without those of sets that another one already is: three soaks tell no third power."""
    p = len(evidence.weight)
    J = evidence.information.J[p:, p:]
    unit = 1.0 / np.sqrt(np.maximum(np.diag(J), 1e-300))
    of_sets = np.array([c.effect.tried_in == "set" for c in evidence.candidates], dtype=bool)
    # Those of sets come behind all others they may be, the powers in their order.
    kept = np.flatnonzero(~of_sets)
    for k in np.flatnonzero(of_sets).tolist():
        if not len(kept) or np.max(np.abs(J[k, kept]) * unit[k] * unit[kept]) < _DOUBLE:
            kept = np.append(kept, k)
    return np.sort(kept) + p


def _candidates(fit: SetFit, extra: Sequence[Effect], finer: Sequence[Effect]) -> list[Effect]:
    """Effects that all recordings may lack, without the parameters that the model has."""
    report = max(fit.reports, key=lambda r: len(r.times.stops))
    heat = all(r.has_temperature for r in fit.reports)
    have = {label for e in fit.model.effects for label in selection.resolve(e).labels}
    have |= set(fit.names)
    effects = [*extra, *(e for e in catalogue(report.times, have, heat, of_a_set=True) if is_shared(e)), *finer]
    if any(r.estimator == HandheldFit.estimator for r in fit.reports):
        effects = [e for e in effects if not (e.needs_table or e.random_walk or e.decay_s)]
    found: list[Effect] = []
    for effect in effects:
        lacking = without(effect, have)
        have |= {label for e in lacking for label in e.labels}
        found += lacking
    return found


def _gathered(fit: SetFit, tried: Sequence[Effect], run: Run) -> SetFit:
    """Return the fit with the signatures of effects in its reports."""
    # The search looks at what is left of these rows, not of those before.
    return with_reports(
        fit, asked_again(fit, run, candidates=tuple(map(name_of_candidate, tried)), with_local=True, rivals=True)
    )


def _nearer(chosen: Sequence[Candidate], told: Sequence[Candidate], tried: Sequence[Effect]) -> list[Effect]:
    """Variants between those of the scan, about what is new in all recordings; those that were tried are left out."""
    have = {label for effect in tried for label in effect.labels}
    old = {c.coefficient for c in told}
    variants: list[Effect] = []
    for candidate in chosen:
        if candidate.recording or candidate.coefficient in old or candidate.label in have:
            continue
        stands = candidate.effect.file or candidate.family == "own"
        effect = candidate.effect if stands else selection.resolve(candidate.label)
        for _ in range(2):
            if effect.nearer is None:
                break
            around = effect.nearer()
            variants += [v.only((candidate.parameter.name,)) for v in around if v.variant != effect.variant]
            effect = around[len(around) // 2]
    return [v for v in variants if have.isdisjoint(v.labels)]


def _class(found: Posterior[SetEvidence], label: str) -> tuple[tuple[str, ...], float, tuple[Share, ...]]:
    """Say what the set cannot tell from a candidate, how probable any of them is, and each coefficient of them."""
    for place, (number, _) in enumerate(found.told.members):
        together = [found.candidate(k) for k in (number, *found.classes[place])]
        own = next((c for c in together if c.label == label), None)
        if own is not None:
            others = tuple(c.label for c in together if c.coefficient != own.coefficient)
            return others, found.of_class(place), may_be(found, place)
    return (), next((s.probability for s in of_coefficients(found) if s.name == label), 0.0), ()


def places_of_chosen(found: SetSearch) -> list[int]:
    """Places of what was found in all recordings among the coefficients of the fit with it."""
    return [place_of(found.after.names, candidate) for candidate in found.chosen]


def place_of(names: Sequence[str], candidate: Candidate) -> int:
    """Place of a coefficient that was found among those of a fit; -1 where it is not there."""
    # Beside another variant it is called by its label: the plain name is then that of the other one.
    own = candidate.parameter.name
    for name in (candidate.label, tagged(own, candidate.recording) if candidate.recording else own):
        if name in names:
            return list(names).index(name)
    return -1
