"""The least squares over all recordings of a set, with what differs from power-on to power-on as a random effect.

A coefficient of the unit has one value. One of scope power-on is, in power-on g, that of the unit plus a deviation
``N(0, tau^2)``; coefficients of one effect share tau. Deviations are eliminated before the recordings are summed, so
the work grows with the number of recordings and not with its square.

Source: D. Harville, "Maximum likelihood approaches to variance component estimation ...", J. Am. Stat.
Assoc. 72 (1977).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint.reduction import Reduction


@dataclass(frozen=True)
class Rows:
    """Data equations of a power-on in the parameters of the set."""

    A: Floats
    """Change of each row (1) per SI unit, shape (k, P)."""
    y: Floats
    """Shape (k,)."""


def spread_out(reduction: Reduction, names: Sequence[str]) -> Rows:
    """Put the rows of a recording at the places of the parameters of the set.

    Parameters
    ----------
    names : sequence of str, length P
        Parameters of the set; those that the recording lacks are zero columns.
    """
    place = {name: k for k, name in enumerate((*reduction.names, *reduction.labels))}
    A = np.zeros((len(reduction.y), len(names)))
    for column, name in enumerate(names):
        if name in place:
            A[:, column] = reduction.A[:, place[name]]
    return Rows(A, reduction.y)


def stacked(rows: Sequence[Rows]) -> Rows:
    """Put the rows of several recordings one below the other."""
    return Rows(np.vstack([r.A for r in rows]), np.concatenate([r.y for r in rows]))


@dataclass(frozen=True)
class Component:
    """Coefficients that differ from power-on to power-on with one variance."""

    effect: str
    """Name of the effect."""
    columns: Ints
    """Places of its coefficients among the parameters of the set, shape (v,)."""


@dataclass(frozen=True)
class JointEstimate:
    """Estimate of a set."""

    values: Floats
    """Shape (P,). SI; of a coefficient that varies the mean over all power-ons that might be."""
    covariance: Floats
    """Shape (P, P)."""
    deviation: Floats
    deviation_sigma: Floats
    """`deviation`, `deviation_sigma`: of each power-on from `values` (SI), in the order of the columns that vary, and
    their sigmas, shape (G, v)."""
    log_likelihood: float
    """Restricted: the parameters of the set are integrated over their priors."""


class Combination:
    """All power-ons of a set, ready to be combined for any size of what varies.

    Parameters
    ----------
    groups : sequence of Rows, length G
        One a power-on.
    weight : ndarray, shape (P,)
        Prior information of the parameters (1/SI^2), prior mean zero.
    """

    def __init__(self, groups: Sequence[Rows], weight: Floats, components: Sequence[Component]) -> None:
        J = np.stack([g.A.T @ g.A for g in groups])
        d = np.stack([g.A.T @ g.y for g in groups])
        self.squared = float(sum(g.y @ g.y for g in groups))
        self.components = tuple(components)
        self.varying = np.concatenate([np.empty(0, np.int64), *(c.columns for c in components)]).astype(np.int64)
        # In units in which every parameter has an information of one: SI units differ by many orders.
        self.unit = 1.0 / np.sqrt(np.diagonal(J, axis1=1, axis2=2).sum(axis=0) + weight)
        self.J = J * np.outer(self.unit, self.unit)
        self.d = d * self.unit
        self.weight = weight * self.unit**2

    def sizes(self, tau: Floats) -> Floats:
        """Sigma of each varying coefficient over its unit.

        Parameters
        ----------
        tau : ndarray, shape (c,)
            Sigma of each component (SI).

        Returns
        -------
        ndarray, shape (v,)
            Dimensionless.
        """
        counts = [len(c.columns) for c in self.components]
        return np.asarray(np.repeat(tau, counts) / self.unit[self.varying])

    def resolution(self, component: int) -> float:
        """Typical sigma (SI) with which one power-on alone tells the deviation of a component's coefficient."""
        columns = self.components[component].columns
        J = self.J[:, columns, columns] / self.unit[columns] ** 2
        return float(np.median(1.0 / np.sqrt(np.maximum(J, 1e-300))))

    def log_likelihood(self, tau: Floats) -> float:
        """Restricted log-likelihood of the sigmas.

        Parameters
        ----------
        tau : ndarray, shape (c,)
            SI.
        """
        constant, information = self.integrated(tau)
        return constant + information.log_likelihood(self.weight)

    def integrated(self, tau: Floats) -> tuple[float, Information]:
        """Integrate the deviations of all power-ons.

        Parameters
        ----------
        tau : ndarray, shape (c,)
            SI.

        Returns
        -------
        constant : float
            What the log-likelihood has beside that of the information (1).
        information : Information
            On the parameters, each in its `unit`.
        """
        return self._reduced(tau)[:2]

    def _reduced(self, tau: Floats) -> tuple[float, Information, Floats, Floats]:
        """Integrate as `integrated` does; M^-1 of each power-on and D [J d] of the varying rows besides."""
        v = self.varying
        D = self.sizes(tau)
        right = np.concatenate([self.J[:, v, :], self.d[:, v, None]], axis=2) * D[:, None]
        M = np.eye(len(v)) + self.J[:, v[:, None], v] * np.outer(D, D)
        inverse = np.linalg.inv(M)
        X = inverse @ right
        J = self.J.sum(axis=0) - np.einsum("gvp,gvq->pq", right[:, :, :-1], X[:, :, :-1])
        d = self.d.sum(axis=0) - np.einsum("gvp,gv->p", right[:, :, :-1], X[:, :, -1])
        constant = 0.5 * (np.einsum("gv,gv->", right[:, :, -1], X[:, :, -1]) - np.linalg.slogdet(M)[1].sum())
        return float(constant), Information(J, d), np.asarray(inverse), right

    def estimate(self, tau: Floats) -> JointEstimate:
        """Estimate all parameters and deviations, the sigmas given.

        Parameters
        ----------
        tau : ndarray, shape (c,)
            Sigma of each component (SI).
        """
        constant, information, inverse, right = self._reduced(tau)
        likelihood = constant + information.log_likelihood(self.weight)
        everything = np.arange(len(self.unit))
        values, covariance = information.estimate(everything, self.weight)
        D = self.sizes(tau)
        gain = inverse @ right[:, :, :-1]
        u = np.einsum("gvw,gw->gv", inverse, right[:, :, -1] - right[:, :, :-1] @ values)
        var_u = np.diagonal(inverse + gain @ covariance @ np.swapaxes(gain, 1, 2), axis1=1, axis2=2)
        unit = self.unit[self.varying] * D
        return JointEstimate(
            values * self.unit, covariance * np.outer(self.unit, self.unit), u * unit, np.sqrt(var_u) * unit, likelihood
        )
