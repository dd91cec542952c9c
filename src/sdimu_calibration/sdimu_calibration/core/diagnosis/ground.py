"""What a round is linear about: the request, the fit with what was tried, the evidence there.

Strong effects come first, alone. About a fit that lacks them the signatures of all other effects are wrong by several
percent, and what the linear model leaves of an effect of fifty sigma looks like small companions of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.candidates import catalogue, equations, free_inputs, periodic
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.search import MOST_STEPS, Search, search
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.solve import extend
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.evidence.learned_noise import Wander
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import DataError

_PARALLEL = 1e-6
"""Share of its length by which a signature must differ from another to be its own: rounding is far below."""
_STRONG = 20.0
"""Score (sigma) of a candidate from which it is looked for before the others: signatures about a fit without it are
wrong by several percent, and a twentieth of it is what noise alone does."""
_SURE = 6.0
"""Score (sigma) in learned noise from which a strong candidate is no part of the noise: one in a billion."""
_LEADS = 0.3
"""Score (1) of a strong candidate over that of the strongest one that the fit lacks, from which both come in at once: a
weaker one may be what the linear model leaves of the strongest."""
_MOST_REFITS = 4
"""Number of refits with strong effects at most: each brings those of a third of the strongest one that was left."""


@dataclass(frozen=True)
class Request:
    """What is searched for.

    Attributes
    ----------
    base : Fit
        With the model as given.
    extra : tuple of Effect
        The user's own effects, candidates like those of the catalogue.
    alpha : float
        False-alarm probability of a whole scan.
    wander : Wander or None
        How wandering biases would show in the test; None where the estimator learns scatter instead.
    without : frozenset of str
        Registry names of effects that are not tried.
    learned : tuple of NoiseTerm
        Noise with a memory that was learned before anything was looked for.
    """

    base: Fit
    extra: tuple[Effect, ...]
    alpha: float
    wander: Wander | None = None
    without: frozenset[str] = frozenset()
    learned: tuple[NoiseTerm, ...] = ()


@dataclass(frozen=True)
class Ground:
    """A fit with what was tried, and the evidence about it.

    Attributes
    ----------
    fit : Fit
        The model as given with `tried`.
    tried : tuple of Candidate
    evidence : LinearEvidence
        `tried` is among its candidates.
    free : ndarray of int, shape (f,)
        Columns of the free inputs in `evidence`.
    """

    fit: Fit
    tried: tuple[Candidate, ...]
    evidence: LinearEvidence
    free: Ints

    @property
    def allowed(self) -> Ints:
        """Columns that may be chosen, shape (a,)."""
        return np.setdiff1d(np.arange(len(self.evidence.weight), len(self.evidence.names)), self.free)


def fresh_ground(request: Request, fit: Fit, tried: Sequence[Candidate], own: bool) -> Ground:
    """Take the evidence about a fit with signatures of its own.

    Parameters
    ----------
    request : Request
    fit : Fit
        The model as given with `tried`.
    tried : sequence of Candidate
    own : bool
        Also equations that are not in the catalogue.
    """
    base = request.base
    free = free_inputs(base.timetable) if base.free_inputs_testable else []
    evidence = fit.evidence([*candidates(request, tried, own), *free])
    evidence = evidence.as_candidates(fit.added_columns(len(tried)), tried)
    count = len(evidence.names)
    return Ground(fit, tuple(tried), evidence, np.arange(count - sum(len(e.parameters) for e in free), count))


def next_ground(
    request: Request, fit: Fit, tried: Sequence[Candidate], own: bool, found: Search[LinearEvidence], free: Ints
) -> Ground:
    """Take the evidence about a fit, with the signatures of the search that chose `tried`.

    Parameters
    ----------
    request, fit, tried, own
        As for `fresh_ground`.
    found : Search
        About the fit before, which differs little.
    free : ndarray of int, shape (f,)
        Columns of the free inputs of its evidence.
    """
    if request.base.learns_scatter:
        return fresh_ground(request, fit, tried, own)
    before = found.evidence if found.white is None else found.white
    evidence = before.about(fit.evidence(), fit.added_columns(len(tried)), tried)
    if own and not any(c.family == "own" for c in evidence.candidates):
        more = _untried(candidates(request, (), own), frozenset(evidence.names))
        evidence = _without_doubles(evidence, more)
    return Ground(fit, tuple(tried), evidence, free)


def strong_first(request: Request, progress: Progress) -> Ground:
    """Fit with the strong effects of the catalogue alone, until none that is left is strong.

    Where noise with a memory was learned, only those count that are beyond doubt in it, though it was learned without
    them: much of such noise scores as dozens of sigma in white noise.

    Returns
    -------
    Ground
        The fit as given where nothing is strong.
    """
    ground = fresh_ground(request, request.base, (), False)
    for _ in range(_MOST_REFITS):
        allowed = _beyond_noise(request, ground)
        limit = _strong_limit(ground, allowed)
        if limit is None:
            break
        found = search(ground.evidence, allowed, request.alpha, MOST_STEPS, limit)
        chosen = tuple(Problem(found.evidence).candidate(c) for c in found.chosen)
        if {c.label for c in chosen} == {c.label for c in ground.tried}:
            break
        try:
            fit = extended(request, chosen, progress)
        except DataError:
            # The rounds look again about the fit that stands, with noise as a rival.
            break
        ground = fresh_ground(request, fit, chosen, False)
    return ground


def _beyond_noise(request: Request, ground: Ground) -> Ints:
    """Columns that may be chosen, and that learned noise does not explain, shape (a,)."""
    if request.wander is None or not request.learned:
        return ground.allowed
    problem = Problem(ground.evidence.with_noise(request.wander.modes(request.learned).columns))
    labels = [c.label for c in ground.evidence.candidates]
    tried = [problem.p + labels.index(c.label) for c in ground.tried]
    z = np.abs(problem.scan(tried, 1.0).z)
    return np.union1d(ground.allowed[z[ground.allowed] > _SURE], np.array(tried, dtype=np.int64))


def _strong_limit(ground: Ground, allowed: Ints) -> float | None:
    """Score from which candidates come in next; None where nothing that the fit lacks is strong."""
    problem = Problem(ground.evidence)
    labels = [c.label for c in ground.evidence.candidates]
    tried = [problem.p + labels.index(c.label) for c in ground.tried]
    scanned = problem.scan(tried, problem.scale(tried))
    largest = float(np.max(np.abs(scanned.z[allowed]), initial=0.0))
    return max(_STRONG, _LEADS * largest) if largest > _STRONG else None


def extended(request: Request, chosen: Sequence[Candidate], progress: Progress) -> Fit:
    """Fit the model with what a round chose; name the choice where the estimator cannot fit it."""
    base = request.base
    try:
        return extend(base, [c.effect for c in chosen], progress=progress, learn=False)
    except DataError as error:
        names = " and ".join(c.label for c in chosen)
        raise DataError(
            f"the search chose {names}, and the {base.estimator} estimator cannot fit it ({error}); diagnose with "
            "another --estimator"
        ) from error


def candidates(request: Request, tried: Sequence[Candidate], own: bool) -> list[Effect]:
    """Effects that a fit may lack: the user's, the catalogue, equations; without those tried or in the model.

    Parameters
    ----------
    request : Request
    tried : sequence of Candidate
    own : bool
        Equations and sines of time too.
    """
    base = request.base
    times, has_temperature = base.timetable, base.has_temperature
    more = [*equations(has_temperature), *periodic(times.duration)] if own else []
    known = [*request.extra, *catalogue(times, set(base.labels), has_temperature), *more]
    known = [e for e in known if (e.family or e.name) not in request.without]
    if base.learns_scatter:
        known = [
            e for e in known
            if not e.needs_table and not e.random_walk and e.decay_s is None
        ]  # fmt: skip
    return _untried(known, {c.label for c in tried} | base.labels)


def _without_doubles(evidence: LinearEvidence, equations: Sequence[Effect]) -> LinearEvidence:
    """Add equations, but those that a registered effect already is: the catalogue has the word."""
    n, p = len(evidence.names), len(evidence.weight)
    wider = evidence.with_effects(equations)
    size = np.sqrt(np.maximum(np.diag(wider.information.J), 1e-300))
    alike = np.abs(wider.information.J[n:, p:n]) / np.outer(size[n:], size[p:n])
    single = np.flatnonzero(alike.max(axis=1, initial=0.0) < 1.0 - _PARALLEL) + n
    return wider.only(np.concatenate([np.arange(p, n), single]))


def _untried(effects: Sequence[Effect], have: set[str] | frozenset[str]) -> list[Effect]:
    """Effects without the parameters, by label, that `have` holds."""
    out = []
    for effect in effects:
        names = tuple(c.parameter.name for c in split(effect) if c.label not in have)
        if names:
            out.append(effect.only(names) if len(names) < len(effect.parameters) else effect)
    return out
