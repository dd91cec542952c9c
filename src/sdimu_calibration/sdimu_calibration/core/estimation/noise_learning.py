"""A fit in the noise that its own residuals show: white noise is the first guess, not the last word."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.noise_estimate import NoiseEstimate
from sdimu_calibration.core.evidence.consistency import stop_means
from sdimu_calibration.core.evidence.held_out import predict
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.learned_noise import NoiseInformation, with_intervals
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.wander import Modes, Wander
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.likely_noise import likely_noise
from sdimu_calibration.core.probability import chi2_tail

F = TypeVar("F", bound=Fit)
SUSPECTED_P = 0.05
"""Probability of the means of the innovations at stops below which white noise is doubted: noise that changes a
coefficient by half its sigma shows there, and one clean test in twenty only costs the time of a look."""


def noise_of(fit: Fit) -> tuple[NoiseTerm, ...]:
    """Learn the noise of a fit where its innovations contradict white noise; none where they do not.

    Only a fit that navigates by its own passes learns noise; a handheld one learns scatter instead.
    """
    if not isinstance(fit, NavigationFit) or not suspected(fit):
        return ()
    wander = fit.wander
    information = _information(fit, wander)
    terms = wander.learned
    if terms is None:
        terms = likely_noise(information, wander.cut, fit.bare.imu)
    return with_intervals(information, wander.cut, terms)


def suspected(fit: NavigationFit) -> bool:
    """Whether the means of the innovations at stops scatter more than white noise lets them."""
    output = fit.last.output
    standard = output.innovation / output.innovation_sigma
    means = np.array([m.normalised_mean for m in stop_means(standard, fit.prepared)])
    return chi2_tail(float(means @ means), len(means)) < SUSPECTED_P


def in_noise(fit: F, terms: Sequence[NoiseTerm], wander: Wander | None = None, held_out: bool = True) -> F:
    """Estimate the coefficients of a fit again, in noise of these terms; without terms the fit is in white noise.

    Parameters
    ----------
    fit : Fit
        As it is where it does not navigate.
    wander : Wander, optional
        Of the fit; by default in the stretches that its own noise asks for.
    held_out : bool
        Predict the stops; without it their error in this noise is NaN.
    """
    if not isinstance(fit, NavigationFit):
        return fit
    if not terms:
        return fit if fit.noise is None else fit.with_noise(None)
    wander = wander or fit.wander
    bare, modes = fit.bare.in_inner(wander.inner), wander.modes(terms)
    noisy = bare.with_noise(modes.columns)
    deviation, covariance = _with_mean(bare, modes, fit.setup.sensors)
    residual = noisy.e - noisy.W @ noisy.information.estimate(noisy.model, noisy.weight)[0]
    squared = float(residual @ noisy.weighed(residual[:, None])[:, 0])
    rms = predict(noisy, noisy.model, noisy.weight, noisy.shift).rms if held_out else float("nan")
    gain = _information(fit, wander).gain(terms, wander.cut)
    nis = squared / max(1, len(residual) - len(deviation))
    return fit.with_noise(NoiseEstimate(tuple(terms), deviation, covariance, gain, nis, rms))


def _information(fit: NavigationFit, wander: Wander) -> NoiseInformation:
    """Bring together what the rows of a fit say of noise, its coefficients estimated along."""
    bare = fit.bare.in_inner(wander.inner)
    return Joint.of(bare, wander).on_wander(bare.model, bare.weight)


def _with_mean(evidence: LinearEvidence, modes: Modes, sensors: ImuModel) -> tuple[Floats, Floats]:
    """Deviation of the coefficients (q,) and its covariance, a bias with the mean of its noise over all dwells.

    Coefficients that are known stay as they are.

    A constant part of wandering noise cannot be told from the bias, so the bias by itself means nothing in it; what
    the bias was in the mean over the test is known well.
    """
    q, r = len(evidence.weight), modes.columns.parts.shape[1]
    W, e, across = evidence.W, evidence.e, modes.columns.across(evidence.W)
    weight, fixed = np.append(evidence.weight, np.ones(r)), sensors.fixed
    J = np.block([[W.T @ W, across], [across.T, modes.columns.square]])
    d = np.append(W.T @ e, modes.columns.across(e[:, None])[0])
    # The prior as it is, correlations and all: its diagonal comes with the weights.
    J[:q, :q] += sensors.prior_information - np.diag(evidence.weight)
    d[:q] += sensors.prior_information @ evidence.shift
    estimate, covariance = Information(J, d).estimate(np.arange(q + r), weight)
    known = np.flatnonzero(fixed)
    covariance[known], covariance[:, known], estimate[known] = 0.0, 0.0, 0.0
    T = np.hstack([np.eye(q), np.zeros((q, r))])
    moved = [
        (channel, evidence.names.index(name))
        for channel, name in enumerate(bias.NAMES)
        if name in evidence.names and not fixed[evidence.names.index(name)]
    ]
    unseen = np.zeros((q, q))
    for channel, row in moved:
        T[row, q:] = modes.mean[channel]
        for other, column in moved:
            unseen[row, column] = modes.unseen[channel, other]
    return T @ estimate, T @ covariance @ T.T + unseen
