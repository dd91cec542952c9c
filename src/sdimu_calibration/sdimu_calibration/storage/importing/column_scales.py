"""Units of columns without a word of them: gravity tells that of the force, and turns tell that of the rates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.axes_and_units import AS_RECORDED, DEGREE, NO_TURN, TurnsFit, fitting_scale
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY, parse_unit

_FORCE_UNITS = ("m/s^2", "g", "mg", "cm/s^2")
_COUNTS_PER_G = (16384, 8192, 4096, 2048, 1024, 512, 256)
"""Counts of 1 g of converters of 16 bits from 2 to 16 g, and of 10 to 13 bits."""
_COUNTS_PER_DPS = (131, 65.5, 32.8, 16.4, 114.2857, 57.142857, 28.571429, 14.285714, 14.375, 16.0, 1000.0)
"""Counts of 1 deg/s: 16 bits of 250 to 2000 deg/s, 8.75 to 70 mdeg/s, of the ITG-3200 and BMI parts,
and of numbers in mdeg/s."""
_LARGEST_BIAS = float(np.radians(1.0))
"""Rate of an IMU that mostly rests (rad/s): what is larger is none in rad/s."""
_NEAR = 0.15
"""Share by which the median of |f| may differ from gravity: bias and scale of an uncalibrated sensor."""
_FAR = 0.3
"""Share by which it may differ in the unit that headings state: what differs by more is another unit."""


class Scale(NamedTuple):
    """How numbers become SI."""

    unit: str
    counts: float
    """Numbers of one unit."""
    bias: float
    """Number of zero."""
    why: str
    """By what it was recognised."""
    sign: tuple[int, int, int] = AS_RECORDED
    """1 or -1 of each axis."""

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
    size = median_size(f)
    if not size > 0.0:
        raise DataError("the columns of the accelerometers hold zeros alone: name others in a map (--map)")
    by_gravity = _by_gravity(size)
    if unit and _dimension_is(unit, "m/s"):
        return _stated(unit)
    if unit and _dimension_is(unit, "m/s^2"):
        si = size * parse_unit(unit).factor
        if abs(si / STANDARD_GRAVITY - 1.0) < _FAR:
            return _stated(unit)
        doubt = f"the headings say {unit}, which makes a median of |f| of {si:.4g} m/s^2, and not gravity: check it"
        if by_gravity is None:
            return _stated(unit)._replace(why=doubt)
        return by_gravity._replace(why=f"{by_gravity.why}; {doubt}")
    if by_gravity is not None:
        return by_gravity
    return Scale(
        "g",
        size,
        0.0,
        f"counts of no usual range: the median of |f|, {size:.5g}, is taken for 1 g; correct counts_per_unit and bias",
    )


def median_size(v: Floats) -> float:
    """Median length of vectors, shape (n, 3); NaN where none is finite."""
    size = np.linalg.norm(v, axis=1)
    size = size[np.isfinite(size)]
    return float(np.median(size)) if len(size) else np.nan


def is_gravity(size: float) -> bool:
    """Whether a length is that of gravity, in a unit or in the counts of a usual range."""
    return size > 0.0 and _by_gravity(size) is not None


def _by_gravity(size: float) -> Scale | None:
    """Find the unit in which the usual length of the force is gravity."""
    for one in _FORCE_UNITS:
        gravity = STANDARD_GRAVITY / parse_unit(one).factor
        if abs(size / gravity - 1.0) < _NEAR:
            return Scale(one, 1.0, 0.0, f"in {one}: the median of |f| is {size:.4g}")
    near = min(_COUNTS_PER_G, key=lambda counts: abs(np.log(size / counts)))
    if abs(size / near - 1.0) < _NEAR:
        return Scale("g", float(near), 0.0, f"counts, {near} a g: the median of |f| is {size:.5g}")
    return None


def gyro_scale(w: Floats, f_ib_b: Floats, rate_hz: float, unit: str) -> Scale:
    """Recognise the unit and the signs of the rates by the turns.

    Parameters
    ----------
    w : ndarray, shape (n, 3)
        As in the file.
    f_ib_b : ndarray, shape (n, 3)
        m/s^2.
    unit : str
        By the headings; empty where they say none.
    """
    fit = fit_of_turns(w, f_ib_b, rate_hz, _factors(unit, rate_hz), any_sense=True)
    scale = _rate_scale(w, fit, unit)
    if fit.signs == AS_RECORDED:
        return scale
    return scale._replace(sign=fit.signs, why=f"{scale.why}; {_reversed_in_words(fit)}")


def _factors(unit: str, rate_hz: float) -> tuple[float, ...]:
    """Factors (rad/s of one number) that may be those of columns of gyros, with that of the unit of their headings."""
    if unit and _dimension_is(unit, "rad"):
        return (parse_unit(unit).factor * rate_hz,)
    stated = (parse_unit(unit).factor,) if unit and _dimension_is(unit, "rad/s") else ()
    return tuple(dict.fromkeys((*_FACTORS, *stated)))


def _rate_scale(w: Floats, fit: TurnsFit, unit: str) -> Scale:
    """Recognise the unit of the rates, shape (n, 3), by what fits their turns."""
    if unit and _dimension_is(unit, "rad"):
        return _stated(unit)
    unit = unit if unit and _dimension_is(unit, "rad/s") else ""
    if unit and (fit.factor is None or abs(parse_unit(unit).factor / fit.factor - 1.0) < _NEAR):
        return _stated(unit)
    if fit.factor is not None:
        found = _turned(fit.factor, fit.left)
        doubt = f"; the headings say {unit}, with which the turns do not fit: check it" if unit else ""
        return found._replace(why=found.why + doubt)
    usual = median_size(w)
    guess = "deg/s" if usual > _LARGEST_BIAS else "rad/s"
    return Scale(
        guess,
        1.0,
        0.0,
        f"no turn tells their unit: {guess} stands in the map, as half of the rates are below {usual:.3g}; check it",
    )


def _reversed_in_words(fit: TurnsFit) -> str:
    """Say which gyros are reversed, and what shows it."""
    axes = [axis for axis, sign in zip("xyz", fit.signs, strict=True) if sign < 0]
    which = "all three" if len(axes) == len(fit.signs) else " and ".join(axes)
    return (
        f"the turns close with the opposite sign of {which} ({fit.left:.0%} of the change of gravity's direction is "
        f"left, {fit.as_recorded:.0%} as recorded): this sign stands in the map; check it"
    )


_FACTORS = {1.0: ("rad/s", 1.0), DEGREE: ("deg/s", 1.0)} | {
    DEGREE / counts: ("deg/s", float(counts)) for counts in _COUNTS_PER_DPS
}
"""SI of one number of gyros (rad/s), with the unit and the numbers of one unit."""


def fit_of_turns(
    w: Floats, f: Floats, rate_hz: float, factors: Sequence[float] = tuple(_FACTORS), any_sense: bool = False
) -> TurnsFit:
    """Find the factor with which rates turn a force as it turns.

    Parameters
    ----------
    w, f : ndarray, shape (n, 3)
        In any unit; rows that are not finite are left out.
    factors : sequence of float
        rad/s of one number; the usual ones by default.
    any_sense : bool
        As for `fitting_scale`.
    """
    good = np.isfinite(w).all(axis=1) & np.isfinite(f).all(axis=1)
    if np.count_nonzero(good) < 2:
        return NO_TURN
    t = np.arange(1, len(w) + 1) / rate_hz
    return fitting_scale(t[good], w[good], f[good], factors, any_sense)


def _turned(factor: float, left: float) -> Scale:
    """Say a unit that the turns have told."""
    name, counts = _FACTORS[factor]
    as_counts = "" if counts == 1.0 else f", counts, {counts:g} of them a unit"
    return Scale(
        name, counts, 0.0, f"in {name}{as_counts}: the turns then leave {left:.0%} of the change of gravity's direction"
    )


def _stated(unit: str) -> Scale:
    return Scale(unit, 1.0, 0.0, f"in {unit} by the headings")


def _dimension_is(unit: str, *expected: str) -> bool:
    return any(parse_unit(unit).dimension == parse_unit(one).dimension for one in expected)
