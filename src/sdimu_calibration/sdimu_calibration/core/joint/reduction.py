"""What one recording says of an IMU: the rows of its least squares, compressed to as many as there are parameters.

With whitened residuals and signatures ``[W e]`` and ``Q`` orthogonal, the rows of ``Q' [W e]`` have white noise again.
As many rows as W has independent columns hold all information on the parameters; nothing explains what is left of
e.

Source: G. Bierman, *Factorization Methods for Discrete Sequential Estimation* (1977), chapter IV (data equations).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.references import SITE_REFERENCES
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.joint.shared_function import is_weight
from sdimu_calibration.core.noise_term import NoiseTerm

_ROUNDING = 1e-12
"""Ratio of an eigenvalue of the information, in units of the columns, to the largest from which it counts: below is
rounding of sums over 1e5 rows."""
_TELLS = 0.005
"""Length of a row in units of the prior sigmas (1) from which it counts: a shorter one changes no sigma by 2e-5 of it,
and with all the error that the linear model leaves in it (6 of its sigmas were seen) no estimate by .03 of its sigma.
It is the difference of columns that are linear to 1e-5, as of gravity and a common scale factor, and holds what the
linear model leaves there, which is no white noise."""


@dataclass(frozen=True)
class Reduction:
    """Rows ``y = A theta + white noise`` of one recording, linear about a point."""

    names: tuple[str, ...]
    """Coefficients of the estimator, length p."""
    labels: tuple[str, ...]
    """Parameters of effects that the model lacks, length q."""
    A: Floats
    """Change of each row (1) per SI unit of each parameter, shape (k, p + q)."""
    y: Floats
    """Rows with all parameters at zero (1), shape (k,)."""
    point: Floats
    """Coefficients (SI) about which the rows are linear, shape (p,)."""
    weight: Floats
    """Shape (p,). Prior information of the coefficients (1/SI^2), prior mean zero; not among the rows."""
    rows: int
    """Number of measurements that were compressed."""
    unexplained: float
    """Sum of squares (1) that no parameter explains."""

    def in_prior(self, weight: Mapping[str, float]) -> Reduction:
        """Return the rows with other prior information (1/SI^2) of the coefficients that are named."""
        pairs = zip(self.names, self.weight.tolist(), strict=True)
        return replace(self, weight=np.array([weight.get(name, own) for name, own in pairs]))


def reduced(evidence: LinearEvidence, terms: tuple[NoiseTerm, ...] = (), wander: Wander | None = None) -> Reduction:
    """Compress an evidence.

    Parameters
    ----------
    evidence : LinearEvidence
        N rows, in white noise; parameters behind its first `coefficients` are eliminated with their priors, but for the
        references of the site, which all recordings share.
    terms : tuple of NoiseTerm
        Noise with a memory that was learned in the recording.
    wander : Wander, optional
        As of `wander_in` for these terms, where it is known.
    """
    own = len(evidence.weight)
    kept, others = kept_and_others(evidence)
    order, p = np.concatenate([kept, others, np.arange(own, evidence.W.shape[1])]), len(kept)
    columns = np.column_stack([evidence.W[:, order], evidence.e])
    columns = whitened(columns, wander or wander_in(evidence, terms), terms) if terms else columns
    if own > p:
        columns = _without(columns, p, evidence.weight[others], evidence.shift[others])
    W, e = columns[:, :-1], columns[:, -1]
    A, y = _telling(*compressed(W, e), evidence.weight[kept])
    point = -evidence.shift[kept]
    return Reduction(
        tuple(evidence.names[k] for k in kept),
        evidence.names[own:],
        A,
        y + A[:, :p] @ point,
        point,
        evidence.weight[kept],
        len(evidence.e),
        float(e @ e - y @ y),
    )


def kept_and_others(evidence: LinearEvidence) -> tuple[Ints, Ints]:
    """Tell what all recordings share of a model from what is of the recording alone, as its attitude.

    Returns
    -------
    kept, others : ndarray of int, shapes (p,) and (o,)
        Columns of the evidence.
    """
    own = evidence.names[: len(evidence.weight)]
    apart = [k < evidence.coefficients or name in SITE_REFERENCES or is_weight(name) for k, name in enumerate(own)]
    return np.flatnonzero(apart), np.flatnonzero(np.logical_not(apart))


def compressed(W: Floats, e: Floats) -> tuple[Floats, Floats]:
    """Compress rows to as many as the rank of the signatures.

    With ``D W' W D = V diag(s^2) V'``, D the inverse lengths of the columns, the rows are ``diag(s) V' D^-1`` and
    ``diag(1/s) V' D W' e``.

    Parameters
    ----------
    W : ndarray, shape (N, m)
        Signatures, in white noise (1 per SI unit).
    e : ndarray, shape (N,)

    Returns
    -------
    A : ndarray, shape (k, m)
    y : ndarray, shape (k,)
        In the units of W and e.
    """
    length = np.sqrt(np.einsum("ij,ij->j", W, W))
    unit = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0.0)
    squares, V = np.linalg.eigh(W.T @ W * np.outer(unit, unit))
    seen = squares > _ROUNDING * squares[-1]
    V, size = V[:, seen], np.sqrt(squares[seen])
    return np.ascontiguousarray((size[:, None] * V.T) * length), (V.T @ (unit * (W.T @ e))) / size


def _telling(A: Floats, y: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Leave out rows that tell nothing of the first parameters, whose prior information is `weight`, nor of others."""
    squares, p = A[:, : len(weight)] ** 2 @ (1.0 / weight), len(weight)
    kept = (squares > _TELLS**2) | np.any(A[:, p:] != 0.0, axis=1)
    return A[kept], y[kept]


def _without(columns: Floats, p: int, weight: Floats, shift: Floats) -> Floats:
    """Eliminate parameters behind the first p, with their priors, from rows ``[W e]``: what is across their columns."""
    count = len(weight)
    prior = np.zeros((count, columns.shape[1]))
    prior[:, p : p + count] = np.diag(np.sqrt(weight))
    prior[:, -1] = np.sqrt(weight) * shift
    every = np.vstack([columns, prior])
    Q = np.linalg.qr(every[:, p : p + count])[0]
    rest = np.hstack([every[:, :p], every[:, p + count :]])
    return np.asarray(rest - Q @ (Q.T @ rest))


def whitened(columns: Floats, wander: Wander, terms: tuple[NoiseTerm, ...]) -> Floats:
    """Whiten columns in noise with a memory.

    Parameters
    ----------
    columns : ndarray, shape (N, m)
        In white noise.

    Returns
    -------
    ndarray, shape (N, m)
        ``S^-1/2 columns``, in the same units; S is the covariance of all noise.
    """
    inner = columns if wander.inner is None else wander.inner.whitened(columns)
    return unit_noise(wander.modes(terms).columns, inner)


def unit_noise(modes: InStops, columns: Floats) -> Floats:
    """Multiply with ``(I + modes modes')^-1/2``.

    Parameters
    ----------
    modes : InStops
        Signatures of modes of unit variance, N rows.
    columns : ndarray, shape (N, m)

    Returns
    -------
    ndarray, shape (N, m)
        In the units of `columns`.
    """
    squares, V = np.linalg.eigh(modes.square)
    root = np.sqrt(1.0 + np.maximum(squares, 0.0))
    # 1 - 1/root over the square, without the difference of what is nearly one.
    share = 1.0 / (root * (1.0 + root))
    taken = V @ (share[:, None] * (V.T @ modes.across(columns).T))
    return np.asarray(columns - modes.times(taken))
