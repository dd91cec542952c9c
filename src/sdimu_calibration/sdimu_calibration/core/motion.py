"""What the effects see of the world: one row a navigation cycle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.units import STANDARD_GRAVITY

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """The IMU's motion, as free of sensor errors as it is known.

    Attributes
    ----------
    t, dt : ndarray, shape (n,)
        End and length of each cycle (s).
    w : ndarray, shape (n, 3)
        Mean body rate against inertial space, in b (rad/s).
    f : ndarray, shape (n, 3)
        Mean specific force, in b (m/s^2).
    C_nb : ndarray, shape (n, 3, 3)
        Attitude at the middle of the cycle.
    w_table : ndarray, shape (n, 3)
        Mean body rate against the Earth, in b (rad/s); exactly zero at rest.
    alpha : ndarray, shape (n, 3)
        Angular acceleration against the Earth, in b (rad/s^2).
    rest : ndarray of bool, shape (n,)
        True where the table stands still.
    temperature, temperature_rate : ndarray, shape (n,)
        deg C and deg C/s; zero where no temperature is recorded.
    """

    t: Floats
    dt: Floats
    w: Floats
    f: Floats
    C_nb: Floats
    w_table: Floats
    alpha: Floats
    rest: NDArray[np.bool_]
    temperature: Floats
    temperature_rate: Floats

    @property
    def a(self) -> Floats:
        """Specific force in units of standard gravity, shape (n, 3)."""
        return self.f / STANDARD_GRAVITY
