"""Step by step: add the best candidate, look again, until nothing stands out of the noise.

Orthogonal matching pursuit on the signatures: each step conditions on everything chosen so far. A chosen effect is
exchanged when another explains the same better once the others are in, and dropped when the others took its place.

A step must beat the noise of the whole scan, be plausible in size (Bayes factor with the physical prior), and lower the
error at stops that it has not seen. Once it beats the noise, its time or time constant is looked for between those of
the scan.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Generic

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.diagnosis.pairs import best_pair
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.scan import Scan, alike
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.evidence.candidate import Candidate, of_the_sensor
from sdimu_calibration.core.evidence.held_out import HeldOut, gain
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.posterior import Posterior

FALSE_ALARM = 0.02
"""Probability that pure noise puts one of all candidates over the threshold: what is bearable (5 %) with room for what
is not pure noise; at 0.01 effects of 5 sigma were found in 73 % of 49 tests instead of three quarters."""
MOST_STEPS = 40
"""Number of steps at most: more than any sensor that is worth a calibration has effects."""
_PATIENCE = 6
"""Number of steps from which a patchwork of drifts ends the search: before, other effects may take the drifts'
place."""
_PATCHES = 3
"""Number of drifts of one bias from which they are a patchwork: together they follow any wander."""
LOG_BAYES = 3.0
"""Least log Bayes factor (1) of an accepted step: odds of 20 to 1, "strong" on Jeffreys' scale."""
_SHARPER = 1.0
"""Gain of the log Bayes factor (1) from which a time or time constant between those of the scan is taken: less is not
worth its digits."""
_KEEP = 3.0
"""Size of a chosen effect (sigma), with the others in, below which it is dropped: they explain it."""


@dataclass(frozen=True)
class Step:
    """One rung of the ladder.

    Attributes
    ----------
    label, family, unit, display_unit : str
    z, threshold : float
        Score when it was tried, and what noise reaches.
    estimate, sigma : float
        SI, with everything chosen up to this step.
    log_likelihood_gain, log_bayes_factor : float
    held_out_before, held_out_after : HeldOut
    held_out_gain, held_out_error : float
        Log score over all stops, and its standard error.
    alike : tuple of str
        Labels of candidates that the data cannot tell from it.
    accepted : bool
    reason : str
        Why it was refused; empty when accepted.
    moved : tuple of (str, float)
        Coefficients of the model that were most wrong while it was missing: their errors, in their own sigmas.
    taken_out : str
        Why an accepted step is not among what was found in the end; empty when it is.
    """

    label: str
    family: str
    unit: str
    display_unit: str
    z: float
    threshold: float
    estimate: float
    sigma: float
    log_likelihood_gain: float
    log_bayes_factor: float
    held_out_before: HeldOut
    held_out_after: HeldOut
    held_out_gain: float
    held_out_error: float
    alike: tuple[str, ...]
    accepted: bool
    reason: str
    moved: tuple[tuple[str, float], ...] = field(default=())
    taken_out: str = ""

    @property
    def fate(self) -> str:
        """What became of it, in words."""
        if not self.accepted:
            return f"refused: {self.reason}"
        return f"added, then taken out: {self.taken_out}" if self.taken_out else "added"


@dataclass(frozen=True)
class Search(Generic[E]):
    """How far the search came.

    Attributes
    ----------
    steps : tuple of Step
        Accepted ones first to last; a refused one ends the list.
    chosen : ndarray of int, shape (k,)
        Columns of `evidence` that were accepted and not taken out again.
    first : Scan
        Before anything was added: of the model's columns and the allowed ones; of all columns where noise was learned.
    threshold : float
        Of the first scan.
    scale : float
        Residual noise over specified noise at the end.
    evidence : LinearEvidence
        With the finer variants that were chosen behind the candidates it had, in the noise that was learned.
    noise : tuple of NoiseTerm
        Noise with a memory.
    white : LinearEvidence or None
        The same evidence in white noise; None where that is what `evidence` is.
    joint : Joint or None
        Information on its columns and on wandering biases; None where noise was not learned.
    net : float
        Log-likelihood less what effects and noise terms cost; NaN where no noise was learned.
    stood : bool
        The choice stood at the end; False where the search went to and fro and the likeliest choice was taken.
    posterior : Posterior or None
        The models that the data leave probable; None where none was worked out.
    """

    steps: tuple[Step, ...]
    chosen: Ints
    first: Scan
    threshold: float
    scale: float
    evidence: E
    noise: tuple[NoiseTerm, ...] = ()
    net: float = float("nan")
    white: E | None = None
    joint: Joint | None = None
    stood: bool = True
    posterior: Posterior[E] | None = None


def search(
    evidence: E, allowed: Ints, alpha: float = FALSE_ALARM, most: int = MOST_STEPS, limit: float | None = None
) -> Search[E]:
    """Grow the model from the allowed candidates.

    Parameters
    ----------
    evidence : LinearEvidence
    allowed : ndarray of int, shape (a,)
        Columns that may be chosen.
    alpha : float
        False-alarm probability of a whole scan.
    most : int
        Steps at most.
    limit : float, optional
        Threshold of a scan of the same columns where it is known.
    """
    problem = Problem(evidence.only(allowed))
    chosen: list[int] = []
    steps: list[Step] = []
    scale = problem.scale(chosen)
    first = problem.scan(chosen, scale)
    # What is chosen changes the correlation of the others little: one threshold serves all steps.
    limit = problem.threshold(first, alpha) if limit is None else limit
    before = problem.held_out(chosen, 1.0)
    scanned = first
    while len(steps) < most and not (len(steps) >= _PATIENCE and patchwork(problem.candidate(c) for c in chosen)):
        scores = problem.scores(scanned, scale, chosen)
        above = np.where(np.abs(scanned.z) > limit, scores - problem.odds_against, -np.inf)
        best = int(np.argmax(above))
        if not np.isfinite(above[best]):
            pair = _with_pair(problem, chosen, limit, scale, before) if len(steps) + 2 <= most else None
            if pair is None:
                break
            added, chosen, before = pair
            steps += added
            scale = problem.scale(chosen)
            scanned = problem.scan(chosen, scale)
            continue
        finer = sharpen(problem, chosen, best)
        if finer:
            evidence = evidence.with_effects([finer])
            allowed = np.append(allowed, len(evidence.names) - 1)
            problem = Problem(evidence.only(allowed))
            best = problem.p + len(allowed) - 1
            scanned = problem.scan(chosen, scale)
            scores = problem.scores(scanned, scale, chosen)
        trial = _polish(problem, [*chosen, best])
        after = problem.held_out(trial, 1.0)
        step = judged(problem, scanned, scores, chosen, best, limit, before, after)
        steps.append(step)
        if not step.accepted:
            break
        chosen, before = trial, after
        scale = problem.scale(chosen)
        scanned = problem.scan(chosen, scale)
    back = np.array([allowed[c - problem.p] for c in chosen], dtype=np.int64)
    return Search(tuple(steps), back, first, limit, scale, evidence)


def _with_pair(
    problem: Problem[E], chosen: Sequence[int], limit: float, scale: float, before: HeldOut
) -> tuple[list[Step], list[int], HeldOut] | None:
    """Add two effects that hide each other: their steps, the choice, its held-out error; None where there are none."""
    allowed = np.arange(problem.p, len(problem.evidence.names))
    found = best_pair(problem, chosen, allowed, limit, scale)
    if found is None:
        return None
    trial = _polish(problem, [*found.others, *found.pair])
    after = problem.held_out(trial, 1.0)
    steps = []
    for column, other in (found.pair, found.pair[::-1]):
        beside = [*found.others, other]
        scanned = problem.scan(beside, scale)
        scores = problem.scores(scanned, scale, beside)
        steps.append(judged(problem, scanned, scores, beside, column, limit, before, after))
    return (steps, trial, after) if all(step.accepted for step in steps) else None


def patchwork(chosen: Iterable[Candidate]) -> bool:
    """Whether one bias drifts by so many effects at once that they follow any wander and say nothing of its cause."""
    drifts = {(c.family, c.effect.variant, c.effect.terms[0].channel) for c in chosen if c.effect.bias_drift}
    of_sensor = [sensor for _, _, sensor in drifts]
    return any(of_sensor.count(sensor) >= _PATCHES for sensor in of_sensor)


def look_alikes(problem: Problem[E], chosen: Sequence[int], column: int, allowed: Ints, scale: float) -> list[int]:
    """Columns that the data cannot tell from a chosen one, all others chosen being in the model.

    Parameters
    ----------
    problem : Problem
    chosen : sequence of int
        Columns of everything that was chosen.
    column : int
        The one of them.
    allowed : ndarray of int, shape (a,)
        Columns among which they are looked for.
    scale : float
        Residual noise over specified noise.

    Returns
    -------
    list of int
        Columns, the highest score first.
    """
    others = [c for c in chosen if c != column]
    # What else was found says which is the likelier cause, not what the data tell apart.
    scores = problem.scores(problem.scan(others, scale), scale)
    outside = np.ones(len(scores), dtype=bool)
    outside[allowed] = False
    outside[column] = False
    scores[outside] = -np.inf
    return alike(scores, column)


def sharpen(problem: Problem[E], chosen: Sequence[int], best: int) -> Effect | None:
    """Make the scan finer about the best candidate; None when no variant gains as much as `_SHARPER`."""
    p = problem.p
    candidate = problem.evidence.candidates[best - p]
    effect, name = candidate.effect, candidate.parameter.name
    small = problem.evidence.only(np.array(chosen, dtype=np.int64))
    others = list(range(p, p + len(chosen)))
    first = score = -np.inf
    while effect.nearer:
        variants = [variant.only((of_the_sensor(variant, name),)) for variant in effect.nearer()]
        trial = Problem(small.with_effects(variants))
        scores = trial.scores(trial.scan(others))[p + len(chosen) :]
        # The middle one is the candidate itself.
        first = scores[len(variants) // 2] if np.isinf(first) else first
        score = float(np.max(scores))
        effect = variants[int(np.argmax(scores))]
    return effect if score > first + _SHARPER else None


def _polish(problem: Problem[E], chosen: list[int]) -> list[int]:
    """Exchange each chosen column for the best one given the others until nothing changes; drop what they explain."""
    for _ in range(4):
        changed = False
        for place in range(len(chosen)):
            others = chosen[:place] + chosen[place + 1 :]
            scores = problem.scores(problem.scan(others, 1.0), beside=others) - problem.odds_against
            best = int(np.argmax(scores))
            if best != chosen[place] and scores[best] > scores[chosen[place]] + 1e-6:
                chosen = [*others[:place], best, *others[place:]]
                changed = True
        if not changed:
            break
    kept = list(chosen)
    for column in chosen:
        others = [c for c in kept if c != column]
        if abs(problem.scan(others, 1.0).z[column]) < _KEEP:
            kept = others
    return kept


def judged(
    problem: Problem[E],
    scanned: Scan,
    scores: Floats,
    chosen: Sequence[int],
    best: int,
    limit: float,
    before: HeldOut,
    after: HeldOut,
) -> Step:
    """Judge the addition of a column to a choice.

    Parameters
    ----------
    problem : Problem
    scanned : Scan
        With the choice in the model, the column not.
    scores : ndarray, shape (p + q,)
        Log posterior odds by that scan (1), as of `Problem.scores`.
    chosen : sequence of int
        Columns of the choice.
    best : int
        The column.
    limit : float
        Threshold of the scan.
    before, after : HeldOut
        Prediction of stops left out without and with the column.
    """
    evidence, p = problem.evidence, problem.p
    candidate = evidence.candidates[best - p]
    J, d = scanned.J[best], scanned.d[best]
    bayes = float(scores[best])
    # A fault of one turn is nowhere to be seen once the stop after it is left out; all others must gain by it.
    apart = int(candidate.effect.options["turn"]) if "turn" in candidate.effect.options else None
    won, error = gain(before, after, apart)
    reason = ""
    if not bayes > LOG_BAYES:
        reason = "not plausible in size for this grade of IMU"
    elif not won > (2.0 * error if candidate.family == "own" else 0.0):
        reason = "does not lower the error at stops that the fit has not seen"
    return Step(
        label=candidate.label,
        family=candidate.family,
        unit=candidate.parameter.unit,
        display_unit=candidate.parameter.display_unit,
        z=float(scanned.z[best]),
        threshold=limit,
        estimate=float(scanned.estimate[best]),
        sigma=float(scanned.sigma[best]),
        log_likelihood_gain=0.5 * d * d / J,
        log_bayes_factor=bayes,
        held_out_before=before,
        held_out_after=after,
        held_out_gain=won,
        held_out_error=error,
        alike=tuple(evidence.names[i] for i in alike(scores, best)),
        accepted=not reason,
        reason=reason,
        moved=_moved(problem, chosen, best, float(scanned.estimate[best])),
    )


def _moved(problem: Problem[E], chosen: Sequence[int], best: int, size: float) -> tuple[tuple[str, float], ...]:
    """Errors of the coefficients, in their own sigmas, while the effect was missing: the largest."""
    known, weight, _ = problem.known(chosen)
    J = problem.evidence.information.J
    A = J[np.ix_(known, known)] + np.diag(weight)
    unit = 1.0 / np.sqrt(np.diag(A))
    inverse = np.linalg.inv(A * np.outer(unit, unit)) * np.outer(unit, unit)
    change = inverse @ J[known, best] * size / np.sqrt(np.diag(inverse))
    # Neither attitudes nor the like, which only serve: coefficients of the model, and what was chosen before.
    told = [*range(problem.evidence.coefficients), *range(problem.p, len(known))]
    order = sorted(told, key=lambda i: -abs(change[i]))[:4]
    return tuple((problem.evidence.names[known[i]], float(change[i])) for i in order)
