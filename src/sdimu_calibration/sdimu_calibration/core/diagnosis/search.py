"""The search: the posterior over models, and what is told of it.

What is chosen are the members of the told model whose class is more probable than not; noise is told where it is
nearly certain. Everything else stays in the window of models, and in the sigmas.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.scan import Scan
from sdimu_calibration.core.diagnosis.step import Step, step_of
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.learned_noise import with_intervals
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import FOLLOWS, KINDS, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.board import Board
from sdimu_calibration.core.posterior.posterior import PROBABLE, Posterior, posterior
from sdimu_calibration.core.probability import normal_tail

FALSE_ALARM = 0.02
"""Probability (1) that pure noise puts one of all candidates over the threshold that is drawn beside a scan: one
scan in fifty."""
CERTAIN_NOISE = 0.95
"""Probability from which noise with a memory of a triad is told and stated with an interval: weaker noise is in every
sensor, and moves nothing."""


@dataclass(frozen=True)
class Search(Generic[E]):
    """What a search found."""

    steps: tuple[Step, ...]
    """What was found, one at a time."""
    chosen: Ints
    """Columns of `evidence` that are told, shape (k,)."""
    first: Scan
    """Before anything was added, of all columns."""
    threshold: float
    evidence: E
    """With the finer variants that were chosen behind the candidates it had, in the noise that was learned."""
    noise: tuple[NoiseTerm, ...] = ()
    """Noise with a memory."""
    white: E | None = None
    """The same evidence in white noise; None where that is what `evidence` is."""
    joint: Joint | None = None
    """Information on its columns and on wandering biases; None where noise was not learned."""
    stood: bool = True
    """The choice stood at the end; False where the search went to and fro and the last choice was taken."""
    posterior: Posterior[E] | None = None
    """The models that the data leave probable; None where none was worked out."""
    passed: int = 0
    """Number of equations that were looked at before the search, and are far from every model."""

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """What was found: the largest share of the misfit first."""
        return tuple(self.evidence.candidate(column) for column in self.chosen.tolist())

    @property
    def p_value(self) -> float:
        """Probability that noise puts any candidate as far out as the first of its scan (Bonferroni)."""
        return self.p_value_of(float(np.max(np.abs(self.first.z), initial=0.0)))

    def p_value_of(self, z: float) -> float:
        """Probability that noise puts any of the candidates that were looked at so far out (Bonferroni)."""
        count = int(np.isfinite(self.first.sigma).sum()) + self.passed
        return float(min(1.0, count * 2.0 * normal_tail(abs(z))))

    def columns_alike(self, place: int) -> list[int]:
        """Columns of what may be in the place of one of `chosen`, by its place there; the likeliest first."""
        if self.posterior is None or place >= len(self.chosen):
            return []
        return self.posterior.alike(int(self.chosen[place]))

    def alike(self, place: int) -> tuple[str, ...]:
        """Labels of the same."""
        return tuple(self.evidence.candidate(column).label for column in self.columns_alike(place))


def search(
    evidence: E,
    allowed: Ints,
    wander: Wander | None = None,
    alpha: float = FALSE_ALARM,
    limit: float | None = None,
    earlier: Search[E] | None = None,
    tell_noise: bool = True,
    make: type[Board[E]] | Callable[..., Board[E]] = Board,
) -> Search[E]:
    """Find the models that the data leave probable, and choose of them what is told.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise.
    allowed : ndarray of int, shape (a,)
        Columns that may be in a model.
    alpha : float
        False-alarm probability of the threshold of a scan, which is shown.
    limit : float, optional
        That threshold, where it is known.
    earlier : Search, optional
        About a point that differs little, with the same signatures or the first ones of them.
    tell_noise : bool
        Noise with a memory is told; without it is a rival of effects alone, for a fit that learns its scatter as white.
    make : callable
        Makes the board, of the parameters of `Board`.
    """
    joint = earlier.joint if earlier else None
    if joint and joint.wander is not wander:
        # Information on the wander in other stretches does not hold.
        joint = None
    found = posterior(evidence, allowed, wander, joint, earlier.posterior if earlier else None, make)
    board = found.board
    terms = told_noise(found) if tell_noise else ()
    noisy = in_noise(board, terms)
    problem = Problem(noisy)
    first = problem.scan([])
    barred = np.setdiff1d(np.arange(problem.p, len(first.z)), board.allowed)
    first.z[barred], first.sigma[barred] = 0.0, np.inf
    limit = problem.threshold(first, alpha) if limit is None else limit
    return Search(
        (),
        np.array(told_effects(found), dtype=np.int64),
        first,
        limit,
        noisy,
        terms,
        white=board.evidence,
        joint=board.joint,
        posterior=found,
    )


def in_every_noise(found: Search[E]) -> Search[E]:
    """Weigh all kinds of noise beside the best effects, and tell what is nearly certain of them.

    Parameters
    ----------
    found : Search
        Of the last round, with noise that is told: a round goes on with the kinds of the one before.
    """
    if found.posterior is None or not found.posterior.board.has_noises:
        return found
    window = found.posterior.in_every_noise()
    terms = told_noise(window)
    if terms == found.noise:
        return replace(found, posterior=window)
    return replace(found, posterior=window, noise=terms, evidence=in_noise(window.board, terms))


def with_steps(found: Search[E]) -> Search[E]:
    """Say of each effect what it adds to those before it, and of the noise how well its sizes are known.

    Parameters
    ----------
    found : Search
        Of the last round: what it says costs more than what it finds.
    """
    problem, chosen = Problem(found.evidence), found.chosen.tolist()
    steps: list[Step] = []
    before = problem.held_out([])
    for k, column in enumerate(chosen):
        scanned = problem.scan(chosen[:k])
        after = problem.held_out(chosen[: k + 1])
        steps.append(step_of(problem, scanned, chosen[:k], column, found.threshold, before, after, found.alike(k)))
        before = after
    return replace(found, steps=tuple(steps), noise=_stated(found))


def _stated(found: Search[E]) -> tuple[NoiseTerm, ...]:
    """Noise with intervals of its sizes, and the kinds that look the same."""
    window = found.posterior
    if not found.noise or window is None or window.board.joint is None or window.board.wander is None:
        return found.noise
    information = window.board.joint.on_wander(*window.board.parameters(window.told.members))
    return with_intervals(information, window.board.wander.cut, found.noise)


def told_effects(found: Posterior[E]) -> list[int]:
    """Columns of what is told: members of the told model whose class is probable, the largest share of misfit first."""
    members = found.told.members
    worth = -found.board.data(found.told.noise)[1].at(members).drops()
    order = [int(k) for k in np.argsort(-worth) if found.of_class(int(k)) > PROBABLE]
    columns = found.board.columns(members)
    return [columns[k] for k in order]


def told_noise(found: Posterior[E]) -> tuple[NoiseTerm, ...]:
    """Noise that is told: of triads where it is nearly certain, as the told model has it.

    What wanders beside a certain function of what is known is told where it is certain by itself.
    """
    out: list[NoiseTerm] = []
    for triad in TRIADS:
        own = [t for t in found.told.noise.terms if t.triad == triad]
        if own and found.of_noise(triad) > CERTAIN_NOISE:
            sure = [t for t in own if found.of_noise(triad, _sort(t)) > CERTAIN_NOISE]
            out += sure or own
    return tuple(out)


def _sort(term: NoiseTerm) -> list[str]:
    """Kinds of noise that follow something, or those that do not: whichever a term is of."""
    return [kind for kind in KINDS if (kind in FOLLOWS) == (term.kind in FOLLOWS)]


def in_noise(board: Board[E], terms: Sequence[NoiseTerm]) -> E:
    """Return the evidence of a board in a noise."""
    if not terms or board.joint is None or board.wander is None:
        return board.evidence
    return board.evidence.with_noise(board.wander.modes(terms).columns, board.joint.in_noise(terms))
