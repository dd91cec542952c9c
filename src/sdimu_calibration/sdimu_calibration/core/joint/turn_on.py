"""How far coefficients differ from power-on to power-on: sigma by restricted likelihood, with its 95 % interval.

The interval holds the sigmas whose profile of the restricted log-likelihood is within 1.92 of its top (D. Hardy, S.
Thompson, "A likelihood approach to meta-analysis with random effects", Statistics in Medicine 15, 1996).
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.joint.combine import Combination
from sdimu_calibration.core.results import TurnOn

_FALL = 1.92
"""Fall of the log-likelihood (1) at the bounds of a 95 % interval: half of chi-square with one degree of freedom."""
_SMALLEST, _LARGEST = 1e-3, 1e6
"""Range of the sigma over the resolution of one power-on (1): below, nothing is seen of it; no IMU is beyond."""
_GRID = 37
"""Number of sigmas of the first look at the range: four a decade, so that no top of the likelihood lies between."""
_SWEEPS = 4
"""Number of times that all components are optimised in turn: they hardly depend on each other."""


def turn_on_scatter(combined: Combination) -> tuple[TurnOn, ...]:
    """Estimate the sigma of every component.

    Parameters
    ----------
    combined : Combination
        Of two power-ons at least.
    """
    scale = np.array([combined.resolution(k) for k in range(len(combined.components))])
    tau = scale.copy()
    for _ in range(_SWEEPS if len(tau) > 1 else 1):
        for k in range(len(tau)):
            tau[k] = _best(combined, tau, k, scale[k])
    return tuple(_with_interval(combined, tau, k, scale[k]) for k in range(len(tau)))


def _profile(combined: Combination, tau: Floats, k: int, size: float) -> float:
    trial = tau.copy()
    trial[k] = size
    return combined.log_likelihood(trial)


def _best(combined: Combination, tau: Floats, k: int, scale: float) -> float:
    """Sigma (SI) of one component that the others leave most likely; 0 where none is likelier."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 (0.2 s that a single recording does not need)

    grid = np.log(scale * np.geomspace(_SMALLEST, _LARGEST, _GRID))
    values = [_profile(combined, tau, k, float(np.exp(x))) for x in grid]
    top = int(np.argmax(values))
    if top == 0:
        return 0.0
    found = minimize_scalar(
        lambda x: -_profile(combined, tau, k, float(np.exp(x))),
        bounds=(grid[top - 1], grid[min(top + 1, _GRID - 1)]), method="bounded", options={"xatol": 1e-3},
    )  # fmt: skip
    return float(np.exp(found.x)) if -found.fun > _profile(combined, tau, k, 0.0) else 0.0


def _with_interval(combined: Combination, tau: Floats, k: int, scale: float) -> TurnOn:
    from scipy.optimize import brentq  # noqa: PLC0415

    limit = _profile(combined, tau, k, tau[k]) - _FALL

    def above(x: float) -> float:
        return _profile(combined, tau, k, float(np.exp(x))) - limit

    begin, end = np.log(max(tau[k], scale * _SMALLEST)), np.log(scale * _LARGEST)
    low = 0.0
    bottom = np.log(scale * _SMALLEST)
    if tau[k] > 0.0 and begin > bottom and above(bottom) < 0.0:
        low = float(np.exp(brentq(above, bottom, begin, xtol=1e-3)))
    high = float(np.exp(brentq(above, begin, end, xtol=1e-3))) if above(end) < 0.0 else float("inf")
    effect = combined.components[k].effect
    return TurnOn(effect, float(tau[k]), low, high, len(combined.J))
