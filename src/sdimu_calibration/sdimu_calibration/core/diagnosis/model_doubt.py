"""What models that the data leave open do to the coefficients: the doubt about the model, beside the noise.

A sigma of least squares holds if the model is right. Three kinds of other models are nearly as likely as the one that a
diagnosis ends with: with one effect more, too small to be found; with another effect of the class in the place of one
that was found; and without one that was found at the threshold. Each moves the coefficients. Weighed with their
posterior odds, the square of the move is what the covariance lacks:

    C = C_0 + sum_m w_m (V_m + D_m D_m'),   D_m = theta_m - theta_0

V_m is what the uncertain size of the rival adds. What is added, and what takes the place of each find, are mixtures of
their own: they are nearly independent.

Source: J. Hoeting et al., "Bayesian model averaging: a tutorial", Statistical Science 14 (1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.information import solved
from sdimu_calibration.core.evidence.linear import LinearEvidence

_LEAST_WEIGHT = 1e-5
"""Posterior weight (1) of a model below which it is left out: a coefficient would have to move by a hundred sigma."""


@dataclass(frozen=True)
class _Alternatives:
    """Every allowed column added to a choice: log odds, and how it moves the known parameters.

    Attributes
    ----------
    score : ndarray, shape (a,)
        Log Bayes factor over the choice without it; -inf where it cannot be seen.
    estimate, variance : ndarray, shape (a,)
        SI, with the prior that physics gives.
    slope : ndarray, shape (k, a)
        Change of each known parameter per unit of the column.
    """

    score: Floats
    estimate: Floats
    variance: Floats
    slope: Floats


def model_doubt(fit: Fit, evidence: LinearEvidence, chosen: Sequence[int], allowed: Ints, scale: float) -> Floats:
    """Covariance that the open models add to that of the coefficients.

    Parameters
    ----------
    fit : Fit
        The fit as given: tells the mean of a drift over the test.
    evidence : LinearEvidence
        In the noise that was found.
    chosen : sequence of int, length k
        Columns that were found.
    allowed : ndarray of int, shape (a,)
        Columns that may be in a model, `chosen` among them.
    scale : float
        Residual noise over specified noise.

    Returns
    -------
    ndarray, shape (q + k, q + k)
        SI; the q coefficients of the model, then the sizes of what was found.
    """
    problem = Problem(evidence)
    q, count = evidence.coefficients, len(chosen)
    # Each parameter has its odds, however many time constants or moments of it are tried.
    votes = np.exp(-problem.log_variants[allowed - problem.p])
    # A sensor with k effects is likelier to have one more: odds of k + 1 to the catalogue (Laplace).
    rare, rare_without = (np.log(max(1.0, votes.sum() / k)) for k in (count + 1, max(count, 1)))
    is_chosen = np.isin(allowed, chosen)
    more = _alternatives(problem, chosen, allowed, scale)
    weight = _shares(more.score + np.log(votes) - rare, np.isfinite(more.score) & ~is_chosen)
    told = [*range(q), *range(problem.p, problem.p + count)]
    out = _spread(fit, evidence, allowed, more, weight, told)
    for number, column in enumerate(chosen):
        others = [c for c in chosen if c != column]
        rivals = _alternatives(problem, others, allowed, scale)
        place = int(np.flatnonzero(allowed == column)[0])
        own = rivals.score[place] + np.log(votes[place])
        others_and_none = np.append(rivals.score + np.log(votes), rare_without) - own
        weight = _shares(others_and_none, np.append(np.isfinite(rivals.score) & ~is_chosen, np.isfinite(own)))
        rest = [k for k in range(q + count) if k != q + number]
        told = [*range(q), *range(problem.p, problem.p + count - 1)]
        out[np.ix_(rest, rest)] += _exchanged(fit, evidence, allowed, rivals, weight, place, told)
    return out


def in_doubt(fit: Fit, final: Fit, evidence: LinearEvidence, chosen: Ints, free: Ints, scale: float) -> Fit:
    """Return a fit with what was found, its covariance with what open models add.

    Parameters
    ----------
    fit, final : Fit
        With the model as given, and with the k effects that were found behind it.
    evidence : LinearEvidence
        In the noise that was found.
    chosen : ndarray of int, shape (k,)
        Columns of what was found.
    free : ndarray of int, shape (f,)
        Columns of the free inputs, which are no effects.
    scale : float
        Residual noise over specified noise.
    """
    allowed = np.setdiff1d(np.arange(len(evidence.weight), len(evidence.names)), free)
    doubt = model_doubt(fit, evidence, chosen.tolist(), allowed, scale)
    found = final.added_columns(len(chosen))
    order = np.concatenate([np.setdiff1d(np.arange(len(doubt)), found), found]).astype(np.int64)
    placed = np.zeros_like(doubt)
    placed[np.ix_(order, order)] = doubt
    return final.with_doubt(placed)


def _alternatives(
    problem: Problem[LinearEvidence], chosen: Sequence[int], allowed: Ints, scale: float
) -> _Alternatives:
    """Add every allowed column (a,) to a choice of k parameters, one at a time."""
    evidence, J = problem.evidence, problem.evidence.information.J
    known, weight, _ = problem.known(chosen)
    scanned = problem.scan(chosen, scale)
    slope = -solved(J[np.ix_(known, known)] + np.diag(weight), J[np.ix_(known, allowed)])
    variance = 1.0 / (scanned.J[allowed] / scale**2 + evidence.prior[allowed - problem.p] ** -2.0)
    score = problem.scores(scanned, scale, chosen, ratio=1.0)[allowed]
    return _Alternatives(score, scanned.d[allowed] / scale**2 * variance, variance, slope)


def _shares(log_odds: Floats, open_: Bools) -> Floats:
    """Posterior weight of every open model beside one of log odds 0; shape (a,)."""
    odds = np.where(open_, np.exp(np.minimum(np.where(open_, log_odds, 0.0), 50.0)), 0.0)
    weight = odds / (1.0 + odds.sum())
    return np.where(weight > _LEAST_WEIGHT, weight, 0.0)


def _spread(
    fit: Fit, evidence: LinearEvidence, allowed: Ints, more: _Alternatives, weight: Floats, told: Sequence[int]
) -> Floats:
    """Spread by one effect more; shape (len(told), len(told))."""
    at = np.flatnonzero(weight)
    S = more.slope[told][:, at]
    _add_means(S, fit, evidence, allowed[at])
    return np.asarray((S * (weight * (more.variance + more.estimate**2))[at]) @ S.T)


def _exchanged(
    fit: Fit,
    evidence: LinearEvidence,
    allowed: Ints,
    rivals: _Alternatives,
    weight: Floats,
    place: int,
    told: Sequence[int],
) -> Floats:
    """Spread by other effects in the place of one, or none; shape (len(told), len(told)).

    The one is at `place` among the allowed; `weight` (a + 1,) is that of every allowed one, then of none. The variance
    of the one stays in the covariance also where it is not there: a little too wide, and never indefinite.
    """
    at = np.append(np.flatnonzero(weight[:-1]), place)
    S = rivals.slope[told][:, at]
    # Beside an effect of temperature or of cables the bias is that without it; if a drift is right in its place, what
    # is called the bias is the mean.
    without_it = evidence.candidates[allowed[place] - len(evidence.weight)].effect.shifts_bias
    _add_means(S, fit, evidence, allowed[at], drifts_alone=without_it)
    moved = S * rivals.estimate[at]
    apart, w, S = moved[:, :-1] - moved[:, -1:], weight[at[:-1]], S[:, :-1]
    without = weight[-1] * np.outer(moved[:, -1], moved[:, -1])
    return np.asarray((S * (w * rivals.variance[at[:-1]])) @ S.T + (apart * w) @ apart.T + without)


def _add_means(S: Floats, fit: Fit, evidence: LinearEvidence, columns: Ints, drifts_alone: bool = False) -> None:
    """Turn the slope of the biases (k, a) into that of their means over the dwells, where a column shifts a bias."""
    p = len(evidence.weight)
    for place, column in enumerate(columns.tolist()):
        effect = evidence.candidates[column - p].effect
        name = bias.NAMES[effect.terms[0].channel]
        if (effect.bias_drift or (effect.shifts_bias and not drifts_alone)) and name in evidence.names:
            S[evidence.names.index(name), place] += fit.dwell_means(effect)[0]
