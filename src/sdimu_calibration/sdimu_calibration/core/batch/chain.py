"""Least squares of a chain: unknowns of each link, coupled to the next link only, and unknowns common to all links.

Orthogonal elimination (Householder QR) link by link needs the memory of one link, whatever the length of the chain.
Rows are whitened (dimensionless); an unknown has whatever unit its columns imply.

Source: Bierman, *Factorization Methods for Discrete Sequential Estimation* (1977), ch. V; Björck, *Numerical Methods
for Least Squares Problems* (1996), section 6.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats


@dataclass(frozen=True)
class Link:
    """Whitened rows of one link, ``own @ y_k + common @ c = value``, and those that couple y_k to y_(k+1)."""

    rows: Floats
    """``[own, common, value]`` of this link alone, shape (r, q + p + 1)."""
    step: Floats
    """``[own, own of the next link, common, value]``, shape (s, 2 q + p + 1); s = 0 at the last."""


@dataclass(frozen=True)
class Solution:
    """Minimum of the sum of squares."""

    links: Floats
    """Unknowns of each link, shape (k, q)."""
    common: Floats
    """Common unknowns, shape (p,)."""
    covariance: Floats
    """Of the common unknowns, shape (p, p)."""
    chi2: float
    """Sum of squares at the minimum."""
    dof: int
    """Rows minus unknowns."""
    log_det: float
    """Sum of the logarithms of the triangular factor's diagonal."""


def solve(links: list[Link], q: int) -> Solution:
    """Solve the chain by elimination forwards and substitution backwards.

    Parameters
    ----------
    q : int
        Number of unknowns of a link.
    """
    p = links[0].rows.shape[1] - 1 - q
    carry = np.zeros((0, q + p + 1))
    eliminated: list[Floats] = []
    chi2, rows, log_det = 0.0, 0, 0.0
    for k, link in enumerate(links):
        rows += len(link.rows) + len(link.step)
        block = np.vstack([carry, link.rows])
        if k < len(links) - 1:
            none = np.zeros((len(block), q))
            block = np.vstack([np.hstack([block[:, :q], none, block[:, q:]]), link.step])
        R: Floats = np.asarray(np.linalg.qr(block, mode="r"))
        eliminated.append(R[:q])
        log_det += float(np.sum(np.log(np.abs(np.diag(R[:q, :q])))))
        # The last row of a factor that has one more row than unknowns is the residual that no unknown can take.
        width = block.shape[1]
        carry = R[q : width - 1, q:]
        if len(R) >= width:
            chi2 += float(R[width - 1, width - 1] ** 2)
    R_c = carry[:p, :p]
    common = np.linalg.solve(R_c, carry[:p, p])
    log_det += float(np.sum(np.log(np.abs(np.diag(R_c)))))
    inverse = np.linalg.inv(R_c)
    return Solution(
        _substitute(eliminated, common, q), common, inverse @ inverse.T, chi2, rows - q * len(links) - p, log_det
    )


def _substitute(eliminated: list[Floats], common: Floats, q: int) -> Floats:
    """Go back through the links."""
    out = np.zeros((len(eliminated), q))
    following = np.zeros(0)
    for k in range(len(eliminated) - 1, -1, -1):
        R = eliminated[k]
        rhs = R[:, -1] - R[:, q : q + len(following)] @ following - R[:, -1 - len(common) : -1] @ common
        out[k] = np.linalg.solve(R[:, :q], rhs)
        following = out[k]
    return out
