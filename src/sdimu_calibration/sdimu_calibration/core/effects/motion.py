"""What the effects see of the world: one row a navigation cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.units import STANDARD_GRAVITY

_TURNING = np.radians(0.01)
"""Rate from which the table turns (rad/s): slower than any turn, faster than the bias of a gyro that is worth a rate
table."""

Memory = Mapping[tuple[str, float], Floats]
"""What a suspension remembers, shape (3,) in g, by its kind and parameter (`effects.memory`)."""
NO_PAST: Memory = MappingProxyType({})
"""Nothing is remembered: the IMU had stood as it stands in the first cycle."""


@dataclass(frozen=True)
class Motion:
    """The IMU's motion, as free of sensor errors as it is known."""

    t: Floats
    dt: Floats
    """`t`, `dt`: end and length of each cycle (s), shape (n,)."""
    w: Floats
    """Mean body rate against inertial space, in b (rad/s), shape (n, 3)."""
    f: Floats
    """Mean specific force, in b (m/s^2), shape (n, 3)."""
    C_nb: Floats
    """Attitude at the middle of the cycle, b to n, shape (n, 3, 3)."""
    w_table: Floats
    """Shape (n, 3). Mean body rate against the Earth, in b (rad/s); exactly zero at rest."""
    alpha: Floats
    """Angular acceleration against the Earth, in b (rad/s^2), shape (n, 3)."""
    rest: Bools
    """True where the table stands still, shape (n,)."""
    temperature: Floats
    temperature_rate: Floats
    """`temperature`, `temperature_rate`: shape (n,). T - T0 (K) and rate (K/s); zero where no temperature is recorded.
    T0 is `TemperatureLog.origin_degc`."""
    turned: Floats
    leant: Floats
    """`turned`, `leant`: shape (n, 3). Sign of the last turn about each axis, and of the last change of specific force
    along it; 0 before the first."""
    since_turn: Floats
    """Shape (n,). Time since the last turn ended (s); 0 in turns, infinite before the first."""
    magnetic_n: Floats
    """Magnetic field of the site in NED (T), shape (3,)."""
    wound: Floats
    """Angle turned against the Earth about each body axis since the start, with its sign (rad), shape (n, 3)."""
    past: Memory
    """What the block before this one has left, where blocks follow each other."""

    @cached_property
    def left(self) -> dict[tuple[str, float], Floats]:
        """What is remembered at the end of this block, as in `past` (g), each of shape (3,).

        `effects.memory` fills it in when an effect asks for it.
        """
        return {}

    @cached_property
    def a(self) -> Floats:
        """Mean specific force in b, in units of standard gravity (9.80665 m/s^2), shape (n, 3)."""
        return self.f / STANDARD_GRAVITY

    @cached_property
    def a_rate(self) -> Floats:
        """Rate of change of `a` in b while the IMU turns under gravity, ``-w_table x a`` (1/s), shape (n, 3)."""
        return np.asarray(-np.cross(self.w_table, self.a))

    @cached_property
    def table_rate(self) -> Floats:
        """Magnitude of `w_table` (rad/s), shape (n,)."""
        return np.asarray(np.linalg.norm(self.w_table, axis=1))

    @cached_property
    def standing(self) -> Ints:
        """Cycles in which the table does not turn at all, `table_rate` exactly zero, in ascending order, shape (k,)."""
        return np.flatnonzero(self.table_rate == 0.0)

    @cached_property
    def moving(self) -> Floats:
        """Indicator of motion: 1 while the table turns, 0 at rest (dimensionless), shape (n,).

        `rest` is known by the epoch (1 s) only. Within an epoch the rate of the table says when a turn began or ended.
        """
        turning = np.sum(self.w_table**2, axis=1) > _TURNING**2
        return np.asarray((~self.rest & turning).astype(np.float64))

    @cached_property
    def field(self) -> Floats:
        """Magnetic field that the sensors see, in b, in the unit of `magnetic_n` (T), shape (n, 3)."""
        return np.asarray(np.einsum("kij,i->kj", self.C_nb, self.magnetic_n))

    @cached_property
    def lever(self) -> Floats:
        """Acceleration per lever arm of a point fixed in the body, ``[alpha x] + [w_table x]^2``, shape (n, 3, 3).

        In b (1/s^2, SI): a point at r (m) accelerates by ``lever @ r`` (m/s^2) against the centre of rotation.
        """
        w, d = self.w_table, self.alpha
        out = np.einsum("ki,kj->kij", w, w)
        out[:, range(3), range(3)] -= np.sum(w**2, axis=1)[:, None]
        out[:, 0, 1] -= d[:, 2]
        out[:, 0, 2] += d[:, 1]
        out[:, 1, 0] += d[:, 2]
        out[:, 1, 2] -= d[:, 0]
        out[:, 2, 0] -= d[:, 1]
        out[:, 2, 1] += d[:, 0]
        return np.asarray(out)
