"""The coefficients of a set over all models that its recordings together leave probable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.diagnosis.averaged import none_below_zero
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.joint.set_board import SetBoard
from sdimu_calibration.core.joint.set_evidence import SetEvidence, differences
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.posterior.coefficients import Averages, drift_mean
from sdimu_calibration.core.posterior.posterior import Posterior


def over_all_models(fit: SetFit, window: Posterior[SetEvidence], base: Fit) -> SetFit:
    """Return a fit with what was found, its coefficients and their covariance those of all probable models.

    Parameters
    ----------
    fit : SetFit
        With what was found; the window is linear about it. A fit of another model is returned as it is.
    base : Fit
        Of the recording in whose frame the result stands: a bias is that in the mean over its dwells.
    """
    board = window.board
    if not isinstance(board, SetBoard) or set(board.known) != set(fit.names):
        return fit
    evidence = board.evidence
    # Every coefficient of the fit at its column: those of the model, then what was told, a candidate here.
    place = np.array([fit.names.index(name) for name in board.known], dtype=np.int64)
    q = len(evidence.weight)
    T, point = np.eye(q, len(place)), np.zeros(len(place))
    D = differences(fit.names)
    point[q:] = (D @ fit.estimate.values)[place[q:]]
    for column in range(q, len(place)):
        T[:, column] += drift_mean(evidence.candidate(column).effect, base.dwell_means, evidence.names[:q])
    one = T @ (D @ fit.estimate.covariance @ D.T)[np.ix_(place, place)] @ T.T
    all_ = Averages(board, base.dwell_means).of(window)
    own = place[:q]
    values, covariance = fit.estimate.values.copy(), fit.estimate.covariance.copy()
    values[own] += all_.mean - T @ point
    covariance[np.ix_(own, own)] += none_below_zero(all_.covariance - one, np.sqrt(np.diag(one)))
    return replace(fit, estimate=replace(fit.estimate, values=values, covariance=covariance))
