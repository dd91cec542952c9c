"""What data so far know of coefficients, and what a plan tells beyond it.

A plan is judged by the information of perfect data (`bound.bounds`). What earlier data know is information on the same
coefficients, and the two add up: J = J_known + J_plan. A coefficient that is another one in the next recording (a bias
after switching on again) has there the value of the unit plus a deviation ``N(0, tau^2)``; the deviation is eliminated
from J_plan, ``J - J L (I + L' J L)^-1 L' J`` with L = diag(tau).

The gain of data is half the logarithm of the ratio of the determinants of the covariance before and after it: the
Shannon information that a Bayesian expects of them (D. Lindley, *Ann. Math. Stat.* 27 (1956); K. Chaloner &
I. Verdinelli, *Statistical Science* 10 (1995)). What nothing so far tells apart has a wide covariance along its
difference, so that a plan which tells it apart gains most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.linear import LinearEvidence

_ROUNDING = 1e-12
"""Ratio of an eigenvalue of the information, in units of the priors, to the largest (1) below which it is zero: an
inverse leaves so much rounding."""


@dataclass(frozen=True)
class Known:
    """What data so far know of coefficients.

    Attributes
    ----------
    names : tuple of str, length k
        Coefficients, in the frame of the prior.
    J : ndarray, shape (k, k)
        Information of the data alone, without any prior (1/SI^2).
    prior : ndarray, shape (k,)
        Sigma before all data (SI); inf where there is none.
    scatter : ndarray, shape (k,)
        Sigma (SI) by which the coefficient is another one in the next recording; 0 where it is the same.
    """

    names: tuple[str, ...]
    J: Floats
    prior: Floats
    scatter: Floats

    def of(self, names: Sequence[str], prior: Floats) -> Floats:
        """Information on other coefficients: what they lack is estimated along, what is not known here is zero.

        Parameters
        ----------
        names : sequence of str, length p
        prior : ndarray, shape (p,)
            Sigma of each before all data (SI): the unit of the answer.

        Returns
        -------
        ndarray, shape (p, p)
            Dimensionless.
        """
        along = [k for k, name in enumerate(self.names) if name not in names]
        shared = [k for k, name in enumerate(self.names) if name in names]
        J = self.J[np.ix_(shared, shared)]
        if along:
            unit = np.where(np.isfinite(self.prior[along]), self.prior[along], 1.0)
            stated = np.isfinite(self.prior[along]).astype(np.float64)
            across = self.J[np.ix_(shared, along)] * unit
            own = self.J[np.ix_(along, along)] * np.outer(unit, unit) + np.diag(stated)
            J = J - across @ np.linalg.pinv(own, hermitian=True) @ across.T
        places = [list(names).index(self.names[k]) for k in shared]
        out = np.zeros((len(names), len(names)))
        out[np.ix_(places, places)] = J * np.outer(prior[places], prior[places])
        return out

    def anew(self, names: Sequence[str]) -> Floats:
        """Sigma by which coefficients are others in the next recording.

        Parameters
        ----------
        names : sequence of str, length p

        Returns
        -------
        ndarray, shape (p,)
            SI.
        """
        known = dict(zip(self.names, self.scatter.tolist(), strict=True))
        return np.array([known.get(name, 0.0) for name in names])


def known_of(evidence: LinearEvidence, candidates: Ints, scatter: Sequence[float] = ()) -> Known:
    """Say what an evidence knows of the coefficients of its model and of some candidates.

    Attitudes are estimated along.

    Parameters
    ----------
    evidence : LinearEvidence
        Of one recording, or of a set.
    candidates : ndarray of int, shape (c,)
        Columns of W.
    scatter : sequence of float, length p + c
        As for `Known`; empty: all are the same in the next recording.
    """
    p = evidence.coefficients
    own = np.arange(p, len(evidence.weight))
    J = evidence.information.given(own, evidence.weight[own]).J
    keep = np.concatenate([np.arange(p), np.asarray(candidates, dtype=np.int64)]).astype(np.int64)
    first = len(evidence.weight)
    names = tuple(
        evidence.candidates[k - first].parameter.name if k >= first else evidence.names[k] for k in keep.tolist()
    )
    with np.errstate(divide="ignore"):
        model = 1.0 / np.sqrt(evidence.weight[:p])
    prior = np.concatenate([model, evidence.prior[keep[p:] - first]])
    return Known(names, J[np.ix_(keep, keep)], prior, np.asarray(scatter if len(scatter) else np.zeros(len(keep))))


def known_from(names: Sequence[str], covariance: Floats, prior: Floats, frame: Floats) -> Known:
    """Take the data's information out of an estimate in a reported body frame.

    The data say nothing of the turns of the body frame that the report pins, so the covariance of the free coefficients
    is ``(prior^-1 + J)^-1`` with the prior in that frame.

    Parameters
    ----------
    names : sequence of str, length p
    covariance : ndarray, shape (p, p)
        As reported (SI).
    prior : ndarray, shape (p,)
        Sigma before all data in the frame of the prior (SI).
    frame : ndarray, shape (p, p)
        Jacobian from the frame of the prior to the reported one (`body_frame.frame_jacobian`).
    """
    free = np.flatnonzero(np.diag(covariance) > 0.0)
    unit = np.sqrt(np.diag(covariance)[free])
    F = frame[free] * prior / unit[:, None]
    J = np.linalg.inv(covariance[np.ix_(free, free)] / np.outer(unit, unit)) - np.linalg.inv(F @ F.T)
    values, V = np.linalg.eigh(0.5 * (J + J.T))
    J = F.T @ (V * np.maximum(values, 0.0)) @ V.T @ F
    return Known(tuple(names), J / np.outer(prior, prior), prior, np.zeros(len(prior)))


def data_information(covariance: Floats, prior: Floats) -> Floats:
    """Information that data alone hold, of the covariance that they leave of a prior.

    Parameters
    ----------
    covariance : ndarray, shape (p, p)
        SI.
    prior : ndarray, shape (p,)
        Sigma of each before (SI).

    Returns
    -------
    ndarray, shape (p, p)
        In units of the priors.
    """
    # Inverted in units of its own sigmas: those of the priors are orders of magnitude apart from it.
    unit = np.sqrt(np.diag(covariance))
    size = prior / unit
    J = np.linalg.inv(covariance / np.outer(unit, unit)) * np.outer(size, size) - np.eye(len(prior))
    values, V = np.linalg.eigh(0.5 * (J + J.T))
    return np.asarray((V * np.where(values > _ROUNDING * values[-1], values, 0.0)) @ V.T)


def together(known: Known | None, names: Sequence[str], prior: Floats, plan: Floats | None) -> Floats:
    """Covariance of the coefficients of the unit after a plan, earlier data counted.

    Parameters
    ----------
    known : Known or None
        None: nothing but the prior.
    names : sequence of str, length p
    prior : ndarray, shape (p,)
        Sigma of each before all data (SI).
    plan : ndarray, shape (p, p), or None
        Covariance that the data of the plan alone leave of the prior (SI); None: before it is run.

    Returns
    -------
    ndarray, shape (p, p)
        SI.
    """
    p = len(prior)
    J = np.eye(p) if known is None else np.eye(p) + known.of(names, prior)
    if plan is not None:
        told = data_information(plan, prior)
        L = np.zeros(p) if known is None else known.anew(names) / prior
        varies = np.flatnonzero(L > 0.0)
        if len(varies):
            across = told[:, varies] * L[varies]
            own = np.eye(len(varies)) + told[np.ix_(varies, varies)] * np.outer(L[varies], L[varies])
            told = told - across @ np.linalg.solve(own, across.T)
        J = J + told
    covariance = np.linalg.inv(0.5 * (J + J.T))
    return np.asarray(0.5 * (covariance + covariance.T) * np.outer(prior, prior))


def gain(before: Floats, after: Floats) -> float:
    """Information that data add (nat): half the logarithm of the ratio of the determinants.

    Parameters
    ----------
    before, after : ndarray, shape (p, p)
        Covariances of the same coefficients (SI).
    """
    unit = 1.0 / np.sqrt(np.diag(before))
    scaled = (np.linalg.slogdet(C * np.outer(unit, unit))[1] for C in (before, after))
    return 0.5 * float(next(scaled) - next(scaled))
