"""Sigmas of a plan with the bias instability and random walk that the IMU file states.

White noise averages out over a stop; noise with a memory does not, and most data sheets name it in their first line.
The covariance is that of the fit of a real test in such noise (`estimation.noise_learning`), with nothing to learn.
"""

from __future__ import annotations

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.noise_learning import in_noise
from sdimu_calibration.core.evidence.stretch_length import wander_in
from sdimu_calibration.core.noise_term import NoiseTerm


def covariance_in(fit: NavigationFit, terms: tuple[NoiseTerm, ...]) -> Floats:
    """Covariance of the coefficients of a fit in noise of these terms, biases as means over the test.

    Shape (p, p), in the frame of the prior (SI).
    """
    return in_noise(fit, terms, wander_in(fit.bare, terms)).settled_covariance
