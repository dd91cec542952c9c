"""Units of columns without a word of them: gravity tells that of the force, and turns tell that of the rates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.axes_and_units import DEGREE, fitting_scale
from sdimu_calibration.core.units import STANDARD_GRAVITY, parse_quantity, parse_unit

_FORCE_UNITS = ("m/s^2", "g", "mg", "cm/s^2")
_COUNTS_PER_G = (16384, 8192, 4096, 2048, 1024, 512, 256)
"""Counts of 1 g of converters of 16 bits from 2 to 16 g, and of 10 to 13 bits."""
_COUNTS_PER_DPS = (131, 65.5, 32.8, 16.4, 114.2857, 57.142857, 28.571429, 14.285714, 14.375, 16.0)
"""Counts of 1 deg/s: 16 bits of 250 to 2000 deg/s, 8.75 to 70 mdeg/s, and of the ITG-3200 and BMI parts."""
_LARGEST_BIAS = float(np.radians(1.0))
"""Rate of an IMU that mostly rests (rad/s): what is larger is none in rad/s."""
_NEAR = 0.15
"""Share by which the median of |f| may differ from gravity: bias and scale of an uncalibrated sensor."""


class Scale(NamedTuple):
    """How numbers become SI.

    Attributes
    ----------
    counts : float
        Numbers of one unit.
    bias : float
        Number of zero.
    why : str
        By what it was recognised.
    """

    unit: str
    counts: float
    bias: float
    why: str

    @property
    def factor(self) -> float:
        """SI of one number."""
        return parse_unit(self.unit).factor / self.counts


def accel_scale(f: Floats, unit: str) -> Scale:
    """Recognise the unit of the force by gravity.

    Parameters
    ----------
    f : ndarray, shape (n, 3)
        As in the file.
    unit : str
        By the headings; empty where they say none.
    """
    size = float(np.nanmedian(np.linalg.norm(f, axis=1)))
    if unit:
        return _stated(unit, "m/s^2")
    for one in _FORCE_UNITS:
        gravity = STANDARD_GRAVITY / parse_unit(one).factor
        if abs(size / gravity - 1.0) < _NEAR:
            return Scale(one, 1.0, 0.0, f"in {one}: the median of |f| is {size:.4g}")
    near = min(_COUNTS_PER_G, key=lambda counts: abs(np.log(size / counts)))
    if abs(size / near - 1.0) < _NEAR:
        return Scale("g", float(near), 0.0, f"counts, {near} a g: the median of |f| is {size:.5g}")
    return Scale(
        "g",
        size,
        0.0,
        f"counts of no usual range: the median of |f|, {size:.5g}, is taken for 1 g; correct counts_per_unit and bias",
    )


def gyro_scale(w: Floats, f_ib_b: Floats, rate_hz: float, unit: str) -> Scale:
    """Recognise the unit of the rates by the turns.

    Parameters
    ----------
    w : ndarray, shape (n, 3)
        As in the file.
    f_ib_b : ndarray, shape (n, 3)
        m/s^2.
    unit : str
        By the headings; empty where they say none.
    """
    if unit:
        return _stated(unit, "rad/s")
    good = np.isfinite(w).all(axis=1) & np.isfinite(f_ib_b).all(axis=1)
    t = np.arange(1, len(w) + 1) / rate_hz
    tried = {1.0: ("rad/s", 1.0), DEGREE: ("deg/s", 1.0)} | {
        DEGREE / counts: ("deg/s", float(counts)) for counts in _COUNTS_PER_DPS
    }
    factor, left = fitting_scale(t[good], w[good], f_ib_b[good], tuple(tried))
    if factor is None:
        usual = float(np.nanmedian(np.linalg.norm(w, axis=1)))
        unit = "deg/s" if usual > _LARGEST_BIAS else "rad/s"
        return Scale(
            unit,
            1.0,
            0.0,
            f"no turn tells their unit: {unit} stands in the map, as half of the rates are below {usual:.3g}; check it",
        )
    name, counts = tried[factor]
    as_counts = "" if counts == 1.0 else f", counts, {counts:g} of them a unit"
    return Scale(
        name, counts, 0.0, f"in {name}{as_counts}: the turns then leave {left:.0%} of the change of gravity's direction"
    )


def _stated(unit: str, expected: str) -> Scale:
    del expected
    if unit[:1].isdigit():
        return Scale("deg/s", DEGREE / parse_quantity(unit, "deg/s"), 0.0, f"in {unit} by the headings")
    return Scale(unit, 1.0, 0.0, f"in {unit} by the headings")
