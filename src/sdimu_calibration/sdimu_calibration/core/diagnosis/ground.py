"""What a round is linear about: the request, the fit with what was tried, the evidence there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.candidates import catalogue, equations, free_inputs, periodic
from sdimu_calibration.core.diagnosis.search import Search
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.solve import extend
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.posterior.near import near
from sdimu_calibration.core.posterior.posterior import Posterior
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Option

_PARALLEL = 1e-6
"""Share of its length by which a signature must differ from another to be its own: rounding is far below."""


@dataclass(frozen=True)
class Request:
    """What is searched for."""

    base: Fit
    """With the model as given."""
    extra: tuple[Effect, ...]
    """The user's own effects, candidates like those of the catalogue."""
    alpha: float
    """False-alarm probability of a whole scan."""
    wander: Wander | None = None
    """How wandering biases would show in the test; None where the estimator learns scatter instead."""
    without: frozenset[str] = frozenset()
    """Registry names of effects that are not tried."""

    def in_inner(self, evidence: LinearEvidence) -> LinearEvidence:
        """Return an evidence of white noise in what moves within the stretches of the test."""
        return evidence if self.wander is None else evidence.in_inner(self.wander.inner)


@dataclass(frozen=True)
class Aside:
    """Equations of one parameter each, n of them, and their signatures."""

    effects: tuple[Effect, ...]
    signature: Floats
    """Shape (N, n). Whitened residual per SI unit."""


@dataclass(frozen=True)
class Ground:
    """A fit with what was tried, and the evidence about it."""

    fit: Fit
    """The model as given with `tried`."""
    tried: tuple[Candidate, ...]
    evidence: LinearEvidence
    """`tried` is among its candidates."""
    free: Ints
    """Columns of the free inputs in `evidence`, shape (f,)."""
    aside: Aside | None = None
    """Equations that are no candidates, as they are far from every model; None where none were looked at."""

    @property
    def passed(self) -> int:
        """Number of equations that were looked at and are no candidates."""
        return 0 if self.aside is None else len(self.aside.effects)

    @property
    def allowed(self) -> Ints:
        """Columns that may be chosen, shape (a,)."""
        return np.setdiff1d(np.arange(len(self.evidence.weight), len(self.evidence.names)), self.free)


def fresh_ground(request: Request, fit: Fit, tried: Sequence[Candidate], own: bool) -> Ground:
    """Take the evidence about a fit with signatures of its own.

    Parameters
    ----------
    fit : Fit
        The model as given with `tried`.
    own : bool
        Also equations that are not in the catalogue.
    """
    base = request.base
    free = free_inputs(base.timetable) if base.free_inputs_testable else []
    evidence = request.in_inner(fit.evidence([*candidates(request, tried, own), *free]))
    evidence = evidence.as_candidates(fit.added_columns(len(tried)), tried)
    count = len(evidence.names)
    return Ground(fit, tuple(tried), evidence, np.arange(count - sum(len(e.parameters) for e in free), count))


def next_ground(
    request: Request, before: Ground, fit: Fit, tried: Sequence[Candidate], own: bool, found: Search[LinearEvidence]
) -> Ground:
    """Take the evidence about a fit, with the signatures of the search that chose `tried`.

    Parameters
    ----------
    before : Ground
        Of that search: a fit that differs little.
    fit : Fit
        The model as given with `tried`.
    own : bool
        Also equations that are not in the catalogue.
    """
    if request.base.learns_scatter:
        return fresh_ground(request, fit, tried, own)
    known = found.evidence if found.white is None else found.white
    evidence = known.about(request.in_inner(fit.bare), fit.added_columns(len(tried)), tried)
    ground = Ground(fit, tuple(tried), evidence, before.free, before.aside)
    return ground if not own or found.posterior is None else _with_equations(request, ground, found.posterior)


def _with_equations(request: Request, ground: Ground, found: Posterior[LinearEvidence]) -> Ground:
    """Make candidates of the equations that are near a model: beside one that is told others come near."""
    evidence, aside = ground.evidence, ground.aside
    if aside is None:
        untried = _untried(candidates(request, (), own=True), frozenset(evidence.names))
        aside = Aside(tuple(one for effect in untried for one in effect.singles), evidence.signature(untried))
    kept = near(found, aside.effects, aside.signature)
    effects = [effect for effect, is_near in zip(aside.effects, kept.tolist(), strict=True) if is_near]
    others = [effect for effect, is_near in zip(aside.effects, kept.tolist(), strict=True) if not is_near]
    wider = _without_doubles(evidence, effects, aside.signature[:, kept])
    return replace(ground, evidence=wider, aside=Aside(tuple(others), aside.signature[:, ~kept]))


def extended(request: Request, chosen: Sequence[Candidate], progress: Progress) -> Fit:
    """Fit the model with what a round chose; name the choice where the estimator cannot fit it."""
    base = request.base
    try:
        return extend(base, [c.effect for c in chosen], progress=progress, learn=False)
    except DataError as error:
        names = " and ".join(c.label for c in chosen)
        raise DataError(
            f"the search chose {names}, and the {base.estimator} estimator cannot fit it ({error}); diagnose with "
            f"another {Option.ESTIMATOR}"
        ) from error


def candidates(request: Request, tried: Sequence[Candidate], own: bool) -> list[Effect]:
    """Effects that a fit may lack: the user's, the catalogue, equations; without those tried or in the model.

    Parameters
    ----------
    own : bool
        Equations and sines of time too.
    """
    base = request.base
    times, has_temperature = base.timetable, base.has_temperature
    more = [*equations(has_temperature), *periodic(times.duration)] if own else []
    known = [*request.extra, *catalogue(times, set(base.labels), has_temperature), *more]
    known = [e for e in known if (e.family or e.name) not in request.without]
    if base.learns_scatter:
        known = [e for e in known if not e.needs_table and not e.random_walk and e.decay_s is None]
    return _untried(known, {c.label for c in tried} | base.labels)


def _without_doubles(evidence: LinearEvidence, equations: Sequence[Effect], signature: Floats) -> LinearEvidence:
    """Add equations, but those that a registered effect already is: the catalogue has the word."""
    n, p = len(evidence.names), len(evidence.weight)
    wider = evidence.with_effects(equations, signature)
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
