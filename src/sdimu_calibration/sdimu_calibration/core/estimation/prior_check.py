"""What was known before the test may be wrong: priors that the model states, and the specification of the IMU."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.references import SITE_REFERENCES
from sdimu_calibration.core.units import from_si

_FAR = 4.5
"""Distance (sigma) from which a prior and the data contradict each other: chance puts one in 150 000 there."""
_LEAST = 1e-9
"""Part of a prior's variance (1) that a fit has to take away at least: below it the data say nothing, and rounding
decides."""


def contradicted(sensors: ImuModel, estimate: Floats, covariance: Floats) -> list[str]:
    """Name the stated priors that contradict the data, one line each, the worst first.

    The difference of posterior and prior mean has the variance that the fit takes away from the prior. What the data
    say by themselves is further from the prior mean, by the ratio of the prior's variance to that.

    Parameters
    ----------
    sensors : ImuModel
        q parameters.
    estimate : ndarray, shape (q,)
        SI.
    covariance : ndarray, shape (q, q)
        Of the estimate (SI).
    """
    prior, variance = sensors.prior, np.diag(covariance)
    taken = np.maximum(prior**2 - variance, _LEAST * prior**2)
    told = sensors.restated & (prior > 0.0) & _stated(sensors)
    said = sensors.mean + (estimate - sensors.mean) * np.divide(prior**2, taken, out=np.ones(len(prior)), where=told)
    pull = np.divide(np.abs(estimate - sensors.mean), np.sqrt(taken), out=np.zeros(len(prior)), where=told)
    out = []
    for k in np.argsort(-pull):
        if pull[k] > _FAR:
            unit = SITE_REFERENCES.get(sensors.names[k], sensors.parameters[k].display_unit)
            mean, sigma, found = (from_si(float(v[k]), unit) for v in (sensors.mean, prior, said))
            if sensors.names[k] in SITE_REFERENCES:
                kind = sensors.names[k].removeprefix("reference_")
                out.append(
                    f"the {kind} of the site, told with a sigma of {sigma:.3g} {unit}, contradicts the data: they say "
                    f"that it is too large by {found:.4g} {unit}, {pull[k]:.0f} sigma; correct the {kind}, or its sigma"
                )
                continue
            out.append(
                f"the stated prior of {sensors.names[k]} ({mean:.4g} +- {sigma:.3g} {unit}) contradicts the data: they "
                f"say {found:.4g} {unit}, {pull[k]:.0f} sigma away; correct that prior, or leave it out"
            )
    return out


def _stated(sensors: ImuModel) -> Bools:
    """Tell the parameters whose prior a file states from those that only serve, but for the site's; shape (q,)."""
    serving = len(sensors.names) - sensors.serving
    return np.array([k < serving or name in SITE_REFERENCES for k, name in enumerate(sensors.names)], dtype=bool)


def outside(sensors: ImuModel, estimate: Floats) -> list[str]:
    """Name the coefficients beyond what the specification allows, one line each, the furthest first.

    Parameters
    ----------
    sensors : ImuModel
        q parameters.
    estimate : ndarray, shape (q,)
        SI.
    """
    count = len(sensors.names) - sensors.serving
    size = np.abs(estimate[:count]) / sensors.stated[:count]
    return [
        f"{sensors.names[i]} is {size[i]:.1f} times the sigma of the specification"
        for i in np.argsort(-size)
        if size[i] > _FAR
    ]
