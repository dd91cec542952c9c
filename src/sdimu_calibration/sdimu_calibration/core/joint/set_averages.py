"""The coefficients of a set over all models that its recordings together leave probable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.diagnosis.averaged import none_below_zero
from sdimu_calibration.core.joint.set_board import SetBoard
from sdimu_calibration.core.joint.set_evidence import SetEvidence
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.posterior.coefficients import Averages
from sdimu_calibration.core.posterior.posterior import Posterior


def over_all_models(fit: SetFit, window: Posterior[SetEvidence]) -> SetFit:
    """Return a fit with what was found, its coefficients and their covariance those of all probable models.

    A bias is that in the mean over the dwells of the recording in whose frame the result stands.

    Parameters
    ----------
    fit : SetFit
        With what was found; the window is linear about it. A fit of another model is returned as it is.
    """
    board = window.board
    if not isinstance(board, SetBoard):
        return fit
    columns = zip(window.told.members, board.columns(window.told.members), strict=True)
    told = tuple(member for member, column in columns if column < len(board.known))
    if set(board.known) != set(fit.names) or len(told) < len(board.known) - len(board.evidence.weight):
        return fit
    # Both in the linear model: that the scatter of power-ons is hardly known stays in the fit alone.
    noise = board.noise_of(fit, window.told.noise)
    means = fit.base.dwell_means
    one = Averages(board.as_stated, means).of_model(told, noise)
    all_ = Averages(board, means).of(window)
    own = np.array([fit.names.index(name) for name in board.known[: len(board.evidence.weight)]], dtype=np.int64)
    values, covariance = fit.estimate.values.copy(), fit.estimate.covariance.copy()
    values[own] += all_.mean - one.mean
    covariance[np.ix_(own, own)] += none_below_zero(all_.covariance - one.covariance, np.sqrt(np.diag(one.covariance)))
    return replace(fit, estimate=replace(fit.estimate, values=values, covariance=covariance))
