"""The one search: fit, take the evidence, choose, fit again about the choice, until the choice stands.

A large effect that is not in the model bends the fit about which everything is linear, and the error of that looks like
small companions of the effect. So each round fits with what the last one chose, takes the evidence there, and starts
the search afresh: what was chosen is one candidate among the others.

Where the estimator learns the scatter of its own run (handheld), a missing effect is learned as scatter: each addition
lets the scatter fall and shows what it hid, and the rounds go on until nothing more shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.free_input_test import FreeInputTest, free_input_test
from sdimu_calibration.core.diagnosis.ground import Ground, Request, extended, fresh_ground, next_ground
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.search import Search, in_every_noise, search, with_steps
from sdimu_calibration.core.diagnosis.unknown_attitude import with_attitude_functions
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.stretch_length import held, wander_in
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import ATTITUDE, NoiseTerm
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.results import NOT_TRUSTED

TO_AND_FRO = Note(
    "the search for missing effects went to and fro between choices that explain about the same, and was ended: one "
    f"of them is named, another may be right, and the estimate is {NOT_TRUSTED}",
    Topic.NOT_TRUSTED,
)
"""Finding, and warning of the result, where the search did not come to an end by itself: the coefficients depend on
which choice was the last."""
UNEXPLAINED_P = 1e-3
"""Probability of the free-input test below which what is left is not noise: one sound test in a thousand is there."""
MOST_ROUNDS = 4
"""Number of rounds at most, where a round may choose any number of effects: a choice that does not stand by then goes
to and fro between effects that look alike."""
_MOST_WHITENED = 2
"""Number of times (1) at most that rows are whitened in noise that was found: of the first round, and at the end."""
_ALIKE = 0.9
"""Correlation of the estimates of two effects of one sensor (1) from which they may be the parts of one cause: a square
and a magnitude are those of a fourth power."""
_MANY = 3
"""Number of chosen catalogue terms from which one equation is tried in their place: so many may be the parts of one
cause."""


@dataclass(frozen=True)
class Round:
    """One round."""

    fit: Fit
    """About which this round is linear: the model with what the last round chose."""
    evidence: LinearEvidence
    free: Ints
    """Columns of the free inputs in `evidence`, shape (f,)."""
    found: Search[LinearEvidence]
    left_before: FreeInputTest
    left_after: FreeInputTest
    """`left_before`, `left_after`: what is left with nothing added, and with `found` added."""

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """What this round chose."""
        return self.found.candidates

    @property
    def wants_equations(self) -> bool:
        """Whether something is left, or took suspiciously many terms, or looks like noise, or nothing helped."""
        refused = not len(self.free) and not len(self.found.chosen)
        parts = len(self.found.chosen) >= _MANY or self._has_parts
        return self.left_after.p_value < UNEXPLAINED_P or parts or refused or bool(self.found.noise)

    @property
    def _has_parts(self) -> bool:
        """Whether two effects that were chosen may be the parts of one cause."""
        chosen = self.found.chosen.tolist()
        if len(chosen) < 2:
            return False
        known, weight, _ = Problem(self.found.evidence).known(chosen)
        _, covariance = self.found.evidence.information.estimate(known, weight)
        return are_parts(self.chosen, covariance[-len(chosen) :, -len(chosen) :])


def are_parts(chosen: Sequence[Candidate], covariance: Floats) -> bool:
    """Whether two effects act on one sensor alone, and their estimates hang together: parts of one cause, perhaps.

    Parameters
    ----------
    chosen : sequence of Candidate, length k
    covariance : ndarray, shape (k, k)
        Of their estimates (SI).
    """
    sigma = np.sqrt(np.diag(covariance))
    sensors = [{term.channel for term in one.effect.terms} for one in chosen]
    return any(
        sensors[i] == sensors[k] and abs(covariance[i, k]) > _ALIKE * sigma[i] * sigma[k]
        for k in range(len(chosen))
        for i in range(k)
        if len(sensors[k]) == 1
    )


def searched(request: Request, progress: Progress) -> tuple[Request, Round]:
    """Search until the choice stands, then fit it in its noise.

    Where the noise that was found moves within stretches, rows are whitened in it and the search goes on. Only noise
    that stands beside the effects says what moves within stretches: without them it takes in what they do. So that of
    the first round, and that at the end, are looked at.

    Returns
    -------
    request : Request
        With the stretches, and functions of the attitude in its wander, of the last round.
    done : Round
        The last one; its fit holds what it chose.
    """
    first = ground = _first_ground(request, progress)
    progress("candidates", 0.4)
    done = run_round(request, ground, False, {}, None)
    within = _whitened(request, done)
    for left in reversed(range(_MOST_WHITENED + 1)):
        if within is None:
            request, done = search_until_stable(request, ground, done, progress)
            within = _whitened(request, done) if left else None
            if within is None:
                break
        request, ground, within = within, fresh_ground(within, first.fit, first.tried, False), None
        done = run_round(request, ground, False, {}, done)
    told = done.found if request.wander is None else in_every_noise(done.found)
    # Before the fit: its noise has the intervals that are stated here.
    done = replace(done, found=with_steps(told))
    fit = in_found_noise(request, _with_chosen(request, done, progress), done.found.noise)
    return request, replace(done, fit=fit)


def _whitened(request: Request, done: Round) -> Request | None:
    """Return the request in stretches that hold the noise of a round; None where its own do."""
    if request.wander is None or held(request.wander, done.found.noise):
        return None
    wander = wander_in(request.base.bare, done.found.noise)
    same = wander.inner is request.wander.inner and len(wander.cut) == len(request.wander.cut)
    return None if same else replace(request, wander=wander)


def search_until_stable(request: Request, ground: Ground, done: Round, progress: Progress) -> tuple[Request, Round]:
    """Repeat rounds until the choice stands.

    Parameters
    ----------
    ground : Ground
        Of the first round.
    done : Round
        The first round.

    Returns
    -------
    request : Request
        With functions of the attitude in its wander, where the last round had them.
    done : Round
        The last one.
    """
    own, asked, stood = False, False, False
    limits = {False: done.found.threshold}
    for turn in range(MOST_ROUNDS):
        beside = False
        if turn:
            progress("candidates", min(0.8, 0.4 + 0.1 * turn))
            done = run_round(request, ground, own, limits, done)
        if done.wants_equations and not own and not asked:
            asked = True
            progress("equations", min(0.8, 0.45 + 0.1 * turn))
            exact = with_attitude_functions(request, done.found)
            wider = next_ground(exact, ground, ground.fit, ground.tried, True, done.found)
            wide = run_round(exact, wider, True, limits, done)
            if any(c.family == "own" for c in wide.chosen) or ATTITUDE in {t.kind for t in wide.found.noise}:
                # Equations that come near beside a function of the attitude alone were not looked at yet.
                beside = exact is not request and turn + 1 < MOST_ROUNDS
                request, done, own, ground = exact, wide, True, wider
        stood = {c.label for c in done.chosen} == {c.label for c in ground.tried}
        if stood and not beside:
            break
        trial = ground.fit if stood else extended(request, done.chosen, progress)
        ground = next_ground(request, ground, trial, done.chosen, own, done.found)
    return request, replace(done, found=replace(done.found, stood=stood))


def _first_ground(request: Request, progress: Progress) -> Ground:
    """Take the evidence about the model as given, or about it with one effect where that is no fit at all.

    An error thousands of times the noise (a triad that is late) stands far outside what is linear: about the model as
    given the search explains its second order by dozens of companions.
    """
    base = request.base
    ground = fresh_ground(request, base, (), False)
    if not base.contradiction(base.statistics()):
        return ground
    found = search(ground.evidence, ground.allowed, None, request.alpha)
    strongest = found.candidates[:1]
    return fresh_ground(request, extended(request, strongest, progress), strongest, False) if strongest else ground


def in_found_noise(request: Request, fit: Fit, terms: Sequence[NoiseTerm]) -> Fit:
    """Estimate the coefficients of a fit in noise that was found."""
    if request.wander is None or not terms:
        return fit
    return in_noise(fit, terms, request.wander)


def _with_chosen(request: Request, done: Round, progress: Progress) -> Fit:
    """Fit with what a round chose: the fit of the round where that has the same effects in the same order."""
    base = request.base
    added = [c.label for c in done.chosen]
    fitted = [label for effect in done.fit.sensors.effects[len(base.sensors.effects) :] for label in effect.labels]
    if fitted == added:
        return done.fit
    return extended(request, done.chosen, progress) if added else base


def run_round(request: Request, ground: Ground, own: bool, limits: dict[bool, float], earlier: Round | None) -> Round:
    """Search the evidence about a fit.

    Parameters
    ----------
    own : bool
        Whether equations that are not in the catalogue are among its candidates.
    limits : dict of bool to float
        Thresholds of scans without and with equations, filled as they become known: all rounds look at the same columns
        but for finer variants, and so have the same threshold.
    earlier : Round, optional
        The round before.
    """
    learns = request.wander is None
    found = search(
        ground.evidence,
        ground.allowed,
        Wander.of(ground.evidence) if request.wander is None else request.wander,
        # Noise may put an equation that is passed over above the threshold, too.
        request.alpha * len(ground.allowed) / (len(ground.allowed) + ground.passed),
        limits.get(own),
        # A fit that learns its scatter has signatures of its own each time.
        None if learns or earlier is None else earlier.found,
        tell_noise=not learns,
    )
    limits.setdefault(own, found.threshold)
    return _round(ground, replace(found, passed=ground.passed))


def _round(ground: Ground, found: Search[LinearEvidence]) -> Round:
    fit, free = ground.fit, ground.free
    evidence, nothing = found.evidence, np.empty(0, dtype=np.int64)
    return Round(fit, evidence, free, found, left(evidence, nothing, free), left(evidence, found.chosen, free))


def left(evidence: LinearEvidence, chosen: Ints, free: Ints) -> FreeInputTest:
    """Free-input test with some candidates in the model.

    Parameters
    ----------
    chosen : ndarray of int, shape (k,)
        Columns of the candidates.
    free : ndarray of int, shape (f,)
        Columns of the free inputs.
    """
    # With their priors: what was chosen may have a combination that the data do not see.
    known, weight, _ = Problem(evidence).known(chosen.tolist())
    return free_input_test(evidence.information, known, weight, free)
