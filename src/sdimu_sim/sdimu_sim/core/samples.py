"""True means over the sample intervals, and the variables that hidden effects read."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_sim.core.temperature import TemperatureProfile

_XYZ = "xyz"

STILL_RAD_S = 1e-9
"""Below this mean rate the table stands: far above rounding (1e-14), far below any turn."""
SLOW_S = 60.0
"""Time over which the rate of the temperature is a mean where heating is told from cooling (s)."""
NEVER_S = 1e9
"""Time since the last turn where there was none."""
TURNED_RAD_S = np.radians(0.5)
"""Turning about an axis counts for hysteresis from here: more than 3 deg of mount leaks from a turn at 2 deg/s."""
LEANT_PER_S = np.radians(0.5)
"""The same for a change of specific force (g/s)."""


class SampleClock:
    """Stamps of samples k = 1, 2, ... at k / rate, exact in nanoseconds however long the test is."""

    def __init__(self, rate_hz: float) -> None:
        if not 0.0 < rate_hz <= 1e5:
            raise DataError(f"sample rate {rate_hz:g} Hz: expected 10 to 1000 Hz")
        self._rate = Fraction(rate_hz).limit_denominator(10**6)

    @property
    def interval_s(self) -> float:
        """Sample interval (s)."""
        return float(1 / self._rate)

    def seconds(self, first: int, last: int) -> Floats:
        """Stamps of samples `first` ... `last` (s)."""
        return np.arange(first, last + 1) * self._rate.denominator / self._rate.numerator

    def nanoseconds(self, first: int, last: int) -> Ints:
        """Stamps of samples `first` ... `last` (ns), to the nearest."""
        p, q = self._rate.numerator, self._rate.denominator
        whole, part = np.divmod(np.arange(first, last + 1, dtype=np.int64) * q, p)
        # Whole seconds apart: k * q * 10^9 would leave 64 bits for awkward rates.
        stamps: Ints = whole * 10**9 + (part * 10**9 + p // 2) // p
        return stamps

    def count(self, until_s: float) -> int:
        """Return how many samples end at or before a time, with a nanosecond of grace."""
        return int(np.floor((until_s + 1e-9) * float(self._rate)))


@dataclass(frozen=True)
class TrueSamples:
    """True means over m sample intervals, resolved in b; every array (3, m) and contiguous by row."""

    omega_ib: Floats
    f_ib: Floats
    omega_nb: Floats
    alpha: Floats
    field: Floats
    """`omega_ib`, `f_ib`, `omega_nb`, `alpha`, `field`: rad/s, m/s^2, rad/s, rad/s^2, T, shape (3, m)."""
    down: Floats
    """Down component of each body axis, shape (3, m)."""
    lever: Floats
    """Mean of ``[alpha x] + [omega x]^2`` (1/s^2), shape (3, 3, m)."""


def in_body(means: Floats, C_tb: Floats, gravity: float, lever_arm: Floats) -> TrueSamples:
    """Resolve the means of `mean_motion` in b and make specific force of them.

    Parameters
    ----------
    means : ndarray, shape (24, m)
    C_tb : ndarray, shape (3, 3)
    gravity : float
        m/s^2.
    lever_arm : ndarray, shape (3,)
        Of the accelerometers, in b (m).
    """
    omega, down, turning, alpha, field = (rotated(C_tb, means[i : i + 3]) for i in range(0, 15, 3))
    half = np.array([rotated(C_tb, means[15 + 3 * i : 18 + 3 * i]) for i in range(3)])
    lever = np.array([rotated(C_tb, half[:, j]) for j in range(3)]).transpose(1, 0, 2)
    f_ib = -gravity * down
    for j in range(3):
        if lever_arm[j]:
            f_ib = f_ib + lever_arm[j] * lever[:, j]
    return TrueSamples(omega, f_ib, turning, alpha, field, down, np.ascontiguousarray(lever))


def rotated(C_tb: Floats, v: Floats) -> Floats:
    """``C_tb.T @ v``, term by term: a matrix product's digits would depend on the number of columns."""
    return np.array([C_tb[0, i] * v[0] + C_tb[1, i] * v[1] + C_tb[2, i] * v[2] for i in range(3)])


class Variables:
    """Builds the variables of hidden effects block by block; remembers the last turn of every axis."""

    def __init__(self, temperature: TemperatureProfile | None) -> None:
        self._temperature = temperature
        self._turned = np.zeros(3)
        self._leant = np.zeros(3)
        self._stood = -np.inf
        self._angle = np.zeros(3)
        self._reached = 0.0

    def of(self, true: TrueSamples, middle: Floats) -> dict[str, Floats | float]:
        """Variables of a block by the names of `sdimu_sim.core.hidden.VARIABLES`; `middle` (m,) mid-sample times."""
        a = true.f_ib / STANDARD_GRAVITY
        wt = true.omega_nb
        change = np.array([a[(i + 1) % 3] * wt[(i + 2) % 3] - a[(i + 2) % 3] * wt[(i + 1) % 3] for i in range(3)])
        turned, self._turned = _last_sign(wt, TURNED_RAD_S, self._turned)
        leant, self._leant = _last_sign(change, LEANT_PER_S, self._leant)
        groups = {"w": true.omega_ib, "a": a, "alpha": true.alpha, "wt": wt, "B": true.field}
        groups |= {"wound": self._wound(wt, middle), "turned": turned, "leant": leant, "f": true.f_ib, "d": true.down}
        values: dict[str, Floats | float] = {f"{n}{i}": v[k] for n, v in groups.items() for k, i in enumerate(_XYZ)}
        values |= {f"L{i}{j}": true.lever[k, n] for k, i in enumerate(_XYZ) for n, j in enumerate(_XYZ)}
        values["t"] = middle
        values["moving"] = (np.abs(wt).max(axis=0) > STILL_RAD_S).astype(np.float64)
        # The turn ends with its last sample, half a sample after the middle of that.
        half = 0.5 * (middle[1] - middle[0]) if len(middle) > 1 else 0.0
        end = np.maximum.accumulate(np.where(values["moving"] > 0.0, middle + half, self._stood))
        self._stood = float(end[-1]) if len(end) else self._stood
        values["since"] = np.minimum(np.where(values["moving"] > 0.0, 0.0, middle - end), NEVER_S)
        if self._temperature:
            values["T"] = self._temperature.sensor_value(middle)
            values["dT"] = values["T"] - self._temperature.origin_degc
            values["dTdt"] = self._temperature.sensor_rate(middle)
            # Material creeps: what tells heating from cooling is the rate over the minute about now.
            before, after = np.maximum(middle - 0.5 * SLOW_S, 0.0), middle + 0.5 * SLOW_S
            rise = self._temperature.sensor_value(after) - self._temperature.sensor_value(before)
            values["slow"] = rise / (after - before)
        return values

    def _wound(self, wt: Floats, middle: Floats) -> Floats:
        """Angle turned about each body axis up to the middle of each sample (rad), (3, m)."""
        if not len(middle):
            return wt
        # Samples touch each other: each is twice as long as from the end of the one before to its middle.
        interval = 2.0 * (middle[0] - self._reached)
        steps = np.cumsum(np.concatenate([self._angle[:, None], wt * interval], axis=1), axis=1)
        self._angle, self._reached = steps[:, -1], float(middle[-1] + 0.5 * interval)
        return np.asarray(steps[:, 1:] - 0.5 * interval * wt)


def _last_sign(v: Floats, threshold: float, before: Floats) -> tuple[Floats, Floats]:
    """Sign of the last value beyond the threshold, at every sample (3, m), and after the block (3,)."""
    column = np.arange(1, v.shape[1] + 1)
    last = np.maximum.accumulate(np.where(np.abs(v) > threshold, column, 0), axis=1)
    signs = np.concatenate([before[:, None], np.sign(v)], axis=1)
    result = np.take_along_axis(signs, last, axis=1)
    return result, result[:, -1] if v.shape[1] else before
