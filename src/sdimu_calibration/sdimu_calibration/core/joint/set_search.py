"""What does the model of a set miss? The search of one recording, on the evidence of all of them.

An effect that is the same in all recordings, a fault of the data of one, a drift of one power-on, a coefficient that is
another one in one recording: each is a candidate, and all are weighed in one posterior. What was chosen is a candidate
again in the next round, about the fit that has it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.candidates import catalogue, without
from sdimu_calibration.core.diagnosis.grades import NAMED
from sdimu_calibration.core.diagnosis.search import CERTAIN_NOISE, FALSE_ALARM, Search, search, with_steps
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import CHANNELS, Effect
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.evidence.known import Standing
from sdimu_calibration.core.joint.changed import change_of, stable_effects, with_changes
from sdimu_calibration.core.joint.function_fit import in_size
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.scope import by_name, is_shared, split_tag, tagged
from sdimu_calibration.core.joint.set_board import SetBoard
from sdimu_calibration.core.joint.set_evidence import SetEvidence, set_evidence
from sdimu_calibration.core.joint.set_fit import Run, SetFit, SetOptions, asked_again, fit_set, with_reports
from sdimu_calibration.core.joint.set_noise import SetNoise
from sdimu_calibration.core.joint.set_standing import set_standing
from sdimu_calibration.core.noise_term import ATTITUDE, DRAWN, TRIADS, NoiseTerm
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
class LocalFind:
    """An effect of one recording."""

    recording: str
    key: str
    z: float
    """Score beside what was found before it."""
    probability: float
    """That it or something of its class is there (1)."""

    @property
    def label(self) -> str:
        """Key with the name of the recording behind it."""
        return tagged(self.key, self.recording)


@dataclass(frozen=True)
class FunctionShare:
    """How probable an unknown function of the attitude is."""

    recording: str
    """That which has it alone; empty where all share it."""
    probability: float
    sensors: tuple[str, ...]
    """Those that more likely than not have it, else the likeliest one."""

    @property
    def is_common(self) -> bool:
        """Whether all recordings share it."""
        return not self.recording

    @property
    def likely(self) -> bool:
        """Whether it is more likely than not."""
        return self.probability > PROBABLE


@dataclass(frozen=True)
class SetSearch:
    """What was found in a set."""

    before: SetFit
    after: SetFit
    """`before`, `after`: with the model as given, and with what was found."""
    chosen: tuple[Candidate, ...]
    """Effects in all recordings, the largest share of the misfit first."""
    z: tuple[float, ...]
    """Score of each beside those before it."""
    alike: dict[str, tuple[str, ...]]
    """By label, what the set cannot tell from it."""
    probability: dict[str, float]
    """By label, that it or one of these is in all recordings (1)."""
    may_be: dict[str, tuple[Share, ...]]
    """By label, coefficients of its class with the probability of each; of what is of one recording, too."""
    local: tuple[LocalFind, ...]
    threshold: float
    """Score that noise reaches in a scan of the joint evidence."""
    first: Search[SetEvidence]
    """Of the first round: its scan."""
    standing: Standing
    """What the set knows of the unit."""
    posterior: Posterior[SetEvidence]
    """The models that all recordings together leave probable."""
    stood: bool
    """The choice stood at the end; False where the search went to and fro, and the window chooses something else."""

    @property
    def told(self) -> tuple[Candidate, ...]:
        """What was found, in all recordings or in one."""
        return (*self.chosen, *(_of_one(one.label) for one in self.local))

    @property
    def any_function(self) -> float:
        """Probability of an unknown function of the attitude, in all recordings or in one (1)."""
        return self._of_noise(lambda noise: any(noise.function) or any(map(any, noise.own_functions)))

    @cached_property
    def functions(self) -> tuple[FunctionShare, ...]:
        """The function that all recordings share, and that of each alone; empty where none was looked for."""
        if self.after.function is None:
            return ()
        own = [self._share(report.name, r) for r, report in enumerate(self.after.reports)]
        return (self._share("", None), *own)

    @cached_property
    def may_follow_attitude(self) -> tuple[str, ...]:
        """Sensors of which some recording may have an error that follows the attitude, as its noise."""

        def has(noise: SetNoise, channel: str) -> bool:
            terms = (t for one in noise.own for t in one.terms if t.kind == ATTITUDE)
            return any(channel in {f"{t.triad}_{'xyz'[axis]}" for axis in t.axes} for t in terms)

        def of(channel: str) -> float:
            return self._of_noise(lambda noise: has(noise, channel))

        return tuple(channel for channel in CHANNELS if of(channel) > NAMED)

    @property
    def told_functions(self) -> tuple[FunctionShare, ...]:
        """Those that are likely; where one is, and it is open whose, the likeliest."""
        likely = tuple(one for one in self.functions if one.likely)
        if likely or self.any_function <= PROBABLE:
            return likely
        return (max(self.functions, key=lambda one: one.probability),)

    def drawn_in(self, place: int) -> tuple[NoiseTerm, ...]:
        """Noise that hangs on attitude, rate or turns, nearly certain in a recording, by its place among the reports.

        What wanders and looks the same has its own probability.
        """
        of_each: dict[NoiseTerm, float] = {}
        for noise, p in self.posterior.noises:
            for term in noise.own[place].terms if isinstance(noise, SetNoise) else ():
                if term.kind in DRAWN:
                    of_each[term] = of_each.get(term, 0.0) + p

        def certain(triad: str) -> bool:
            return self._of_noise(lambda noise: bool(noise.own[place].drawn_in(triad))) > CERTAIN_NOISE

        likely = [[term for term in of_each if term.triad == triad] for triad in TRIADS if certain(triad)]
        return tuple(max(own, key=of_each.__getitem__) for own in likely)

    def _share(self, recording: str, place: int | None) -> FunctionShare:
        """Say how probable the function of a recording is, by its place among the reports; None: that of all."""
        sensors = () if self.after.function is None else self.after.function.sensors

        def of(k: int) -> float:
            return self._of_noise(lambda noise: bool(noise.sizes_of(place)[k]))

        each = [of(k) for k in range(len(sensors))]
        likely = tuple(s for s, p in zip(sensors, each, strict=True) if p > PROBABLE)
        together = self._of_noise(lambda noise: any(noise.sizes_of(place)))
        return FunctionShare(recording, together, likely or (sensors[int(np.argmax(each))],))

    def _of_noise(self, holds: Callable[[SetNoise], bool]) -> float:
        return self.posterior.of_any_noise(lambda noise: isinstance(noise, SetNoise) and holds(noise))


def search_set(
    members: Sequence[Member],
    options: SetOptions,
    run: Run,
    extra: Sequence[Effect] = (),
    progress: Progress = silent,
    fitted: SetFit | None = None,
) -> SetSearch:
    """Find what the model of a set misses.

    Parameters
    ----------
    members : sequence of Member
        At least two.
    run : callable
        Does the jobs.
    extra : sequence of Effect
        The user's own effects, tried with the catalogue.
    fitted : SetFit, optional
        The set with the model as given, where it was fitted already.
    """
    before = fitted or fit_set(members, options, run, progress=progress)
    return _searched(before, before, (), options, run, extra, progress)


def search_beside(
    found: SetSearch,
    fit: SetFit,
    options: SetOptions,
    run: Run,
    extra: Sequence[Effect] = (),
    progress: Progress = silent,
) -> SetSearch:
    """Search again where a fit has a function that all recordings share; what was found is a candidate again.

    Parameters
    ----------
    fit : SetFit
        With the function and with what was found.
    """
    again = _searched(found.before, fit, found.told, options, run, extra, progress)
    shared = again.after.function
    if shared is not None:
        told = tuple(s for one in again.told_functions if one.is_common for s in one.sensors)
        again = replace(again, after=replace(again.after, function=replace(shared, told=told)))
    return replace(again, first=found.first, threshold=found.threshold)


def _searched(
    before: SetFit,
    fit: SetFit,
    told: tuple[Candidate, ...],
    options: SetOptions,
    run: Run,
    extra: Sequence[Effect],
    progress: Progress,
) -> SetSearch:
    """Search about a fit with what is told, until the choice stands."""
    members = before.members
    finer: tuple[Effect, ...] = ()
    seen: set[frozenset[str]] = {frozenset(c.label for c in told)}
    found: Search[SetEvidence] | None = None
    first: Search[SetEvidence] | None = None
    stood = False
    for turn in range(_MOST_ROUNDS):
        progress("candidates", min(0.9, 0.4 + 0.1 * turn))
        full, evidence = _evidence(fit, extra, finer, run)
        columns, tried = _reopened(evidence, told)
        again = evidence.as_candidates(columns, tried)
        names = {c.label: evidence.names[column] for c, column in zip(tried, columns.tolist(), strict=True)}
        boards, limit = partial(SetBoard, full, names), first.threshold if first else None
        found = search(again, _singles(again), None, FALSE_ALARM, limit, found, tell_noise=False, make=boards)
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
        fit = in_size(fit_set(members, _with(options, told), run, fit, progress))
    if first is None or found is None:
        raise AssertionError("a search has one round at least")
    return _result(before, fit, told, evidence, (first, found), stood)


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
    classes = {c.label: _class(window, c.label) if stood else ((), float("nan"), ()) for c in told}
    shared = {c.label: c for c in told if not c.recording}
    alike = {label: classes[label][0] for label in shared}
    local = tuple(
        LocalFind(c.recording, split_tag(c.label)[0], z.get(c.label, float("nan")), classes[c.label][1])
        for c in told
        if c.recording
    )
    return SetSearch(
        before,
        fit,
        tuple(shared.values()),
        tuple(z.get(label, float("nan")) for label in shared),
        alike,
        {label: classes[label][1] for label in shared},
        {label: one[2] for label, one in classes.items()},
        local,
        first.threshold,
        first,
        set_standing(fit, evidence if shared else set_evidence(fit, ()), shared, alike),
        window,
        stood,
    )


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


def _evidence(fit: SetFit, extra: Sequence[Effect], finer: Sequence[Effect], run: Run) -> tuple[SetFit, SetEvidence]:
    """Take the evidence about a fit, with all that its model may lack in all recordings or in one.

    Returns
    -------
    full : SetFit
        Its reports have the signatures of the candidates, and what each recording says in each noise.
    evidence : SetEvidence
    """
    effects = _candidates(fit, extra, finer)
    full = _gathered(fit, effects, run)
    local = [_of_one(label) for report in full.reports for label in report.reduction.labels if split_tag(label)[1]]
    reports, labels = with_changes(full.reports, stable_effects(full.model, full.varying))
    changes = [change_of(label, reports[0].imu) for label in labels]
    shared = [c for effect in effects for c in split(effect)]
    full = replace(full, reports=tuple(reports))
    return full, set_evidence(full, shared, [*local, *changes])


def _of_one(label: str) -> Candidate:
    """Candidate of one recording, by its label."""
    key, recording = split_tag(label)
    return replace(_by_key(key), label=label, recording=recording)


@lru_cache(maxsize=4096)
def _by_key(key: str) -> Candidate:
    """Candidate of a key of one parameter: every recording has the same."""
    (one,) = split(selection.resolve(key))
    return one


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
    return with_reports(fit, asked_again(fit, run, candidates=tuple(map(by_name, tried)), with_local=True, rivals=True))


def _nearer(chosen: Sequence[Candidate], told: Sequence[Candidate], tried: Sequence[Effect]) -> list[Effect]:
    """Variants between those of the scan, about what is new in all recordings; those that were tried are left out."""
    have = {label for effect in tried for label in effect.labels}
    old = {c.coefficient for c in told}
    variants: list[Effect] = []
    for candidate in chosen:
        if candidate.recording or candidate.coefficient in old or candidate.label in have:
            continue
        effect = selection.resolve(candidate.label) if not candidate.effect.file else candidate.effect
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


def place_of_local(names: Sequence[str], find: LocalFind) -> int:
    """Place among those of a fit of a coefficient that was found in one recording."""
    called = (tagged(name, find.recording) for name in (find.key, selection.resolve(find.key).parameters[0].name))
    return next(list(names).index(name) for name in called if name in names)


def place_of(names: Sequence[str], candidate: Candidate) -> int:
    """Place of a coefficient that was found among those of a fit; -1 where it is not there."""
    # Beside another variant it is called by its label: the plain name is then that of the other one.
    own = candidate.parameter.name
    for name in (candidate.label, tagged(own, candidate.recording) if candidate.recording else own):
        if name in names:
            return list(names).index(name)
    return -1
