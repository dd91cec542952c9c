"""What does the model of a set miss? The search of one recording, on the evidence of all of them.

An effect that is the same in all recordings is sought in the joint evidence: what each of them shows adds up. A fault
of the data, or a drift of one power-on, is also sought in every recording by itself, given the joint estimate, with a
threshold that counts all recordings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.candidates import catalogue, without
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.search import FALSE_ALARM, Search, search, with_steps
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.imu_model import prior_size
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.evidence.known import Standing
from sdimu_calibration.core.joint.member import Job, Member, Report
from sdimu_calibration.core.joint.scope import by_name, is_shared, split_tag
from sdimu_calibration.core.joint.set_evidence import SetEvidence, set_evidence, white_power_on
from sdimu_calibration.core.joint.set_fit import Run, SetFit, SetOptions, fit_set, power_on, with_own, with_reports
from sdimu_calibration.core.joint.set_standing import set_standing
from sdimu_calibration.core.posterior.posterior import Posterior, posterior
from sdimu_calibration.core.posterior.told import of_coefficients
from sdimu_calibration.core.probability import normal_limit
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError

_MOST_ROUNDS = 20
"""Number of rounds at most: strong effects take one each, with one more that sharpens it; the others come together."""
_STRONG = 20.0
"""Score (1) from which an effect is put into the fit before others are sought: what its linear model leaves of it, some
percent, would be taken for them."""
_FAILS = 1.3
"""Mean squared innovation of a recording over that of noise (1) from which the same holds: deviations of the power-ons
take up so much of a strong effect that its score is small."""
_KEEP = 3.0
"""Size of an effect in the joint fit (sigma) below which it is dropped: chance ends there."""
_DOUBLE = 0.995
"""Correlation of two columns (1) from which one of them already is the other: they differ by a tenth of their
length."""
_ACCUSED = 1e-3
"""Probability that noise puts one candidate of one recording over its threshold: a recording that is accused is looked
at again, and no other recording can speak for it."""
_LOG_BAYES = 3.0
"""Least log Bayes factor (1) of an effect of one recording: odds of 20 to 1, "strong" on Jeffreys' scale."""
_WIDE = 3.0
"""Factor on the physical prior of a candidate (1): a sensor may be out of its class, as in the search of one
recording."""


@dataclass(frozen=True)
class LocalFind:
    """An effect of one recording.

    Attributes
    ----------
    recording, key : str
    z : float
        Score given the joint estimate.
    """

    recording: str
    key: str
    z: float


@dataclass(frozen=True)
class SetSearch:
    """What was found in a set.

    Attributes
    ----------
    before, after : SetFit
        With the model as given, and with what was found.
    chosen : tuple of Candidate
        Effects in all recordings, in the order in which they were found.
    z : tuple of float
        Score of each when it was found.
    alike : mapping
        By label, what the set cannot tell from it.
    probability : mapping
        By label, that it or one of these is in all recordings (1).
    local : tuple of LocalFind
    threshold : float
        Score that noise reaches in a scan of the joint evidence.
    first : Search
        Of the first round: its scan.
    standing : Standing
        What the set knows of the unit.
    posterior : Posterior or None
        The models that all recordings together leave probable.
    """

    before: SetFit
    after: SetFit
    chosen: tuple[Candidate, ...]
    z: tuple[float, ...]
    alike: dict[str, tuple[str, ...]]
    probability: dict[str, float]
    local: tuple[LocalFind, ...]
    threshold: float
    first: Search[SetEvidence]
    standing: Standing
    posterior: Posterior[SetEvidence] | None = None


def search_set(
    members: Sequence[Member],
    options: SetOptions,
    run: Run,
    extra: Sequence[Effect] = (),
    progress: Progress = silent,
    alpha: float = FALSE_ALARM,
    fitted: SetFit | None = None,
) -> SetSearch:
    """Find what the model of a set misses.

    Parameters
    ----------
    members : sequence of Member
        At least two.
    options : SetOptions
    run : callable
        Does the jobs.
    extra : sequence of Effect
        The user's own effects, tried with the catalogue.
    progress : callable
    alpha : float
        False-alarm probability of a whole scan.
    fitted : SetFit, optional
        The set with the model as given, where it was fitted already.
    """
    before = fit = fitted or fit_set(members, options, run, progress=progress)
    chosen: dict[str, Candidate] = {}
    scores: dict[str, float] = {}
    local: list[LocalFind] = []
    finer: list[Effect] = []
    first: Search[SetEvidence] | None = None
    for turn in range(_MOST_ROUNDS):
        progress("candidates", min(0.9, 0.4 + 0.1 * turn))
        effects = _candidates(fit, extra, finer)
        full = _gathered(fit, effects, run)
        evidence = set_evidence(full, [c for effect in effects for c in split(effect)])
        p, single = len(evidence.weight), _singles(evidence)
        found = with_steps(search(evidence, single, alpha=alpha))
        if len(found.steps) > 1 and _far_off(full, found):
            found = replace(found, chosen=found.chosen[:1], steps=found.steps[:1])
        first = first or found
        new = [evidence.candidates[i - p] for i in found.chosen]
        nearer = _nearer(new, finer)
        if nearer:
            finer = nearer
            continue
        finer = []
        # What all recordings show comes first: in one of them alone a drift may look the same.
        odd = None if new else _odd_one(full, evidence, found.chosen)
        if not new and not odd:
            break
        scores |= {s.label: s.z for s in found.steps}
        if odd:
            local.append(odd)
            own = {**options.local, odd.recording: (*options.local.get(odd.recording, ()), odd.key)}
            options = replace(options, local=own)
        else:
            chosen |= {c.label: c for c in new}
            options = replace(options, model=with_effects(options.model, [by_name(c.effect) for c in new]))
        fit = fit_set(members, options, run, fit, progress)
    if first is None:
        raise AssertionError("a search has one round at least")
    fit, kept = _without_small(members, options, run, fit, chosen, progress)
    alike: dict[str, tuple[str, ...]] = {}
    probability: dict[str, float] = {}
    window = first.posterior
    at_end = set_evidence(fit, ())
    if kept:
        effects = _candidates(fit, extra, [])
        full = _gathered(fit, effects, run)
        at_end = set_evidence(full, [c for effect in effects for c in split(effect)])
        window = _weighed(at_end, kept)
        for label in kept:
            alike[label], probability[label] = _class(window, label)
    return SetSearch(
        before,
        fit,
        tuple(kept.values()),
        tuple(scores.get(label, float("nan")) for label in kept),
        alike,
        probability,
        tuple(local),
        first.threshold,
        first,
        set_standing(fit, at_end, kept, alike),
        window,
    )


def as_given(found: SetSearch, options: SetOptions, run: Run) -> SetSearch:
    """Return the search as if it had chosen no effect of all recordings: the model as given stands.

    Parameters
    ----------
    found : SetSearch
        What it found in one recording alone stays.
    options : SetOptions
        Of the search.
    run : callable
        Does the jobs.
    """
    fit = found.before
    if found.local:
        local = dict(options.local)
        for find in found.local:
            local[find.recording] = (*local.get(find.recording, ()), find.key)
        fit = fit_set(fit.members, replace(options, local=local), run, fit)
    standing = set_standing(fit, set_evidence(fit, ()), {}, {})
    return replace(found, after=fit, chosen=(), z=(), alike={}, probability={}, standing=standing)


def _singles(evidence: SetEvidence) -> Ints:
    """Columns of the candidates without those of sets that another one already is: three soaks tell no third power."""
    p = len(evidence.weight)
    J = evidence.information.J[p:, p:]
    unit = 1.0 / np.sqrt(np.maximum(np.diag(J), 1e-300))
    likeness = np.abs(J * np.outer(unit, unit))
    of_sets = np.array([c.effect.tried_in == "set" for c in evidence.candidates], dtype=bool)
    # Those of sets come behind all others they may be, the powers in their order.
    order = np.concatenate([np.flatnonzero(~of_sets), np.flatnonzero(of_sets)])
    kept: list[int] = []
    for k in order.tolist():
        if not of_sets[k] or not kept or likeness[k, kept].max() < _DOUBLE:
            kept.append(k)
    return np.array(sorted(kept), dtype=np.int64) + p


def _far_off(fit: SetFit, found: Search[SetEvidence]) -> bool:
    """Whether what was found first is so strong that the others may be what its linear model leaves."""
    worst = max(r.statistics.nis_mean for r in fit.reports)
    return abs(found.steps[0].z) > _STRONG or worst > _FAILS


def _candidates(fit: SetFit, extra: Sequence[Effect], finer: Sequence[Effect]) -> list[Effect]:
    """Effects that all recordings may lack, without the parameters that the model has."""
    report = max(fit.reports, key=lambda r: len(r.times.stops))
    heat = all(r.has_temperature for r in fit.reports)
    have = {label for e in fit.model.effects for label in (selection.resolve(e) if isinstance(e, str) else e).labels}
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
    effects = tuple(map(by_name, tried))
    jobs = [
        Job(
            member,
            fit.model,
            report.estimator,
            tuple(fit.local.get(member.name, ())),
            effects,
            True,
            fit.values_of(report),
            report.imu,
            report.start,
            report.noise,
        )
        for member, report in zip(fit.members, fit.reports, strict=True)
    ]
    done = run(jobs)
    reports: list[Report] = []
    for old, fresh in zip(fit.reports, done, strict=True):
        if isinstance(fresh, DataError):
            raise fresh
        reports.append(with_own(fresh, old))
    # The search looks at what is left of these rows, not of those before.
    return with_reports(fit, reports)


def _nearer(new: Sequence[Candidate], tried: Sequence[Effect]) -> list[Effect]:
    """Variants between those of the scan, about what was found; none where they were tried."""
    if tried:
        return []
    variants: list[Effect] = []
    for candidate in new:
        effect = selection.resolve(candidate.label) if not candidate.effect.file else candidate.effect
        for _ in range(2):
            if effect.nearer is None:
                break
            around = effect.nearer()
            variants += [v.only((candidate.parameter.name,)) for v in around if v.variant != effect.variant]
            effect = around[len(around) // 2]
    return variants


def _weighed(evidence: SetEvidence, found: Mapping[str, Candidate]) -> Posterior[SetEvidence]:
    """Weigh what was found, and all else, about the fit that has all of it.

    Before, a strong effect hides what tells another one apart.
    """
    tried = [replace(c, effect=replace(c.effect, nearer=None)) for c in found.values()]
    columns = np.array([place_of(evidence.names, c) for c in tried], dtype=np.int64)
    open_again = evidence.as_candidates(columns, tried)
    first = len(open_again.weight)
    allowed = np.union1d(_singles(open_again), np.arange(first, first + len(tried))).astype(np.int64)
    return posterior(open_again, allowed, None)


def _class(found: Posterior[SetEvidence], label: str) -> tuple[tuple[str, ...], float]:
    """Say what the set cannot tell from a candidate, and the probability that it or any of them is there."""
    for place, (number, _) in enumerate(found.told.members):
        together = [found.candidate(k) for k in (number, *found.classes[place])]
        own = next((c for c in together if c.label == label), None)
        if own is not None:
            others = (c for c in together if (c.family, c.parameter.name) != (own.family, own.parameter.name))
            return tuple(c.label for c in others), found.of_class(place)
    return (), next((s.probability for s in of_coefficients(found) if s.name == label), 0.0)


def _odd_one(fit: SetFit, evidence: SetEvidence, chosen: Ints) -> LocalFind | None:
    """Find the effect of one recording that stands out most, given the joint estimate with what was chosen."""
    known, weight, _ = Problem(evidence).known([int(c) for c in chosen])
    estimate, covariance = evidence.information.estimate(known, weight)
    names = [evidence.names[k] for k in known]
    values = estimate + np.concatenate([fit.estimate.values, np.zeros(len(chosen))])
    count = sum(len(_local_labels(r)) for r in fit.reports)
    if not count:
        return None
    limit = normal_limit(0.5 * _ACCUSED / count)
    best: tuple[float, LocalFind] | None = None
    for name in fit.power_ons:
        members = [k for k, r in enumerate(fit.reports) if power_on(r) == name]
        for k, z, odds in _local_scores(fit, members, names, values, covariance):
            report = fit.reports[k]
            top = int(np.argmax(np.where((np.abs(z) > limit) & (odds > _LOG_BAYES), odds, -np.inf)))
            if np.abs(z[top]) > limit and odds[top] > _LOG_BAYES and (best is None or odds[top] > best[0]):
                key, recording = split_tag(_local_labels(report)[top])
                best = (float(odds[top]), LocalFind(recording, key, float(z[top])))
    return None if best is None else best[1]


def _local_labels(report: Report) -> list[str]:
    return [label for label in report.reduction.labels if split_tag(label)[1]]


def _local_scores(
    fit: SetFit, members: Sequence[int], names: Sequence[str], values: Floats, covariance: Floats
) -> list[tuple[int, Floats, Floats]]:
    """Score and log Bayes factor of every local candidate of the recordings of a power-on."""
    own = []
    for k in members:
        r = fit.reports[k].reduction
        places = [len(r.names) + i for i, label in enumerate(r.labels) if split_tag(label)[1]]
        own.append(r.A[:, places])
    rows, columns = white_power_on(fit, members, names, own)
    left = rows.y - rows.A @ values
    out = []
    for k, a in zip(members, columns, strict=True):
        if not a.shape[1]:
            continue
        across = a.T @ rows.A
        alone = np.sum(a**2, axis=0)
        J = alone - np.einsum("mp,pq,mq->m", across, covariance, across)
        d = a.T @ left
        seen = np.greater(J, 1e-3 * alone) & (alone > 0.0)
        prior = np.array([_prior(label, fit.reports[k]) for label in _local_labels(fit.reports[k])])
        with np.errstate(divide="ignore", invalid="ignore"):
            wide = 1.0 / (_WIDE * prior) ** 2
            z = np.where(seen, d / np.sqrt(J), 0.0)
            odds = np.where(seen, 0.5 * d**2 / (J + wide) - 0.5 * np.log1p(J / wide), -np.inf)
        out.append((k, z, odds))
    return out


def _prior(label: str, report: Report) -> float:
    size = prior_size(selection.resolve(split_tag(label)[0]), report.imu)
    return float("inf") if size is None else size


def _without_small(
    members: Sequence[Member],
    options: SetOptions,
    run: Run,
    fit: SetFit,
    chosen: dict[str, Candidate],
    progress: Progress,
) -> tuple[SetFit, dict[str, Candidate]]:
    """Drop the weakest of what was found while it is small in the joint fit."""
    while chosen:
        sigma = np.sqrt(np.diag(fit.estimate.covariance))
        size = {
            label: float(np.abs(fit.estimate.values[k]) / sigma[k])
            for label, c in chosen.items()
            if (k := place_of(fit.names, c)) >= 0
        }
        weakest = min(size, key=lambda label: size[label])
        if size[weakest] >= _KEEP:
            break
        dropped = chosen[weakest]
        chosen = {label: c for label, c in chosen.items() if label != weakest}
        effects = tuple(e for e in options.model.effects if e != by_name(dropped.effect))
        options = replace(options, model=replace(options.model, effects=effects))
        fit = fit_set(members, options, run, fit, progress)
    return fit, chosen


def place_of(names: Sequence[str], candidate: Candidate) -> int:
    """Place of a coefficient that was found among those of a fit; -1 where it is not there."""
    # Beside another variant it is called by its label: the plain name is then that of the other one.
    for name in (candidate.label, candidate.parameter.name):
        if name in names:
            return list(names).index(name)
    return -1
