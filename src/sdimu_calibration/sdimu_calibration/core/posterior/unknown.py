"""What an error looks like that follows attitude, rate or temperature: its mean in each stretch, with its band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.evidence.noise_root import columns_of
from sdimu_calibration.core.evidence.taken import divided
from sdimu_calibration.core.noise_term import ATTITUDE, AXES, FOLLOWS, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import Posterior


@dataclass(frozen=True)
class UnknownFunction:
    """Error of sensors of a triad as a function of what it follows, in n stretches."""

    triad: str
    follows: str
    """One of `FOLLOWS`."""
    variable: Floats
    """Shape (n, k). What it follows: mean direction of the specific force in b (1), body rate (rad/s), or temperature
    (K)."""
    turning: Bools
    """Shape (n,)."""
    mean: Floats
    sigma: Floats
    """`mean`, `sigma`: shape (n, 3). Error of each axis and its sigma (SI); without its mean over the dwells, which is
    a bias, and of one of the attitude without what is linear in the force, which is in scale factors, misalignments and
    mass unbalances."""
    axes: tuple[int, ...] = AXES
    """Sensors that have it; of the others mean and sigma are zero."""


def unknown_functions(found: Posterior[E], terms: Sequence[NoiseTerm]) -> tuple[UnknownFunction, ...]:
    """Estimate each unknown function among the terms of a noise, beside what is told.

    Parameters
    ----------
    terms : sequence of NoiseTerm
        The noise that is told.
    """
    board = found.board
    wander = board.wander
    known = None if wander is None else wander.cut.conditions
    if wander is None or known is None or not any(t.kind in FOLLOWS for t in terms):
        return ()
    cut, one = wander.cut, board.in_noise(NoiseModel(tuple(terms)))
    p = len(board.evidence.weight)
    members = found.told.members
    at = np.array([*range(p), *(p + k for k, _ in members)], dtype=np.int64)
    covariance = solved(one.J[np.ix_(at, at)] + np.diag(board.parameters(members)[1]), np.eye(len(at)))
    of_modes = divided(one.modes.L, np.column_stack([one.modes.Z[:, at], one.modes.z]).T, turned=True)
    X = of_modes[:, :-1]
    mode = of_modes[:, -1] - X @ (covariance @ one.d[at])
    root = divided(one.modes.L, np.eye(len(mode)))
    spread = root.T @ root + X @ covariance @ X.T
    share = cut.in_dwells[: len(cut)]
    out = []
    for term, columns in zip(terms, columns_of(terms, cut), strict=True):
        if term.kind not in FOLLOWS:
            continue
        R = one.R[:, columns].reshape(cut.cells, 6, -1)[:, 3 * TRIADS.index(term.triad) :][:, :3]
        R = np.einsum("sn,ncr->scr", cut.at_stretches(term.kind), R)
        R = np.einsum("st,tcr->scr", left_by_coefficients(share, known.force if term.kind == ATTITUDE else None), R)
        variance = np.einsum("scr,rq,scq->sc", R, spread[np.ix_(columns, columns)], R, optimize=True)
        x, mean = known.variable(term.kind), R @ mode[columns]
        out.append(UnknownFunction(term.triad, term.kind, x, cut.turning, mean, np.sqrt(variance), term.axes))
    return tuple(out)


def left_by_coefficients(share: Floats, force: Floats | None = None) -> Floats:
    """Take out of an error what coefficients take up: its mean, and what is linear in the force.

    Parameters
    ----------
    share : ndarray, shape (n,)
        Weight of each stretch in these means (1).
    force : ndarray, shape (n, 3), optional
        Mean direction of the specific force in b (1); nothing linear is taken out without.

    Returns
    -------
    ndarray, shape (n, n)
        Errors in all stretches to what is left of them (1).
    """
    taken = np.ones((len(share), 1)) if force is None else np.column_stack([np.ones(len(share)), force])
    fitted = np.linalg.pinv(taken.T @ (share[:, None] * taken)) @ (taken.T * share)
    return np.asarray(np.eye(len(share)) - taken @ fitted)
