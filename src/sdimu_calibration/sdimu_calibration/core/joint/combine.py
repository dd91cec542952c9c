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


@dataclass(frozen=True)
class Line:
    """Restricted log-likelihood of one component's sigma, those of the others given.

    Rows ``A theta = y`` of the parameters of the set, each with the variance ``1 + square sigma^2``.
    """

    constant: float
    """What does not depend on the sigma (1)."""
    A: Floats
    """Shape (n, P); parameters in their units."""
    y: Floats
    """Shape (n,)."""
    square: Floats
    """Shape (n,). 1/SI^2."""
    rest: Information
    """Of the rows that see no deviation."""
    weight: Floats
    """Prior information of the parameters, shape (P,)."""

    def log_likelihood(self, sigma: float) -> float:
        """Restricted log-likelihood.

        Parameters
        ----------
        sigma : float
            Of the component (SI).
        """
        variance = 1.0 + self.square * sigma**2
        known = self.A / variance[:, None]
        constant = self.constant - 0.5 * float(np.log(variance).sum() + self.y**2 @ (1.0 / variance))
        information = Information(self.rest.J + known.T @ self.A, self.rest.d + known.T @ self.y)
        return constant + information.log_likelihood(self.weight)


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
        self.components = tuple(components)
        self.varying = np.concatenate([np.empty(0, np.int64), *(c.columns for c in components)]).astype(np.int64)
        own = [_varying_first(g, self.varying) for g in groups]
        squares = sum(np.sum(g.A**2, axis=0) for g in groups)
        # In units in which every parameter has an information of one: SI units differ by many orders.
        self.unit = 1.0 / np.sqrt(squares + weight)
        self.A = np.stack([seeing.A * self.unit for seeing, _ in own])
        self.y = np.stack([seeing.y for seeing, _ in own])
        rest = stacked([others for _, others in own])
        self.J_rest = (rest.A * self.unit).T @ (rest.A * self.unit)
        self.d_rest = (rest.A * self.unit).T @ rest.y
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
        """Typical sigma (SI) with which one power-on alone tells the deviation of a component's coefficient.

        Of the power-ons that see it at all; infinite where none does.
        """
        columns = self.components[component].columns
        J = np.sum((self.A[:, :, columns] / self.unit[columns]) ** 2, axis=1)
        return float(np.median(1.0 / np.sqrt(J[J > 0.0]))) if J.any() else float("inf")

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
        """Integrate as `integrated` does; the factor U of each power-on and its rows U u = b - B theta besides.

        Rows ``R D u + A theta = y`` of the deviations u, each of sigma one, and ``u = 0`` below them: a QR
        decomposition leaves the rows of u, and rows of theta alone. Differences of informations, and the covariance
        ``I + R D^2 R'``, lose to rounding what few power-ons know where D is large.
        """
        R = self.A[:, :, self.varying] * self.sizes(tau)
        constant, U, first, rest = self._without(R, self.A)
        A, y = rest[:, :, :-1].reshape(-1, len(self.unit)), rest[:, :, -1].ravel()
        return constant, Information(self.J_rest + A.T @ A, self.d_rest + A.T @ y), U, first

    def _without(self, R: Floats, others: Floats) -> tuple[float, Floats, Floats, Floats]:
        """Integrate deviations of sigma one that rows see by R, shape (G, k, v), beside columns that stay.

        Returns
        -------
        constant : float
            What the log-likelihood has beside that of the rows that are left (1).
        U, first, rest : ndarray
            As of `_reduced`: factor and rows of the deviations, then rows without them, the data last in each.
        """
        v = R.shape[2]
        rows = np.concatenate([R, others, self.y[:, :, None]], axis=2)
        prior = np.zeros((len(rows), v, rows.shape[2]))
        prior[:, range(v), range(v)] = 1.0
        T = np.asarray(np.linalg.qr(np.concatenate([rows, prior], axis=1), mode="r"))
        U, first, rest = T[:, :v, :v], T[:, :v, v:], T[:, v:, v:]
        determinant = np.log(np.abs(np.diagonal(U, axis1=1, axis2=2))).sum()
        return 0.5 * float(np.sum(first[:, :, -1] ** 2)) - float(determinant), U, first, rest

    def along(self, component: int, tau: Floats) -> Line:
        """Integrate the deviations of all components but one, whose sigma may then be anything.

        Parameters
        ----------
        component : int
            That one.
        tau : ndarray, shape (c,)
            Sigma of each component (SI); of that one it does not matter.
        """
        counts = [len(c.columns) for c in self.components]
        own = np.repeat(np.arange(len(counts)) == component, counts)
        R, v = self.A[:, :, self.varying], int(np.count_nonzero(own))
        one = R[:, :, own] / self.unit[self.varying][own]
        constant, _, _, rest = self._without((R * self.sizes(tau))[:, :, ~own], np.concatenate([one, self.A], axis=2))
        # Turned so that each row sees one combination of the deviations of its power-on, or none.
        turn, seen, _ = np.linalg.svd(rest[:, :, :v])
        turned = np.swapaxes(turn, 1, 2) @ rest[:, :, v:]
        square = np.zeros(turned.shape[:2])
        square[:, : seen.shape[1]] = seen**2
        constant += 0.5 * float(np.sum(turned[:, :, -1] ** 2))
        A, y = turned[:, :, :-1].reshape(-1, len(self.unit)), turned[:, :, -1].ravel()
        return Line(constant, A, y, square.ravel(), Information(self.J_rest, self.d_rest), self.weight)

    def estimate(self, tau: Floats) -> JointEstimate:
        """Estimate all parameters and deviations, the sigmas given.

        Parameters
        ----------
        tau : ndarray, shape (c,)
            Sigma of each component (SI).
        """
        constant, information, U, first = self._reduced(tau)
        likelihood = constant + information.log_likelihood(self.weight)
        everything = np.arange(len(self.unit))
        values, covariance = information.estimate(everything, self.weight)
        inverse = np.linalg.inv(U)
        gain = inverse @ first
        u = gain[:, :, -1] - gain[:, :, :-1] @ values
        spread = gain[:, :, :-1] @ covariance @ np.swapaxes(gain[:, :, :-1], 1, 2)
        var_u = np.sum(inverse**2, axis=2) + np.diagonal(spread, axis1=1, axis2=2)
        unit = self.unit[self.varying] * self.sizes(tau)
        return JointEstimate(
            values * self.unit, covariance * np.outer(self.unit, self.unit), u * unit, np.sqrt(var_u) * unit, likelihood
        )


def _varying_first(rows: Rows, varying: Ints) -> tuple[Rows, Rows]:
    """Turn the rows of a power-on so that the first, as many as vary, alone see what varies; those, and the others."""
    v, P = len(varying), rows.A.shape[1]
    order = np.concatenate([varying, np.setdiff1d(np.arange(P), varying)])
    R: Floats = np.asarray(np.linalg.qr(np.column_stack([rows.A[:, order], rows.y]), mode="r"))
    # The last row, where there is one, is what no parameter explains.
    first, rest = np.zeros((v, P + 1)), np.asarray(R[v:P])
    first[: min(v, len(R))] = R[:v]
    back: Ints = np.argsort(order)
    return Rows(first[:, back], first[:, P]), Rows(rest[:, back], rest[:, P])
