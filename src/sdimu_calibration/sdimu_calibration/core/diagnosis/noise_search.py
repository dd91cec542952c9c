"""The search where noise has a memory: effects and noise are judged with the other one learned again.

Noise that was learned without an effect takes the effect for noise, and an effect that was found in white noise may be
nothing but a wandering bias. So a candidate is worth what the likelihood gains when it comes in and the sizes of the
noise terms are optimised again, and an effect stays while the likelihood would fall by as much without it.

Two ways lead to a choice: from nothing, noise first; and from what the search in white noise chose. That with the
higher likelihood, less what its effects and noise terms cost, is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.pairs import best_pair
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.scan import Scan, scored
from sdimu_calibration.core.diagnosis.search import (
    FALSE_ALARM,
    LOG_BAYES,
    MOST_STEPS,
    Search,
    Step,
    judged,
    search,
    sharpen,
)
from sdimu_calibration.core.evidence.joint_information import Balance, Given, Joint, balance
from sdimu_calibration.core.evidence.learned_noise import Wander, with_alike
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.noise_term import DRAWN, TRIADS, NoiseTerm

_POOL = 4
"""Number of candidates, best in white noise and best in the noise as it stands, for which noise is learned again: the
truth was among them in every trial, and each costs tens of milliseconds."""
_COST = 8.0
"""Log-likelihood (1) that an effect must bring: half the square of the usual threshold of a whole scan, 4.0."""
_DRIFT_COST = 8.0
"""Log-likelihood (1) that the drift of a bias, or a transient of one, must bring besides where noise makes any triad
wander, and a fault of the recording in any noise: a wander has jumps, trends and transients by itself, and the
scan looks for them at every time and with every time constant."""
_OWN_COST = 16.0
"""Log-likelihood (1) that an equation must bring besides: a wander has waves of any period and phase."""
_UNKNOWN_COST = 6.0
"""Log-likelihood (1) that every effect must bring besides where errors are drawn anew: behind them is a cause that
depends on attitude or rate, and a candidate that resembles a share of it is no finding."""
_KEPT = 0.56
"""Share of its cost that a chosen effect must bring to stay: that of three sigma against four."""
_HOPELESS = 60.0
"""Log-likelihood (1) behind the better way from which the other is not followed: exchanges do not make up for it."""
_CLEAR = 10.0
"""Ratio of an effect to its sigma from which nobody asks whether noise explains the same: noise would have to grow
by the effect as a whole."""
_DOUBT = 3.0
"""Log-likelihood (1) by which a choice with an effect that noise imitates must beat noise: odds of 20 to 1."""
_MOST_CHOICES = 2 * MOST_STEPS
"""Number of choices that are gone through at most: one that adds an effect a step, and drops each again, needs no
more."""
_EXCHANGES = 3
"""Number of times that every chosen effect is compared with all others in its place: the second changes little."""


@dataclass(frozen=True)
class _State:
    """A choice of columns, and the noise that goes with it."""

    chosen: tuple[int, ...]
    balance: Balance


class _Ground(Generic[E]):
    """Evidence in white noise with its wander: what both ways search."""

    def __init__(self, evidence: E, allowed: Ints, wander: Wander, limit: float, earlier: Joint | None) -> None:
        self.evidence, self.allowed = evidence, allowed
        self.white = Problem(evidence)
        self.joint = Joint.of(evidence, wander, earlier)
        self.wander = wander
        self.limit = limit

    def doubtful(self, state: _State) -> bool:
        """Whether a chosen effect is one that wandering noise imitates, and not so large that noise cannot."""
        for column in state.chosen:
            others = [c for c in state.chosen if c != column]
            if self.beside(column) and abs(self.scanned(self.given(others), others, ()).z[column]) < _CLEAR:
                return True
        return False

    def beside(self, column: int) -> float:
        """Log-likelihood that an effect which a wander imitates must bring besides; 0 for every other."""
        candidate = self.white.candidate(column)
        if candidate.family == "own":
            return _OWN_COST
        effect = candidate.effect
        return _DRIFT_COST if effect.bias_drift or effect.wander_like or effect.scope == "recording" else 0.0

    def cost(self, column: int, terms: Sequence[NoiseTerm], share: float = 1.0) -> float:
        """Log-likelihood that an effect must bring in noise of these terms.

        `share` multiplies the part that every effect must bring, not the part of those that a wander imitates.
        """
        # One triad that wanders says of which kind the IMU is: the biases of its other triad wander as well.
        rival = self.white.candidate(column).effect.scope == "recording" or bool(terms)
        unknown = _UNKNOWN_COST if any(term.kind in DRAWN for term in terms) else 0.0
        return share * (max(_COST, 0.5 * self.limit**2) + unknown) + (self.beside(column) if rival else 0.0)

    def net(self, state: _State) -> float:
        """Log-likelihood of a state less what its effects and noise terms cost."""
        imitators = {self.white.kin[c - self.white.p]: self.beside(c) for c in state.chosen if self.beside(c)}
        # One step or ramp, of any number of sensors, is as good as any effect; several follow what has another cause.
        several = sum(sorted(imitators.values())[1:])
        return state.balance.net - sum(self.cost(c, state.balance.terms) for c in state.chosen) - several

    def given(self, chosen: Sequence[int]) -> Given:
        """Information on everything else with a choice in the model."""
        known, weight, _ = self.white.known(chosen)
        return self.joint.given(known, weight)

    def state(self, chosen: Sequence[int], start: Sequence[NoiseTerm] = (), more: bool = True) -> _State:
        """Learn the noise that goes with a choice."""
        return _State(tuple(chosen), balance(self.given(chosen).noise, self.wander, start, more))

    def scanned(self, given: Given, chosen: Sequence[int], terms: Sequence[NoiseTerm]) -> Scan:
        """Score the allowed columns with a choice in the model, in noise of these terms."""
        known, _, _ = self.white.known(chosen)
        out = scored(*given.in_noise(terms), np.diag(self.evidence.information.J), known, 1.0)
        barred = np.ones(len(out.z), dtype=bool)
        barred[self.allowed] = False
        return replace(out, z=np.where(barred, 0.0, out.z), sigma=np.where(barred, np.inf, out.sigma))

    def in_noise(self, terms: Sequence[NoiseTerm]) -> E:
        """Return the evidence in noise of these terms."""
        if not terms:
            return self.evidence
        return self.evidence.with_noise(self.wander.modes(terms).columns, self.joint.in_noise(terms))

    def with_finer(self, terms: Sequence[NoiseTerm], chosen: Sequence[int], best: int) -> _Ground[E]:
        """Return the ground with a variant of the column `best` between those of the scan, where that is worth it."""
        finer = sharpen(Problem(self.in_noise(terms)), chosen, best)
        if finer is None:
            return self
        evidence = self.evidence.with_effects([finer])
        allowed = np.append(self.allowed, len(evidence.names) - 1)
        return _Ground(evidence, allowed, self.wander, self.limit, self.joint)


def search_with_noise(
    evidence: E,
    allowed: Ints,
    wander: Wander,
    alpha: float = FALSE_ALARM,
    limit: float | None = None,
    doubted: bool = True,
    earlier: Joint | None = None,
) -> Search[E]:
    """Grow the model from the allowed candidates, and the noise with it.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise.
    allowed : ndarray of int, shape (a,)
        Columns that may be chosen.
    wander : Wander
        Of the same test.
    alpha : float
        False-alarm probability of a whole scan.
    limit : float, optional
        Threshold of a scan of the same columns where it is known.
    doubted : bool
        Ask whether noise alone explains what the search in white noise explains by effects.
    earlier : Joint, optional
        Of a search of the same signatures, or of the first ones of them.
    """
    white = search(evidence, allowed, alpha, MOST_STEPS, limit)
    # The white search adds finer variants behind the candidates: they may be chosen too.
    allowed = np.concatenate([allowed, np.arange(len(evidence.names), len(white.evidence.names))])
    ground = _Ground(white.evidence, allowed, wander, white.threshold, earlier)
    from_white = ground.state(white.chosen.tolist())
    if not doubted and not from_white.balance.terms:
        return replace(white, net=ground.net(from_white), joint=ground.joint)
    bare = ground.state(()) if len(white.chosen) else from_white
    if not from_white.balance.terms and ground.net(from_white) > ground.net(bare) and not ground.doubtful(from_white):
        # White noise will do for what is left, and the effects tell more than noise alone would.
        return replace(white, net=ground.net(from_white), joint=ground.joint)
    states = []
    for state in (from_white, bare):
        if ground.net(state) > max(ground.net(from_white), ground.net(bare)) - _HOPELESS:
            ground, settled, stood = _settled(ground, state)
            states.append((settled, stood))
    best, stood = max(states, key=lambda s: ground.net(s[0]) - _DOUBT * ground.doubtful(s[0]))
    return replace(_told(ground, best, white), stood=stood)


def imitated(found: Search[E], allowed: Ints) -> Ints:
    """Columns of drifts that stand for a wandering bias: noise with a memory explains as much as one that was chosen.

    A run by hand learns its scatter as white noise, and a bias that wanders is then a step, a ramp or a transient of
    some sensor to the search.

    Parameters
    ----------
    found : Search
        In white noise.
    allowed : ndarray of int, shape (a,)
        Columns that may be chosen.

    Returns
    -------
    ndarray of int, shape (b,)
        All drifts of the triads concerned, but for those that tell more than noise does.
    """
    problem, chosen = Problem(found.evidence), found.chosen.tolist()

    def drifts(columns: Sequence[int]) -> list[int]:
        return [c for c in columns if problem.candidate(c).effect.bias_drift]

    if not drifts(chosen):
        return np.empty(0, dtype=np.int64)
    ground = _Ground(found.evidence, allowed, Wander.of(found.evidence), found.threshold, None)
    out: set[str] = set()
    more: set[str] = set()
    for column in drifts(chosen):
        others = [c for c in chosen if c != column]
        gain = ground.state(chosen).balance.net - ground.state(others).balance.net
        if gain < ground.cost(column, ()) + _DOUBT:
            out |= _triads(ground, column)
        else:
            more.add(ground.white.candidate(column).parameter.name)
    barred = [c for c in drifts(allowed.tolist()) if _triads(ground, c) & out]
    return np.array([c for c in barred if problem.candidate(c).parameter.name not in more], dtype=np.int64)


def _triads(ground: _Ground[E], column: int) -> set[str]:
    return {TRIADS[term.channel // 3] for term in ground.white.candidate(column).effect.terms}


def _settled(ground: _Ground[E], state: _State) -> tuple[_Ground[E], _State, bool]:
    """Drop, add and exchange until nothing changes; whether that came to pass.

    What is added is judged in the noise before it, what is dropped in the noise after it: the two may undo each other
    for ever. Where a choice comes back the likeliest of the round trip is taken.
    """
    state = _pruned(ground, state)
    seen = {_labels(ground, state): state}
    while len(state.chosen) < MOST_STEPS:
        ground, wider = _grown(ground, state)
        wider = wider or _with_pair(ground, state)
        if wider is None:
            break
        state = _pruned(ground, wider)
        labels = _labels(ground, state)
        if labels in seen or len(seen) >= _MOST_CHOICES:
            return ground, max(seen.values(), key=ground.net), False
        seen[labels] = state
    return ground, _pruned(ground, _exchanged(ground, state)), True


def _labels(ground: _Ground[E], state: _State) -> frozenset[str]:
    """Say what a state holds: its effects and its kinds of noise."""
    effects = (ground.evidence.names[column] for column in state.chosen)
    return frozenset((*effects, *(f"{term.triad} {term.kind} {term.tau}" for term in state.balance.terms)))


def _grown(ground: _Ground[E], state: _State) -> tuple[_Ground[E], _State | None]:
    """Add the best candidate; None when none is worth it."""
    best, terms = _best_addition(ground, state)
    if best is None:
        return ground, None
    finer = ground.with_finer(terms, state.chosen, best)
    if finer is not ground:
        best = len(finer.evidence.names) - 1
    return finer, finer.state([*state.chosen, best], terms)


def _with_pair(ground: _Ground[E], state: _State) -> _State | None:
    """Add two effects that hide each other, or put them in the place of one; None when that is worth nothing."""
    terms = state.balance.terms
    found = best_pair(Problem(ground.in_noise(terms)), state.chosen, ground.allowed, ground.limit)
    if found is None:
        return None
    other = ground.state([*found.others, *found.pair], terms)
    return other if ground.net(other) > ground.net(state) + 1e-6 else None


def _best_addition(ground: _Ground[E], state: _State) -> tuple[int | None, tuple[NoiseTerm, ...]]:
    given, terms = ground.given(state.chosen), state.balance.terms
    noisy = ground.scanned(given, state.chosen, terms)
    scores = ground.white.scores(noisy, beside=state.chosen)
    pool = _first(scores) | _first(ground.white.scores(ground.scanned(given, state.chosen, ()), beside=state.chosen))
    best, best_score, best_terms = None, LOG_BAYES, terms
    for column in sorted(pool):
        weight = ground.white.known([column])[1][-1]
        found = balance(given.with_column(column, float(weight)), ground.wander, terms, more=False)
        gain = found.net - state.balance.net
        # What a size costs before it is known is the same in any noise.
        occam = 0.5 * noisy.z[column] ** 2 - scores[column]
        score = gain - (occam if np.isfinite(occam) else np.inf)
        if gain > ground.cost(column, found.terms) and score > best_score:
            best, best_score, best_terms = column, score, found.terms
    return best, best_terms


def _first(scores: np.ndarray) -> set[int]:
    order = np.argsort(-scores)[:_POOL]
    return {int(i) for i in order if np.isfinite(scores[i])}


def _pruned(ground: _Ground[E], state: _State) -> _State:
    """Drop the effect that is worth least, while it is worth less than `_KEPT` of its cost."""
    while state.chosen:
        terms = state.balance.terms
        without: list[tuple[float, int, _State]] = []
        for column in state.chosen:
            others = [c for c in state.chosen if c != column]
            given = ground.given(others)
            if abs(ground.scanned(given, others, terms).z[column]) < _CLEAR:
                # What was white with an effect may need noise without it.
                other = _State(tuple(others), balance(given.noise, ground.wander, terms, more=not terms))
                worth = state.balance.net - other.balance.net - ground.cost(column, terms, _KEPT)
                without.append((worth, len(without), other))
        if not without or min(without)[0] > 0.0:
            break
        state = min(without)[2]
    return state


def _exchanged(ground: _Ground[E], state: _State) -> _State:
    """Put another effect in the place of one where that explains more."""
    for _ in range(_EXCHANGES):
        before = state
        for column in before.chosen:
            others = [c for c in state.chosen if c != column]
            scanned = ground.scanned(ground.given(others), others, state.balance.terms)
            scores = ground.white.scores(scanned, beside=others)
            best = int(np.argmax(scores))
            if best != column and scores[best] > scores[column]:
                other = ground.state([*others, best], state.balance.terms, more=False)
                state = other if ground.net(other) > ground.net(state) + 1e-6 else state
        if state.chosen == before.chosen:
            break
    return state


def _told(ground: _Ground[E], state: _State, white: Search[E]) -> Search[E]:
    """Put the search together: every step judged in the noise of the end."""
    evidence = ground.in_noise(state.balance.terms)
    problem = Problem(evidence)
    steps: list[Step] = []
    before = problem.held_out([], 1.0)
    nothing = ground.scanned(ground.given(()), (), state.balance.terms)
    for k, column in enumerate(state.chosen):
        chosen = state.chosen[:k]
        scanned = ground.scanned(ground.given(chosen), chosen, state.balance.terms)
        after = problem.held_out([*chosen, column], 1.0)
        scores = problem.scores(scanned, beside=chosen)
        step = judged(problem, scanned, scores, chosen, column, ground.limit, before, after)
        steps.append(replace(step, accepted=True, reason=""))
        before = after
    gone = {s.label for s in steps}
    told = [
        replace(s, taken_out="noise with a memory explains the same") if s.accepted else s
        for s in white.steps
        if s.label not in gone and s.accepted
    ]
    columns = np.array(state.chosen, dtype=np.int64)
    terms = with_alike(ground.given(state.chosen).noise, ground.wander.cut, state.balance.terms)
    return Search(
        (*told, *steps),
        columns,
        nothing,
        ground.limit,
        1.0,
        evidence,
        terms,
        ground.net(state),
        ground.evidence,
        ground.joint,
    )
