"""Priors of an IMU file that a handheld run contradicts.

By hand the scatter is learned. A prior that is too tight therefore does not show as a misfit: what it keeps out of the
coefficients is learned as scatter, and the sensor looks bad instead of the file. So the run is also fitted with the
priors of an uncalibrated MEMS sensor, the widest that there are. What then is found beyond its own prior gets room, if
the data become more probable by it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.imu_model import ImuModel, prior_sizes
from sdimu_calibration.core.specification import ImuSpecification

BEYOND = 3.0
"""Size of a coefficient (sigma of its prior, and of itself) from which it contradicts the prior: chance stays below."""
ROOM = 3.0
"""Ratio of the new prior to the largest coefficient found: it then pulls by a tenth of its sigma and less."""
GAIN = 5.0
"""Ratio of likelihoods (logarithm), with wider priors to without, from which the file is wrong: odds of 150 to 1."""
WIDEST = "mems"
"""Grade with the widest priors."""


def widest_priors(imu: ImuSpecification, sensors: ImuModel) -> ImuSpecification:
    """Give the IMU the priors of the widest grade for the effects of a model; the same object if none is wider."""
    wider = {}
    for effect in sensors.effects:
        own, widest = [size for size in prior_sizes(effect, imu) if size], effect.prior.get(WIDEST, 0.0)
        if own and min(own) < widest:
            # What the file states of some of the parameters may be wider still.
            wider[effect.family or effect.name] = max(widest, *own)
    return replace(imu, prior={**imu.prior, **wider}) if wider else imu


def contradicted(imu: ImuSpecification, sensors: ImuModel, values: Floats, sigma: Floats) -> dict[str, float]:
    """Say which priors, of the file or of its grade, coefficients contradict that were found with wider ones.

    Parameters
    ----------
    imu : ImuSpecification
        With the priors in question.
    values, sigma : ndarray, shape (p,)
        Coefficients found, and their sigmas (SI).

    Returns
    -------
    dict of str to float
        By effect the sigma (SI) that gives its coefficients room.
    """
    owner = np.array([e.family or e.name for e in sensors.effects for _ in e.parameters])
    stated = np.array([size or np.inf for effect in sensors.effects for size in prior_sizes(effect, imu)])
    size = np.abs(values)
    against = (size > BEYOND * sigma) & (size > BEYOND * stated)
    return {
        name: ROOM * float(size[(owner == name) & against].max()) for name in dict.fromkeys(owner[against].tolist())
    }
