"""What an error that follows the attitude looks like: its posterior mean in each stretch, with its band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.noise_term import ATTITUDE, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import Posterior


@dataclass(frozen=True)
class UnknownFunction:
    """Error of the three sensors of a triad that follows the attitude, in n stretches.

    Attributes
    ----------
    triad : str
    force : ndarray, shape (n, 3)
        Mean direction of the specific force, in b (1).
    turning : ndarray of bool, shape (n,)
    mean, sigma : ndarray, shape (n, 3)
        Error of each axis and its sigma (SI); about its mean over the dwells, which is a bias.
    """

    triad: str
    force: Floats
    turning: Bools
    mean: Floats
    sigma: Floats


def unknown_functions(found: Posterior[E], terms: Sequence[NoiseTerm]) -> tuple[UnknownFunction, ...]:
    """Estimate each error that follows the attitude among the terms of a noise, beside what is told.

    Parameters
    ----------
    found : Posterior
    terms : sequence of NoiseTerm
        The noise that is told.
    """
    board = found.board
    wander = board.wander
    force = None if wander is None else wander.cut.force
    if wander is None or force is None or not any(t.kind == ATTITUDE for t in terms):
        return ()
    cut, one = wander.cut, board.in_noise(NoiseModel(tuple(terms)))
    p = len(board.evidence.weight)
    members = found.told.members
    at = np.array([*range(p), *(p + k for k, _ in members)], dtype=np.int64)
    covariance = solved(one.J[np.ix_(at, at)] + np.diag(board.parameters(members)[1]), np.eye(len(at)))
    X = one.X[:, at]
    mode = one.u - X @ (covariance @ one.d[at])
    spread = one.inverse + X @ covariance @ X.T
    share = np.where(cut.turning, 0.0, cut.end - cut.start)
    share = share / share.sum()
    out = []
    for term, columns in zip(terms, _columns(terms, [cut.mode(t.kind, t.tau).shape[1] for t in terms]), strict=True):
        if term.kind != ATTITUDE:
            continue
        R = one.R[:, columns].reshape(len(cut), 6, -1)[:, 3 * TRIADS.index(term.triad) :][:, :3]
        R = R - np.einsum("s,scr->cr", share, R)[None]
        variance = np.einsum("scr,rq,scq->sc", R, spread[np.ix_(columns, columns)], R)
        out.append(UnknownFunction(term.triad, force, cut.turning, R @ mode[columns], np.sqrt(variance)))
    return tuple(out)


def _columns(terms: Sequence[NoiseTerm], modes: Sequence[int]) -> list[list[int]]:
    """Columns of each term in the root of a noise: triad by triad, of a triad mode by mode, of a mode axis by axis."""
    begin, out = 0, dict[int, list[int]]()
    for triad in TRIADS:
        for k, (term, count) in enumerate(zip(terms, modes, strict=True)):
            if term.triad == triad:
                out[k] = list(range(begin, begin + 3 * count))
                begin += 3 * count
    return [out[k] for k in range(len(terms))]
