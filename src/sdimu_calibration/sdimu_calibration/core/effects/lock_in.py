"""Residual lock-in of a ring laser gyro: scattered light pulls the two beams together at low rates."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import GYRO, per_axis_columns
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.effects.registry import register_family
from sdimu_calibration.core.units import to_si

_FLOOR = to_si(2.0, "deg/h")
"""Rate below which the dither smooths the lock-in (rad/s): an eighth of Earth rate, so that the first order holds
at stops where an axis sees next to nothing of it."""


def _pull(motion: Motion) -> Floats:
    """First order in L^2 of ``sqrt(w^2 - L^2) sgn(w) - w``, with w^2 + s^2 for w^2 below the root.

    Source: Aronowitz, *The laser gyro* (1971), beat frequency of coupled beams. The next order is a share of
    L^2/(4 (w^2 + s^2)): 1 % where the rate is five times L, 6 % at rest for L = 1 deg/h.
    """
    return np.asarray(-0.5 * motion.w / (motion.w**2 + _FLOOR**2))


LOCK_IN = register_family(
    "gyro_lock_in",
    "gyro lock-in (ring laser)",
    "dw_i = sqrt(w_i^2 - L_i^2) sgn(w_i) - w_i, about -k_i w_i/(2 (w_i^2 + s^2)), k = L^2, s = 2 deg/h",
    per_axis_columns(GYRO, _pull),
    ("rad^2/s^2", "deg^2/h^2"),
    (1, 2, 10),
    positive=True,
    typical="RLG with dither L = 0.05-1 deg/h, others none",
    description="The rate is short by L^2/(2 w), L the lock-in rate that is left with dither: strongest at stops "
    "where an axis sees a small part of Earth rate, nothing in turns. The linear form holds to some per cent while "
    "L is below 1 deg/h; a larger L comes out too large. Where every stop is cardinal it is "
    "one class with a dead band; stops between the axes tell them apart.",
    confused_with=("gyro_dead_band", "gyro_magnetic"),
)
