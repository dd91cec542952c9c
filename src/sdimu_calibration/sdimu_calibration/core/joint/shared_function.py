"""An unknown function of the attitude that all recordings of a set have in common, among the coefficients of a set.

Each of some sensors has an error that is a sum of functions of the attitude. The weights of the functions are
coefficients of all recordings, normal with an unknown size. Each recording learns the noise of its own beside them:
alone it takes the function for noise, which averages away, as a function does not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.evidence.attitude_functions import AttitudeFunctions
from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.linear import E, LinearEvidence
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.joint.scope import split_tag
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.likely_noise import likely_noise

_WEIGHT = " function "
"""What the name of a weight has between those of its sensor and its function."""
_FREE = 1.0
"""Size (rad/s, m/s^2) of a weight where none is known yet: the data alone decide."""


@dataclass(frozen=True)
class SharedFunction:
    """Functions of the attitude that a set has in common."""

    functions: AttitudeFunctions
    sensors: tuple[str, ...]
    """Those that have them, in the order of `CHANNELS`."""
    stops: Floats
    """Direction of the force in b (1) at the stops of the recordings, shape (n, 3)."""
    size: Mapping[str, float]
    """One-sigma of the weights of a sensor (rad/s, m/s^2); empty where nobody knows it yet."""
    told: tuple[str, ...] | None = None
    """Sensors that more likely than not have them; None where this was not weighed yet."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each weight: function by function, of each the sensors."""
        return tuple(f"{sensor}{_WEIGHT}{k}" for k in range(len(self.functions)) for sensor in self.sensors)

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
        return np.tile([self.size.get(sensor, _FREE) ** -2.0 for sensor in self.sensors], len(self.functions))


def is_weight(name: str) -> bool:
    """Tell a weight of a function from coefficients by its name."""
    return _WEIGHT in split_tag(name)[0]


def beside(evidence: E, shared: SharedFunction) -> E:
    """Put the weights of a function into the model of a recording's evidence, behind its parameters.

    Parameters
    ----------
    evidence : LinearEvidence
        N rows; the weights are zero at its calibration.
    """
    own = len(evidence.weight)
    of_all = evidence.signature(shared.functions.effects()).reshape(len(evidence.e), -1, len(CHANNELS))
    columns = of_all[:, :, [c in shared.sensors for c in CHANNELS]].reshape(len(evidence.e), -1)
    return replace(
        evidence,
        W=np.hstack([evidence.W[:, :own], columns, evidence.W[:, own:]]),
        names=(*evidence.names[:own], *shared.labels, *evidence.names[own:]),
        weight=np.concatenate([evidence.weight, shared.known]),
        shift=np.concatenate([evidence.shift, np.zeros(len(shared.labels))]),
        stated=np.concatenate([evidence.stated, shared.known**-0.5]),
    )


def noise_beside(evidence: LinearEvidence, wander: Wander) -> tuple[NoiseTerm, ...]:
    """Learn the noise of a recording beside the function in its model.

    Parameters
    ----------
    wander : Wander
        In white noise.
    """
    information = Joint.of(evidence, wander).on_wander(evidence.model, evidence.weight)
    return likely_noise(information, wander.cut, evidence.imu)
