"""Noise with a memory that explains what an effect does: how likely it is, and how much of each effect it takes.

Where an effect has the size b, a noise of covariance ``K = RR'`` that is not there gains, in the mean over the noise
that is,

    1/2 b^2 t - 1/2 sum_i [log(1 + l_i) - l_i / (1 + l_i)],   t = B' (I + L)^-1 B

L the eigenvalues of its modes' information ``R'AR``, A that on the mean errors in all stretches with the coefficients
estimated along, and B the information across the modes and the effect. It leaves the effect the information J - t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.evidence.noise_root import folded, spread
from sdimu_calibration.core.evidence.taken import taken
from sdimu_calibration.core.noise_term import AXES, MARKOV, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import Sizes, every_kind, log_odds
from sdimu_calibration.core.side_by_side import side_by_side

_VARIANCES = np.logspace(-3.0, 8.0, 34)
"""Variances (1) that are tried, over that at which the best seen mode is as large as its noise: a factor of two
apart; the likelihood of a size is wider."""
_STRONG = 8.0
"""Size of an effect (sigma) at which a noise must weigh as much as `_LIKELY` to be a rival: few effects are told at
larger ones alone."""
_LIKELY = 0.003
"""Weight (1) beside no noise at all below which a rival is left out: together they change no size by a hundredth."""
_PAIR = 2
"""Number of sensors (1) of choices that are left out: of one sensor and of all the noise is as good a rival."""
_MOST_TAKEN = 1.0 - 1e-9
"""Share (1) of the information on an effect that a noise takes at most: the rest is rounding."""


@dataclass(frozen=True)
class Rivals:
    """Noises of m kinds and sizes, and q candidates."""

    offset: Floats
    """Log of their weight beside none (1), shape (m,): odds, share of the size, and what they gain from noise alone."""
    taken: Floats
    """Share of the information on each candidate that each takes (1), shape (q, m)."""


def no_rivals(q: int) -> Rivals:
    """Give those of a test in which no noise with a memory is looked for."""
    return Rivals(np.zeros(0), np.zeros((q, 0)))


def rivals(joint: Joint, use: Ints, terms: Sequence[NoiseTerm], usual: Sizes, excess: float) -> Rivals:
    """Work out every kind of noise that may stand in the place of an effect.

    Parameters
    ----------
    joint : Joint
        Information on coefficients, candidates and mean errors in all stretches.
    use : ndarray of int, shape (q,)
        Columns of the candidates.
    terms : sequence of NoiseTerm
        Noise that is there.
    usual : Sizes
        Of each kind of noise.
    excess : float
        Variance of all noise over that of its models (1).
    """
    A, B, J = (part / excess for part in _blocks(joint, use, terms))
    there = {term.identity for term in terms}
    offset, share = [np.zeros(0)], [np.zeros((0, len(use)))]
    kinds, stands_for = _kinds(joint.wander.cut)
    kinds = [kind for kind in kinds if kind.identity not in there]
    found = side_by_side(lambda term: _of_kind(A, B, term, joint.wander.cut, usual), kinds)
    for term, (weight, part) in zip(kinds, found, strict=True):
        own = weight + (np.log(stands_for) if term.kind == MARKOV else 0.0)
        t = np.minimum(part / np.maximum(J, 1e-300), _MOST_TAKEN)
        likely = own + 0.5 * _STRONG**2 * t.max(axis=1, initial=0.0) > np.log(_LIKELY)
        offset.append(own[likely])
        share.append(t[likely])
    return Rivals(np.concatenate(offset), np.ascontiguousarray(np.vstack(share).T))


def _kinds(cut: Stretches) -> tuple[list[NoiseTerm], float]:
    """List kinds of noise that may be rivals, and for how many time constants each Gauss-Markov noise stands (1).

    Every second time constant, with the odds of its neighbours: the scores from which 690 effects are told in five
    recordings stay the same to 1 %, one to 10 %, for half of the decompositions.
    """
    alone = [kind for kind in every_kind(cut) if len(kind.axes) != _PAIR]
    taus = sorted({kind.tau for kind in alone if kind.kind == MARKOV})
    left_out = set(taus[1 : len(taus) - 1 : 2])
    stands_for = len(taus) / max(len(taus) - len(left_out), 1)
    return [kind for kind in alone if kind.kind != MARKOV or kind.tau not in left_out], stands_for or 1.0


def _blocks(joint: Joint, use: Ints, terms: Sequence[NoiseTerm]) -> tuple[Floats, Floats, Floats]:
    """Information on the errors of n cells (6 n, 6 n), across them and q candidates (6 n, q), on each of these (q,)."""
    evidence, cut = joint.evidence, joint.wander.cut
    p, full = len(evidence.weight), evidence.information.J
    own, across = joint.across[:p], full[:p][:, use]
    X = solved(full[:p, :p] + np.diag(evidence.weight), np.column_stack([own, across]))
    m = own.shape[1]
    A = joint.wander.U.square - own.T @ X[:, :m]
    B = joint.across[use].T - own.T @ X[:, m:]
    J = np.diag(full)[use] - np.einsum("pq,pq->q", across, X[:, m:])
    if terms:
        M, y, through = folded(A, np.zeros(m), terms, cut)
        modes = taken(M, y, np.vstack([through, spread(np.ascontiguousarray(B.T), terms, cut)])).Z
        A, B = A - modes[:, :m].T @ modes[:, :m], B - modes[:, :m].T @ modes[:, m:]
        J = J - np.einsum("rq,rq->q", modes[:, m:], modes[:, m:])
    return A, B, J


def _of_kind(A: Floats, B: Floats, term: NoiseTerm, cut: Stretches, usual: Sizes) -> tuple[Floats, Floats]:
    """Log weights of the sizes of one kind of noise (s,), and what each takes of q candidates (s, q)."""
    root = cut.mode(term.kind, term.tau)
    n, r = root.shape
    first, axes = 3 * TRIADS.index(term.triad), term.axes
    at = np.concatenate([np.arange(n) * 2 * len(AXES) + first + axis for axis in axes])
    spread_A = (A[np.ix_(at, at)].reshape(-1, n) @ root).reshape(len(at), len(axes) * r)
    M = np.vstack([root.T @ spread_A[k * n : (k + 1) * n] for k in range(len(axes))])
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    values = np.maximum(values, 0.0)
    if not values.max(initial=0.0) > 0.0:
        return np.zeros(0), np.zeros((0, B.shape[1]))
    across = vectors.T @ np.vstack([root.T @ B[at[k * n : (k + 1) * n]] for k in range(len(axes))])
    variance = _VARIANCES / values.max()
    ratio = variance[:, None] * values
    by_chance = 0.5 * np.sum(ratio / (1.0 + ratio) - np.log1p(ratio), axis=1)
    step = 0.5 * float(np.log(_VARIANCES[1] / _VARIANCES[0]))
    weight = by_chance + log_odds(term) + usual.log_density(term, np.sqrt(variance)) + np.log(step)
    return weight, (variance[:, None] / (1.0 + ratio)) @ across**2
