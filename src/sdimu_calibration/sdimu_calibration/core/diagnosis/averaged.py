"""The calibration over all models that the data leave probable, in the place of that of the likeliest one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.rounds import Round
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.outcome import WIDER
from sdimu_calibration.core.evidence.linear import E
from sdimu_calibration.core.posterior.coefficients import Averages, Moments
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import Posterior


def over_all_models(base: Fit, done: Round) -> Fit:
    """Return the fit with what was found, its coefficients and their covariance those of all probable models.

    Parameters
    ----------
    base : Fit
        With the model as given.
    """
    found = done.found.posterior
    if found is None:
        return done.fit
    averages = Averages(found.board, base.dwell_means)
    places = {column: k for k, column in enumerate(found.board.columns(found.told.members))}
    told = tuple(sorted(found.told.members[places[int(c)]] for c in done.found.chosen))
    # The fit states its sigmas by its noise model, whatever that leaves.
    as_stated = Averages(found.board.as_stated, base.dwell_means)
    one, all_ = as_stated.of_model(told, NoiseModel(done.found.noise)), averages.of(found)
    q, count = len(one.mean), len(done.found.chosen)
    added = done.fit.added_columns(count)
    own = np.setdiff1d(np.arange(q + count), added)
    moved, doubt = np.zeros(q + count), np.zeros((q + count, q + count))
    moved[own] = all_.mean - one.mean
    doubt[np.ix_(own, own)] = none_below_zero(all_.covariance - one.covariance, np.sqrt(np.diag(one.covariance)))
    return done.fit.with_doubt(doubt, moved)


def widened_by(fit: Fit, found: Posterior[E], columns: Iterable[int]) -> dict[int, tuple[tuple[str, float], ...]]:
    """Coefficients that are known less well because it is open which effect of a class is there, the worst first.

    Parameters
    ----------
    fit : Fit
        With the model as given.
    columns : iterable of int
        Of the evidence: effects that are told, each of an open class.

    Returns
    -------
    dict of int to tuple of (str, float)
        Of each column: name, and sigma over all models over that in the models that hold its effect, with whatever time
        constant (1), where it is more than `WIDER`.
    """
    averages, out = Averages(found.board, fit.dwell_means), {}
    sigma: Floats | None = None
    for column in columns:
        own = found.candidate(found.told.members[found.place_of(column)][0]).coefficient
        known = found.given(k for k in found.held if found.candidate(k).coefficient == own)
        sigma = _sigma(averages.of(found)) if sigma is None else sigma
        ratio = sigma / _sigma(averages.of(known))
        names = found.board.evidence.names[: len(ratio)]
        out[column] = tuple((names[k], float(ratio[k])) for k in np.argsort(-ratio).tolist() if ratio[k] > WIDER)
    return out


def _sigma(moments: Moments) -> Floats:
    """Sigmas (SI), shape (q,)."""
    return np.asarray(np.sqrt(np.diag(moments.covariance)))


def none_below_zero(difference: Floats, sigma: Floats) -> Floats:
    """Part of a difference of covariances that is below zero along no direction.

    Parameters
    ----------
    difference : ndarray, shape (q, q)
        SI.
    sigma : ndarray, shape (q,)
        Unit of each coefficient in which directions are compared (SI).

    Returns
    -------
    ndarray, shape (q, q)
        SI.
    """
    unit = np.where(sigma > 0.0, sigma, 1.0)
    values, vectors = np.linalg.eigh(difference / np.outer(unit, unit))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T * np.outer(unit, unit))
