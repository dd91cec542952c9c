"""Why a filter diverged, where a prior allows errors that no sensor has: which one, and what looks the same."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.units import from_si

_NO_ERROR = np.array([10.0] * 3 + [1000.0] * 3)
"""Error of a sensor (rad/s for gyros, m/s^2 for accelerometers) that none has: 570 deg/s or 100 g beside the truth."""
_NO_MOTION = np.array([100.0] * 3 + [1000.0] * 3)
"""Rate (rad/s) and specific force (m/s^2) that no test has: 16 turns a second, 100 g."""
_ONE = 0.9995
"""Cosine (1) of two signatures from which they are one: each then has thirty times the sigma it would have alone."""


def possible(motion: Motion) -> bool:
    """Whether forces and rates of a motion are such as a sensor feels."""
    felt = np.hstack([motion.w, motion.f])
    return bool(np.all(np.abs(felt) < _NO_MOTION))


def impossible_prior(sensors: ImuModel, values: Floats, place: str) -> str:
    """Name the prior that allows the largest error, where no sensor has one so large; empty where none does.

    Parameters
    ----------
    sensors : ImuModel
        p parameters.
    values : ndarray, shape (n, m)
        Regressors (SI), finite.
    place : str
        Of the IMU's specification.
    """
    # As shares of the largest: the squares of what made a filter diverge may be no numbers.
    largest = np.maximum(np.max(np.abs(values), axis=0), np.finfo(float).tiny)
    typical = largest * np.sqrt(np.mean((values / largest) ** 2, axis=0))
    error = sensors.prior[sensors.parameter] * typical
    worst = int(np.argmax(error / _NO_ERROR[sensors.channel]))
    if error[worst] <= _NO_ERROR[sensors.channel[worst]]:
        return ""
    k = int(sensors.parameter[worst])
    one = sensors.parameters[k]
    prior, unit = from_si(float(sensors.prior[k]), one.display_unit), "rad/s" if sensors.channel[worst] < 3 else "m/s^2"
    same = _same(sensors, values / np.max(largest), k)
    told = f"; {one.name} cannot be told from {', '.join(same)}: leave it out" if same else ""
    return (
        f"{_place(sensors, k, place)}: {prior:.3g} {one.display_unit} allows errors of {error[worst]:.2g} {unit}, "
        f"which no sensor has, and the filter diverged: state the size that {one.name} may have{told}"
    )


def _place(sensors: ImuModel, k: int, place: str) -> str:
    """File and key where the prior of a parameter stands."""
    if sensors.restated[k] and k < len(sensors.names) - sensors.serving:
        return f"model: priors.{sensors.names[k]}"
    effect = next(e for e in sensors.effects for p in e.parameters if p is sensors.parameters[k])
    family = effect.family or effect.name
    if effect.file:
        return f"{effect.file}: parameters.{sensors.names[k].removeprefix(f'{family}_')}.prior"
    return f"{place}: prior.{family}"


def _same(sensors: ImuModel, values: Floats, k: int) -> list[str]:
    """Parameters whose signature in the samples is that of parameter `k`, up to a factor."""
    gram = (values.T @ values) * (sensors.channel[:, None] == sensors.channel)
    pick = np.equal.outer(np.arange(len(sensors.parameters)), sensors.parameter).astype(float)
    of_parameters = pick @ gram @ pick.T
    length = np.sqrt(np.diag(of_parameters) * of_parameters[k, k])
    cosine = np.divide(of_parameters[k], length, out=np.zeros(len(length)), where=length > 0.0)
    return [name for j, name in enumerate(sensors.names) if j != k and abs(cosine[j]) > _ONE]
