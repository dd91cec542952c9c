"""Which coefficient differs in which recording, and what its changes follow.

A recording r might have its own value of coefficient c: a column ``A_r,c`` that is zero in the rows of all other
recordings. Its score test given the joint estimate says how far it is from that of the others; the K scores of one
coefficient together are chi-square with K - 1 degrees of freedom, and their sum weighed with a covariate (temperature,
date) tests whether the coefficient follows it. Deviations that power-ons are allowed are part of the noise.

Source: C. R. Rao, "Large sample tests of statistical hypotheses ...", Proc. Cambridge Phil. Soc. 44 (1948).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.joint.combine import spread_out
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.scope import split_tag
from sdimu_calibration.core.joint.set_evidence import white_power_on
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.joint.shared_function import is_weight
from sdimu_calibration.core.probability import chi2_tail, normal_tail
from sdimu_calibration.core.results import SetTrend

_SEEN = 0.02
"""Share of the length of a column (1) that the joint estimate must leave: with less a recording says nothing of it."""
_RANK = 1e-6
"""Ratio of an eigenvalue to the largest from which it counts: below is rounding."""

_FEWEST_VALUES = 3
"""Number of different values of a covariate from which a coefficient can follow it: through two any line leads."""


@dataclass(frozen=True)
class Variation:
    """Coefficients of K recordings beside their joint estimate."""

    names: tuple[str, ...]
    """Length p."""
    z: Floats
    """Shape (K, p). Deviation of the recording over its sigma (1); NaN where it says nothing of the coefficient."""
    p_value: Floats
    """Probability (1) that coefficients that are constant scatter so far, shape (p,)."""
    trends: tuple[SetTrend, ...]
    """The likeliest covariate of each coefficient, the least probable first."""


@dataclass(frozen=True)
class _Scores:
    """Scores of every recording: gram (p, K, K) given the joint estimate, alone (K, p), d (K, p)."""

    gram: Floats
    alone: Floats
    d: Floats


def variation(fit: SetFit) -> Variation:
    """Test every coefficient in every recording."""
    shared = [n for n in fit.names if not (split_tag(n)[1] or is_weight(n))]
    scores = _scores(fit, len(shared))
    own = np.diagonal(scores.gram, axis1=1, axis2=2).T
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = own > _SEEN**2 * scores.alone
        z = np.where(seen, scores.d / np.sqrt(own), np.nan)
    p_value = np.array(
        [_scatter(scores.gram[c], scores.d[:, c], scores.alone[:, c], seen[:, c]) for c in range(len(shared))]
    )
    return Variation(tuple(shared), z, p_value, _trends(fit, shared, scores))


def _scores(fit: SetFit, p: int) -> _Scores:
    theta = fit.estimate.values
    K = len(fit.reports)
    d, X = np.zeros((K, p)), np.zeros((K, p, len(fit.names)))
    J = np.diag(fit.weight)
    within = np.zeros((p, K, K))
    for members in map(list, fit.groups):
        own = [spread_out(fit.reports[k].reduction, fit.names[:p]).A for k in members]
        rows, columns = white_power_on(fit, members, fit.names, own)
        a = np.stack(columns, axis=1)
        d[members] = np.einsum("kmp,k->mp", a, rows.y - rows.A @ theta)
        X[members] = np.einsum("kmp,kq->mpq", a, rows.A)
        within[np.ix_(range(p), members, members)] = np.einsum("kmp,knp->pmn", a, a)
        J += rows.A.T @ rows.A
    # The rows are white in the scatter that is likeliest: so is this covariance. That of the estimate is wider by what
    # few power-ons leave open of the scatter, and would take more from the scores than the joint estimate does.
    unit = 1.0 / np.sqrt(np.diag(J))
    P = np.linalg.inv(J * np.outer(unit, unit)) * np.outer(unit, unit)
    gram = within - np.einsum("mpq,qr,npr->pmn", X, P, X, optimize=True)
    return _Scores(gram, np.diagonal(within, axis1=1, axis2=2).T.copy(), d)


def _scatter(gram: Floats, d: Floats, alone: Floats, seen: Bools) -> float:
    """Probability of the scores of one coefficient; NaN where fewer than two recordings see it.

    A prior that holds the joint estimate back moves the scores of all recordings one way, each by its information.
    That is no scatter, so the test asks across that direction.
    """
    if seen.sum() < 2:
        return float("nan")
    size = np.sqrt(np.diag(gram)[seen])
    across = np.linalg.svd((alone[seen] / size)[None, :])[2][1:].T
    values, vectors = np.linalg.eigh(across.T @ (gram[np.ix_(seen, seen)] / np.outer(size, size)) @ across)
    counts = values > _RANK * values[-1]
    along = vectors[:, counts].T @ (across.T @ (d[seen] / size))
    return chi2_tail(float(np.sum(along**2 / values[counts])), float(counts.sum()))


def covariates(reports: Sequence[Report]) -> Mapping[str, Floats]:
    """List what coefficients may follow, of that what differs between the recordings.

    Returns
    -------
    mapping of str to ndarray, shape (K,)
        One number a recording, in the unit that the name says.
    """
    days = np.array([r.start_ns for r in reports], dtype=np.float64) / 86400e9
    # Recordings of one start have one place: nothing says which of them came first.
    order = np.unique(days, return_inverse=True)[1].astype(np.float64)
    all_of = {
        "temperature (degC)": np.array([r.temperature_degc for r in reports]),
        "date (d)": days - days.min(),
        "order": order,
    }
    return {name: x for name, x in all_of.items() if np.isfinite(x).all() and len(np.unique(x)) >= _FEWEST_VALUES}


def _trends(fit: SetFit, names: Sequence[str], scores: _Scores) -> tuple[SetTrend, ...]:
    known = covariates(fit.reports)
    found: list[SetTrend] = []
    for c, name in enumerate(names):
        best: SetTrend | None = None
        for covariate, x in known.items():
            centred = x - x.mean()
            J = float(centred @ scores.gram[c] @ centred)
            alone = float(centred**2 @ scores.alone[:, c])
            if _SEEN**2 * alone >= J:
                continue
            z = float(centred @ scores.d[:, c]) / np.sqrt(J)
            p = min(1.0, 2.0 * normal_tail(abs(z)) * len(names) * len(known))
            trend = SetTrend(name, covariate, z / np.sqrt(J), 1.0 / np.sqrt(J), p)
            # Of two that tell the same, the first: a temperature says more than an order.
            if best is None or trend.p_value < best.p_value:
                best = trend
        if best is not None:
            found.append(best)
    return tuple(sorted(found, key=lambda t: t.p_value))
