"""The one search: fit, take the evidence, choose, fit again about the choice, until the choice stands.

A large effect that is not in the model bends the fit about which everything is linear, and the error of that looks like
small companions of the effect. So each round fits with what the last one chose, takes the evidence there, and starts
the search afresh: what was chosen is one candidate among the others.

Where the estimator learns the scatter of its own run (handheld), a missing effect is learned as scatter. There the
choice grows by one effect a round, because each addition lets the scatter fall and shows what it hid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest, free_input_test
from sdimu_calibration.core.diagnosis.ground import Ground, Request, extended, fresh_ground, next_ground
from sdimu_calibration.core.diagnosis.noise_search import imitated
from sdimu_calibration.core.diagnosis.search import MOST_STEPS, Search, Step, search
from sdimu_calibration.core.diagnosis.window_search import search_window, with_steps
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.learned_noise import Wander
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.progress import Progress

UNEXPLAINED_P = 1e-3
"""Probability of the free-input test below which what is left is not noise: one sound test in a thousand is there."""
MOST_ROUNDS = 4
"""Number of rounds at most, where a round may choose any number of effects: a choice that does not stand by then goes
to and fro between effects that look alike."""
MOST_GROWING_ROUNDS = 8
"""Number of rounds at most, where a round adds one effect: more than a run by hand can tell apart."""
LEAST_SIGMAS = 3.0
"""Size of an effect in the fit (sigma) below which it is dropped: chance ends there."""
_MANY = 3
"""Number of chosen catalogue terms from which one equation is tried in their place: so many may be the parts of one
cause."""


@dataclass(frozen=True)
class Round:
    """One round.

    Attributes
    ----------
    fit : Fit
        About which this round is linear: the model with what the last round chose.
    evidence : LinearEvidence
    free : ndarray of int, shape (f,)
        Columns of the free inputs in `evidence`.
    found : Search
    left_before, left_after : FreeInputTest
        What is left with nothing added, and with `found` added.
    """

    fit: Fit
    evidence: LinearEvidence
    free: Ints
    found: Search[LinearEvidence]
    left_before: FreeInputTest
    left_after: FreeInputTest

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """What this round chose."""
        p = len(self.evidence.weight)
        return tuple(self.evidence.candidates[i - p] for i in self.found.chosen)

    @property
    def wants_equations(self) -> bool:
        """Whether something is left, or took suspiciously many terms, or looks like noise, or nothing helped."""
        refused = not len(self.free) and not len(self.found.chosen)
        many = len(self.found.chosen) >= _MANY
        return self.left_after.p_value < UNEXPLAINED_P or many or refused or bool(self.found.noise)


def search_until_stable(request: Request, progress: Progress) -> Round:
    """Repeat rounds until the choice stands, then drop what is small once it is fitted.

    Returns
    -------
    Round
        The last one; its fit holds what it chose.
    """
    base = request.base
    growing = base.learns_scatter
    ground = _first_ground(request, progress)
    own, asked = False, False
    limits: dict[bool, float] = {}
    done: Round | None = None
    steps: tuple[Step, ...] = ()
    seen = {frozenset[str]()}
    for turn in range(MOST_GROWING_ROUNDS if growing else MOST_ROUNDS):
        progress("candidates", min(0.8, 0.4 + 0.1 * turn))
        # Noise is a rival from the start; once effects were preferred to all of it, it need not be asked again.
        done = run_round(request, ground, own, limits, done)
        if done.wants_equations and not own and not asked:
            asked = True
            progress("equations", min(0.8, 0.45 + 0.1 * turn))
            wider = next_ground(request, ground.fit, ground.tried, True, done.found, ground.free)
            wide = run_round(request, wider, True, limits, done)
            if prefer(wide, done):
                done, own = wide, True
        labels = frozenset(c.label for c in done.chosen)
        new = tuple(s for s in done.found.steps if s.label not in {old.label for old in steps})
        steps = (*steps, *new) if growing else done.found.steps
        if labels == {c.label for c in ground.tried} or (growing and labels in seen):
            break
        seen.add(labels)
        trial = extended(request, done.chosen, progress)
        if growing and len(labels) <= len(ground.tried) and not _likelier(trial, ground.fit):
            done = _with_choice(done, ground.tried)
            break
        ground = next_ground(request, trial, done.chosen, own, done.found, ground.free)
    else:
        done = None if done is None else replace(done, found=replace(done.found, stood=False))
    if done is None:
        raise AssertionError("a search has one round at least")
    if done.found.posterior is not None:
        fit = in_found_noise(request, _with_chosen(request, done, progress), done.found.noise)
        return replace(done, fit=fit, found=with_steps(done.found))
    return drop_companions(request, replace(done, found=replace(done.found, steps=steps)), progress)


def _first_ground(request: Request, progress: Progress) -> Ground:
    """Take the evidence about the model as given, or about it with one effect where that is no fit at all.

    An error thousands of times the noise (a triad that is late) stands far outside what is linear: about the model as
    given the search explains its second order by dozens of companions.
    """
    base = request.base
    ground = fresh_ground(request, base, (), False)
    if not base.contradiction(base.statistics()):
        return ground
    found = search(ground.evidence, ground.allowed, request.alpha, most=1)
    p = len(found.evidence.weight)
    strongest = [found.evidence.candidates[i - p] for i in found.chosen]
    return fresh_ground(request, extended(request, strongest, progress), strongest, False) if strongest else ground


def _likelier(one: Fit, other: Fit) -> bool:
    return one.statistics().log_likelihood > other.statistics().log_likelihood


def _with_choice(done: Round, chosen: Sequence[Candidate]) -> Round:
    """Put another choice among the candidates of a round in place of its own."""
    p = len(done.evidence.weight)
    labels = [c.label for c in done.evidence.candidates]
    columns = np.array([p + labels.index(c.label) for c in chosen], dtype=np.int64)
    left_after = left(done.evidence, columns, done.free, done.found.scale)
    return replace(done, found=replace(done.found, chosen=columns), left_after=left_after)


def drop_companions(request: Request, done: Round, progress: Progress) -> Round:
    """Fit with what was chosen, in its noise; drop the weakest below `LEAST_SIGMAS` of its sigmas, one at a time."""
    small: set[str] = set()
    while True:
        chosen = done.chosen
        fit = in_found_noise(request, _with_chosen(request, done, progress), done.found.noise)
        size = fit.size_in_sigmas(len(chosen))
        keep = np.ones(len(size), dtype=bool)
        if len(size) and size.min() < LEAST_SIGMAS:
            weakest = int(np.argmin(size))
            keep[weakest] = False
            small.add(chosen[weakest].label)
        kept = done.found.chosen[keep]
        done = replace(done, fit=fit, found=replace(done.found, chosen=kept))
        if keep.all():
            steps = mark_dropped(done.found.steps, {c.label for c in done.chosen}, small)
            found = replace(done.found, steps=steps)
            return replace(done, found=found, left_after=left(done.evidence, kept, done.free, done.found.scale))


def in_found_noise(request: Request, fit: Fit, terms: Sequence[NoiseTerm]) -> Fit:
    """Estimate the coefficients of a fit in noise that was found."""
    if request.wander is None or not terms:
        return fit
    return in_noise(fit, fit.evidence(), request.wander, terms)


def _with_chosen(request: Request, done: Round, progress: Progress) -> Fit:
    """Fit with what a round chose: the fit of the round where that has the same effects in the same order."""
    base = request.base
    added = [c.label for c in done.chosen]
    fitted = [label for effect in done.fit.sensors.effects[len(base.sensors.effects) :] for label in effect.labels]
    if fitted == added:
        return done.fit
    return extended(request, done.chosen, progress) if added else base


def mark_dropped(steps: Sequence[Step], kept: set[str], small: set[str]) -> tuple[Step, ...]:
    """Mark the steps that are not among what was found, by their labels, with why; `small` were too small once in."""
    weak = f"calibrated with it, it is below {LEAST_SIGMAS:.0f} of its sigmas"
    gone = "what else was added explains the same better"
    stands = [not s.accepted or bool(s.taken_out) or s.label in kept for s in steps]
    return tuple(
        s if as_is else replace(s, taken_out=weak if s.label in small else gone)
        for s, as_is in zip(steps, stands, strict=True)
    )


def prefer(wide: Round, done: Round) -> bool:
    """Whether equations tell more than the catalogue.

    Of a posterior they are in the model then; a run by hand is asked for them where the catalogue has nothing.
    """
    if wide.found.posterior is not None:
        return any(c.family == "own" for c in wide.chosen)
    return len(wide.found.chosen) > 0 and not len(done.found.chosen)


def run_round(request: Request, ground: Ground, own: bool, limits: dict[bool, float], earlier: Round | None) -> Round:
    """Search the evidence about a fit.

    Parameters
    ----------
    request : Request
    ground : Ground
    own : bool
        Whether equations that are not in the catalogue are among its candidates.
    limits : dict of bool to float
        Thresholds of scans without and with equations, filled as they become known: the columns of all rounds are the
        same but for finer variants, and so is the threshold.
    earlier : Round, optional
        The round before.
    """
    learns = request.wander is None
    found = search_window(
        ground.evidence,
        ground.allowed,
        Wander.of(ground.evidence) if request.wander is None else request.wander,
        request.alpha,
        limits.get(own),
        # A fit that learns its scatter has signatures of its own each time.
        None if learns or earlier is None else earlier.found,
        tell_noise=not learns,
    )
    limits.setdefault(own, found.threshold)
    return _round(ground, found)


def _without_wander(evidence: LinearEvidence, allowed: Ints, alpha: float, most: int) -> Search[LinearEvidence]:
    """Search, and search again without the drifts of a triad whose bias only wanders."""
    while True:
        found = search(evidence, allowed, alpha, most)
        barred = imitated(found, allowed)
        if not len(barred):
            return found
        allowed = np.setdiff1d(allowed, barred)


def _round(ground: Ground, found: Search[LinearEvidence]) -> Round:
    fit, free = ground.fit, ground.free
    evidence, nothing = found.evidence, np.empty(0, dtype=np.int64)
    return Round(
        fit,
        evidence,
        free,
        found,
        left(evidence, nothing, free, found.scale),
        left(evidence, found.chosen, free, found.scale),
    )


def left(evidence: LinearEvidence, chosen: Ints, free: Ints, scale: float) -> FreeInputTest:
    """Free-input test with some candidates in the model.

    Parameters
    ----------
    evidence : LinearEvidence
    chosen : ndarray of int, shape (k,)
        Columns of the candidates.
    free : ndarray of int, shape (f,)
        Columns of the free inputs.
    scale : float
        Residual noise over specified noise.
    """
    known = np.concatenate([evidence.model, chosen]).astype(np.int64)
    weight = np.concatenate([evidence.weight, np.zeros(len(chosen))])
    return free_input_test(evidence.information, known, weight, free, scale)
