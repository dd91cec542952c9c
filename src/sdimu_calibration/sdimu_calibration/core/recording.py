"""A recording: what the topics of one test say, as arrays, and nothing about where it came from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data_error import DataError

__all__ = [
    "NOMINAL_FROM",
    "UNNUMBERED",
    "DataError",
    "DataFault",
    "DivergedError",
    "PhaseLog",
    "Recording",
    "TableLog",
    "TemperatureLog",
    "nominal_interval_ns",
    "origin_ns",
    "seconds",
]

NOMINAL_FROM = 50
"""Number of sample intervals that give the nominal one: the first ones, so that live and offline agree."""
UNNUMBERED = -1
"""Stop of a phase that has no number: stops are then counted."""


class DivergedError(DataError):
    """An estimate that did not end in numbers: the data and what was stated of them do not fit."""


@dataclass(frozen=True)
class DataFault:
    """Something wrong with the data that is no physics of the sensor."""

    kind: str
    """``gap``, ``stuck``, ``saturated``, ``spike``, ``motion at rest``, ``status``, ..."""
    text: str
    """One line for people."""
    count: int = 0
    """Samples, or seconds of status, concerned."""
    start_s: float = float("nan")
    end_s: float = float("nan")
    """`start_s`, `end_s`: first and last time (s); NaN where that has no meaning."""
    grave: bool = False
    """The estimate is not to be trusted until someone has looked at it: wrong samples are in it, or may be. Every verb
    judges a fault by this alone; samples that were taken as missing are not in the fit and make no fault grave."""


@dataclass(frozen=True)
class PhaseLog:
    """What the rate table said about itself; each entry holds from its time on."""

    t: Floats
    """Seconds after the recording's `start_ns`, ascending, shape (m,)."""
    dwell: Bools
    """True for ``dwell``, False for ``rotating``, shape (m,)."""
    stop: Ints
    """Shape (m,). Index of the stop; `UNNUMBERED` where nobody says it."""
    stated: bool = True
    """Somebody says it; else it was detected from the samples."""

    def usual_dwell_s(self, until_s: float) -> float | None:
        """Median length of a dwell (s) in a recording that ends at `until_s`; None where there is no dwell."""
        edge = self._edges()
        if not edge.any():
            return None
        until = np.append(self.t, until_s)
        return float(np.median(until[edge < 0] - until[edge > 0]))

    @property
    def dwells(self) -> int:
        """Number of dwells, from rotating to rotating."""
        return int(np.count_nonzero(self._edges() > 0))

    def _edges(self) -> Ints:
        """Beginning (1) and end (-1) of every dwell, shape (m + 1,); what lies before and after is none."""
        return np.diff(np.concatenate([[0], np.asarray(self.dwell, dtype=np.int8), [0]]))


@dataclass(frozen=True)
class TemperatureLog:
    """IMU temperature."""

    t: Floats
    """Seconds after `start_ns` (s), ascending, shape (m,)."""
    value: Floats
    """deg C, shape (m,)."""
    reference_degc: float | None = None
    """Temperature T0 from which effects count (deg C): the same for recordings that share coefficients; None: the first
    value."""

    @property
    def origin_degc(self) -> float:
        """Temperature T0 from which effects count (deg C)."""
        return float(self.value[0]) if self.reference_degc is None else self.reference_degc


@dataclass(frozen=True)
class TableLog:
    """Table axis angles; never used by the estimator."""

    t: Floats
    """Seconds after `start_ns` (s), shape (m,)."""
    names: tuple[str, ...]
    """Length k."""
    angle: Floats
    """rad, shape (m, k)."""


class ClockStep(NamedTuple):
    """A step of the clock of the stamps, taken out of them."""

    t: float
    """Time of the first sample after it (s after the start of the recording)."""
    size_s: float
    """How far the clock was set on; below zero: back (s)."""
    open: float = 1.0 / math.sqrt(3.0)
    """Sigma of the angle that was turned in the length of the step, as a share of it: 1 / sqrt(3) where the driver may
    have paused instead, less where gravity tells."""

    def __str__(self) -> str:
        """Say it in a few words."""
        how = "on" if self.size_s > 0.0 else "back"
        return f"the clock of the stamps was set {how} by {abs(self.size_s) * 1e3:.3g} ms at {self.t:.1f} s"


@dataclass(frozen=True)
class Recording:
    """Samples of an IMU and what came with them.

    Attributes
    ----------
    start_ns : int
        Stamp (ns) from which all times count.
    t : ndarray, shape (n,)
        End of each sample's interval (s after `start_ns`), strictly ascending.
    omega_ib_b : ndarray, shape (n, 3)
        Mean body rate against inertial space over the interval, as measured (rad/s).
    f_ib_b : ndarray, shape (n, 3)
        Mean specific force over the interval, as measured (m/s^2).
    rejected : int
        Samples dropped when the recording was made into arrays (not finite, repeated stamp).
    notes : tuple of str
        What was mended or ignored, one line each.
    clock_steps : tuple of ClockStep
        Across which samples are taken as even.
    """

    start_ns: int
    t: Floats
    omega_ib_b: Floats
    f_ib_b: Floats
    phase: PhaseLog | None = None
    temperature: TemperatureLog | None = None
    table: TableLog | None = None
    rejected: int = 0
    notes: tuple[str, ...] = field(default=())
    clock_steps: tuple[ClockStep, ...] = ()

    @cached_property
    def interval_s(self) -> float:
        """Nominal sample interval (s): the median of the stamp differences."""
        return float(np.median(np.diff(self.t), overwrite_input=True))


def nominal_interval_ns(stamps_ns: Ints) -> int:
    """Nominal sample interval (ns): the median of the first `NOMINAL_FROM`.

    Parameters
    ----------
    stamps_ns : ndarray of int, shape (n,)
        Ascending.
    """
    return round(float(np.median(np.diff(stamps_ns[: NOMINAL_FROM + 1]))))


def origin_ns(stamps_ns: Ints) -> int:
    """Stamp from which a recording counts its times: one nominal interval before the first sample.

    Parameters
    ----------
    stamps_ns : ndarray of int, shape (n,)
        Ascending.
    """
    return int(stamps_ns[0]) - nominal_interval_ns(stamps_ns)


def seconds(stamps_ns: Ints, start_ns: int) -> Floats:
    """Count stamps from a start: seconds after `start_ns` (s), shape (n,).

    Parameters
    ----------
    stamps_ns : ndarray of int, shape (n,)
    """
    return np.asarray((stamps_ns - start_ns) * 1e-9, dtype=np.float64)
