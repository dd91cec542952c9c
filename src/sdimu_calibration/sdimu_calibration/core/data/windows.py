"""A recording in windows: what the specific force points to, and how the gyros say it turned.

Nothing but `Windows.still` needs to know units or signs: it is what they are recognised by.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.data.blocks import let_go, pieces
from sdimu_calibration.core.matrix3 import multiplied, rotation3, store
from sdimu_calibration.core.probability import GAUSS_MAD

WINDOW_S = 1.0
"""Usual length (s): a hand turns by tens of degrees in it, and its tremor (10 Hz) averages out of a quarter of it."""
_END = 8
"""Share of a window (one over this number) before and after an edge: its mean gives the direction there."""
_GAP = 1.2
"""Length of a window as a multiple of its samples': a longer one has a gap in it."""

_REST = 6.0
"""Difference of a reading from the usual one (sigma of the learned noise): at rest it is less."""
_TURNING_EARTH = 3.0
"""Change of a reading from attitude to attitude, as a multiple of the Earth's rate: twice by the Earth, more by mass
unbalance."""
_MOVING = np.radians(1.0)
"""Largest scatter of a resting gyro (rad/s): what scatters more moves, and an IMU that always moves has no rests."""


@dataclass(frozen=True)
class Windows:
    """Windows without gaps, k of them, of m samples (a power of two)."""

    start: Floats
    end: Floats
    """`start`, `end`: seconds, shape (k,)."""
    first: Ints
    """First sample of each, shape (k,)."""
    length: int
    """Samples of a window."""
    interval_s: float
    up_first: Floats
    up_last: Floats
    """`up_first`, `up_last`: direction of the measured force at the edges, unit vectors, shape (k, 3)."""
    w_mean: Floats
    f_mean: Floats
    """`w_mean`, `f_mean`: means, in the numbers of the recording, shape (k, 3)."""

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.first)

    def __getitem__(self, rows: slice) -> Windows:
        """Return the windows of a slice."""
        return self._with({name: getattr(self, name)[rows] for name in _ROWS})

    def followed_by(self, later: Windows) -> Windows:
        """Return both, of one recording in two pieces; `first` counts from the beginning of each piece."""
        return self._with({name: np.concatenate([getattr(self, name), getattr(later, name)]) for name in _ROWS})

    def _with(self, columns: dict[str, Any]) -> Windows:
        return Windows(length=self.length, interval_s=self.interval_s, **columns)

    @property
    def swing(self) -> Floats:
        """Angle between the directions at the edges (rad), shape (k,)."""
        return _angle(self.up_first, self.up_last)

    @property
    def quiet(self) -> Bools:
        """The half of the windows in which the force turns least, shape (k,)."""
        swing = self.swing
        return np.asarray(swing <= np.median(swing)) if len(swing) else np.zeros(0, dtype=bool)

    @property
    def rate_offset(self) -> Floats:
        """Reading of the gyros when nothing turns, shape (3,)."""
        return np.asarray(np.median(self.w_mean[self.quiet], axis=0)) if len(self) else np.zeros(3)

    @property
    def still(self) -> Bools:
        """Windows at rest, shape (k,): the gyros read what they usually do but for noise and Earth, the force stays."""
        return self.still_as(self.quiet)

    def still_as(self, quiet: Bools) -> Bools:
        """Windows at rest.

        Parameters
        ----------
        quiet : ndarray of bool, shape (k,)
            Windows that show the usual reading of the gyros and its noise.

        Returns
        -------
        ndarray of bool, shape (k,)
        """
        if not quiet.any():
            return np.zeros(len(self), dtype=bool)
        usual = GAUSS_MAD * float(np.median(self.swing[quiet]))
        earth_turn = self.length * self.interval_s * _TURNING_EARTH * earth.RATE
        return np.asarray((self.turning(quiet) < 1.0) & (self.swing < _REST * usual + earth_turn))

    def turning(self, quiet: Bools) -> Floats:
        """Difference of the gyros' readings from the usual one, as a multiple of the largest at rest.

        Parameters
        ----------
        quiet : ndarray of bool, shape (k,)
            As of `still_as`, one at least.

        Returns
        -------
        ndarray, shape (k,)
            Of the axis that differs most (1).
        """
        steps = np.diff(self.w_mean, axis=0)[quiet[1:] & quiet[:-1]]
        noise = GAUSS_MAD * np.median(np.abs(steps), axis=0) / np.sqrt(2.0) if len(steps) else np.zeros(3)
        limit = np.minimum(_TURNING_EARTH * earth.RATE + _REST * noise, _MOVING)
        differs = np.abs(self.w_mean - np.median(self.w_mean[quiet], axis=0))
        return np.asarray((differs / limit).max(axis=1))


_ROWS = ("start", "end", "first", "up_first", "up_last", "w_mean", "f_mean")


def runs(flags: Bools) -> tuple[Ints, Ints]:
    """Find runs of True.

    Parameters
    ----------
    flags : ndarray of bool, shape (n,)

    Returns
    -------
    first, last : ndarray of int, shape (k,)
        First of each run, and one after its last.
    """
    edges = np.diff(np.concatenate([[0], flags.astype(np.int64), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def cut_windows(
    t: Floats, w: Floats, f: Floats, length_s: float = WINDOW_S, interval_s: float | None = None
) -> Windows:
    """Cut a recording into windows.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Seconds, ascending.
    w, f : ndarray, shape (n, 3)
        Body rate and specific force in any unit and sign.
    length_s : float
        Of a window, to a factor of the root of two.
    interval_s : float, optional
        Of the samples; by default the median of their stamps' differences.
    """
    let_go(w, f)
    dt = interval_s or float(np.median(np.diff(t), overwrite_input=True))
    m, q = samples_of(length_s, dt)
    first = np.arange(m, len(t) - m - q + 1, m)
    whole = t[np.minimum(first + m + q, len(t)) - 1] - t[first - q] < _GAP * (m + 2 * q) * dt
    first = first[whole]
    # Of the running sums only those at the edges are kept: a day of samples has a gigabyte of them.
    at = np.unique(np.concatenate([first + step for step in (-q, 0, q, m - q, m, m + q)]))
    total_w, offset_w = _running_sum(w, at)
    total_f, offset_f = _running_sum(f, at)

    def mean(total: Floats, offset: Floats, begin: Ints, end: Ints) -> Floats:
        rows = np.searchsorted(at, end), np.searchsorted(at, begin)
        return np.asarray((total[rows[0]] - total[rows[1]]) / (end - begin)[:, None] + offset)

    return Windows(
        start=t[first - 1],
        end=t[first + m - 1],
        first=first,
        length=m,
        interval_s=dt,
        up_first=_unit(mean(total_f, offset_f, first - q, first + q)),
        up_last=_unit(mean(total_f, offset_f, first + m - q, first + m + q)),
        w_mean=mean(total_w, offset_w, first, first + m),
        f_mean=mean(total_f, offset_f, first, first + m),
    )


def samples_of(length_s: float, interval_s: float) -> tuple[int, int]:
    """Return the samples of a window (a power of two) and those to each side of an edge that give the direction."""
    m = int(2 ** max(round(float(np.log2(length_s / interval_s))), 0))
    return m, max(m // _END, 1)


def _running_sum(x: Floats, at: Ints) -> tuple[Floats, Floats]:
    """Sum of ``x - mean`` of the rows of x (n, 3) before each of `at` (c,), ascending; shape (c, 3); the mean (3,)."""
    mean, total, out = np.zeros(3), np.zeros(3), np.zeros((len(at), 3))
    for rows in pieces(len(x)):
        _add_up(np.ascontiguousarray(x[rows]), mean)
        let_go(x)
    mean /= len(x)
    reached = 0
    for rows in pieces(len(x)):
        reached = _sum_before(np.ascontiguousarray(x[rows]), mean, at - rows.start, reached, total, out)
        let_go(x)
    out[reached:] = total
    return out, mean


@compiled
def _add_up(x: Floats, total: Floats) -> None:
    """Add the rows of x (n, 3) to `total` (3,), in place."""
    for i in range(len(x)):
        for k in range(3):
            total[k] += x[i, k]


@compiled
def _sum_before(x: Floats, mean: Floats, at: Ints, reached: int, total: Floats, out: Floats) -> int:
    """Add ``x - mean`` to `total` (3,), row by row; put it into `out` (c, 3) before each row of `at` from `reached` on.

    Returns
    -------
    int
        Number of rows of `at` that were reached.
    """
    for i in range(len(x)):
        while reached < len(at) and at[reached] == i:
            for k in range(3):
                out[reached, k] = total[k]
            reached += 1
        for k in range(3):
            total[k] += x[i, k] - mean[k]
    return reached


def block_means(values: Floats, width: int) -> Floats:
    """Means over neighbouring samples, block by block; what does not fill a block at the end is left out.

    Parameters
    ----------
    values : ndarray, shape (n, 3)
        In any unit.
    width : int
        Samples of a block.

    Returns
    -------
    ndarray, shape (n // width, 3)
        In that unit.
    """
    sums = np.zeros((len(values) // width, 3))
    _add_blocks(np.ascontiguousarray(values), width, sums)
    return sums / width


@compiled
def _add_blocks(values: Floats, width: int, sums: Floats) -> None:
    """Add `width` rows of values (n, 3) to each row of `sums` (n // width, 3), in place."""
    for block in range(len(sums)):
        for i in range(block * width, (block + 1) * width):
            for k in range(3):
                sums[block, k] += values[i, k]


def turned(w: Floats, windows: Windows, chosen: Ints, factor: float) -> Floats:
    """Rotation over windows as the gyros say it.

    Parameters
    ----------
    w : ndarray, shape (n, 3)
        As in the recording; `Windows.rate_offset` is taken off.
    chosen : ndarray of int, shape (k,)
    factor : float
        rad/s of one unit of `w`, with its sign.

    Returns
    -------
    ndarray, shape (k, 3, 3)
        From the axes at the end of a window to those at its beginning (dimensionless).
    """
    scale = factor * windows.interval_s
    return _rotations(np.ascontiguousarray(w), windows.first[chosen], windows.length, windows.rate_offset, scale)


@compiled
def _rotations(w: Floats, first: Ints, length: int, offset: Floats, scale: float) -> Floats:
    """Rotation over `length` samples from each of `first` (k,) on, each by ``scale (w - offset)``; shape (k, 3, 3)."""
    out = np.empty((len(first), 3, 3))
    for k in range(len(first)):
        C = rotation3(0.0, 0.0, 0.0)
        for i in range(first[k], first[k] + length):
            x, y, z = scale * (w[i, 0] - offset[0]), scale * (w[i, 1] - offset[1]), scale * (w[i, 2] - offset[2])
            C = multiplied(C, rotation3(x, y, z))
        store(C, out[k])
    return out


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-300))


def _angle(a: Floats, b: Floats) -> Floats:
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(a - b, axis=1), 1.0)))
