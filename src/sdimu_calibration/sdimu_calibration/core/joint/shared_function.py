"""An unknown function of the attitude that all recordings of a set have in common, in the rows of one recording.

Each of some sensors has an error that is a sum of functions of the attitude, with weights of one unknown size that all
recordings share. Each recording learns the noise of its own beside it: alone it takes the function for noise, which
averages away, as a function does not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.attitude_functions import AttitudeFunctions
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.learned_noise import learn
from sdimu_calibration.core.joint.reduction import Reduction, reduced


@dataclass(frozen=True)
class SharedFunction:
    """Functions of the attitude that a set has in common."""

    functions: AttitudeFunctions
    sensors: tuple[str, ...]
    """Those that have them, in the order of `CHANNELS`."""
    size: Mapping[str, float]
    """One-sigma of the weights of a sensor (rad/s, m/s^2); empty where nobody knows it yet."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each weight: function by function, of each the sensors."""
        return tuple(f"{sensor} function {k}" for k in range(len(self.functions)) for sensor in self.sensors)

    def of(self, sensor: str) -> Bools:
        """Tell the weights of a sensor from the others.

        Returns
        -------
        ndarray of bool, shape (m,)
        """
        return np.tile([one == sensor for one in self.sensors], len(self.functions))

    @property
    def known(self) -> Floats:
        """Prior information of all weights.

        Returns
        -------
        ndarray, shape (m,)
            (1/SI^2).
        """
        return np.tile([self.size[sensor] ** -2.0 for sensor in self.sensors], len(self.functions))


def function_rows(fit: Fit, shared: SharedFunction) -> Reduction:
    """Compress what a recording says of its coefficients and of the weights, in the noise that it has beside them.

    Parameters
    ----------
    fit : Fit
        In white noise; that is the noise where no size is known.
    """
    evidence = fit.bare
    own = len(evidence.weight)
    columns = evidence.signature(shared.functions.effects()).reshape(len(evidence.e), -1, len(CHANNELS))
    kept = [c in shared.sensors for c in CHANNELS]
    W = np.hstack([evidence.W[:, :own], columns[:, :, kept].reshape(len(evidence.e), -1)])
    wide = replace(evidence.only(np.empty(0, dtype=np.int64)), W=W, names=(*evidence.names[:own], *shared.labels))
    if not shared.size or not isinstance(fit, NavigationFit):
        return reduced(wide)
    wander, weight = fit.wander.in_white, np.concatenate([evidence.weight, shared.known])
    information = Joint.of(wide, wander).on_wander(np.arange(len(weight)), weight)
    return reduced(wide, learn(information, wander.cut))
