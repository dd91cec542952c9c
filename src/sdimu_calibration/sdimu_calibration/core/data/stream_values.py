"""Values of the samples of two streams: whether they are of two sensors.

Two sensors have other biases and scale factors, so that their difference is a function of rate and force, and lasts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.probability import GAUSS_MAD

ADVICE = "give each publisher a topic of its own, or stop one"
"""What to do about two publishers: nothing tells their samples for certain."""
_BLOCKS = 64
"""Number of blocks over the recording in which differences are compared: about two in a rest."""
_PER_BLOCK = 100
"""Number of samples looked at in each block: their mean shows a tenth of the noise."""
_FEWEST_BLOCKS = 16
"""Number of blocks at least: fewer do not say how much they scatter."""
_SURE = 5.0
"""Ratio of the usual mean difference of a block to its sigma from which two sensors differ: by chance it is 0.7."""
_MEDIAN_SIGMA = 1.2533
"""Ratio of the sigma of a median to that of a mean (1): the root of half of pi."""
_EXPLAINED = 0.5
"""Ratio of what rate and force do not explain of a difference to the difference (rms) below which it is that of two
sensors, which have other biases and scale factors: hum at half the sample rate alternates, too, but comes and goes."""
_MOTION = 5.0
"""Ratio of a difference to that of the motion of one sensor (1), at least: a line between samples cuts its curves."""
_QUIET = 3.0
"""Ratio of the scatter in a block to that of a quiet one (1) up to which no turn begins in it: noise is alike."""
_RESTS = 0.25
"""Share of the blocks (1) that are quiet at least: a hand that turns two IMUs leaves as many."""
_ROUNDING = 1e-9
"""Ratio of a difference to the largest value at least: below it is the rounding of numbers."""


@dataclass(frozen=True)
class Samples:
    """Samples in the order of arrival."""

    ns: Ints
    """Stamps (ns), shape (n,)."""
    omega: Floats
    force: Floats
    """`omega`, `force`: as recorded, shape (n, 3)."""
    where: str
    """File and topic."""

    def __getitem__(self, rows: Ints) -> Samples:
        """Return some of them."""
        return Samples(self.ns[rows], self.omega[rows], self.force[rows], self.where)

    def values(self, rows: Ints) -> Floats:
        """Rates and forces of some rows.

        Parameters
        ----------
        rows : ndarray of int, shape (...)

        Returns
        -------
        ndarray, shape (..., 6)
            As recorded.
        """
        return np.concatenate([self.omega[rows], self.force[rows]], axis=-1)

    @property
    def topic(self) -> str:
        """Topic without the file."""
        return self.where.rpartition(": ")[2]


@dataclass(frozen=True)
class Split:
    """Samples to leave out."""

    out: Ints
    """Their rows, shape (m,)."""
    note: str
    """Why, in a line."""


def in_blocks(rows: Ints) -> Ints:
    """Choose blocks of some rows, spread over all of them.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)

    Returns
    -------
    ndarray of int, shape (b, k)
        Indices into `rows`.
    """
    count = max(min(_BLOCKS, len(rows) // (_PER_BLOCK // 4)), 1)
    width = min(_PER_BLOCK, len(rows) // count)
    return np.asarray(np.linspace(0, len(rows) - width, count).astype(np.int64)[:, None] + np.arange(width))


def off_line(x: Floats) -> Floats:
    """Take the mean of both neighbours from samples.

    Parameters
    ----------
    x : ndarray, shape (..., n, c)
        In any unit.

    Returns
    -------
    ndarray, shape (..., n - 2, c)
        In the same unit.
    """
    return np.asarray(x[..., 1:-1, :] - 0.5 * (x[..., :-2, :] + x[..., 2:, :]))


def off_clock(samples: Samples, clock: Ints, left: Ints, after: Ints) -> Floats:
    """Take what the samples of a clock say of their time from other samples.

    Parameters
    ----------
    clock : ndarray of int, shape (n,)
        Rows of the samples of the clock by their stamps.
    left : ndarray of int, shape (...)
        Rows of the others.
    after : ndarray of int, shape (...)
        Places in `clock` of the next sample of the clock behind each of them.

    Returns
    -------
    ndarray, shape (..., 6)
    """
    begin, end = samples.ns[clock[after - 1]], samples.ns[clock[after]]
    share = np.clip((samples.ns[left] - begin) / np.maximum(end - begin, 1), 0.0, 1.0)[..., None]
    line = (1.0 - share) * samples.values(clock[after - 1]) + share * samples.values(clock[after])
    return np.asarray(samples.values(left) - line)


def of_two_sensors(blocks: list[Floats], values: Floats, motion: Floats) -> bool:
    """Whether differences are those of two sensors on any axis.

    Parameters
    ----------
    blocks : list of ndarray, shape (m, 6), length b
        Differences in blocks over the recording.
    values : ndarray, shape (b, k, 6)
        What the IMU shows in each block.
    motion : ndarray, shape (6,)
        Differences that the motion of one sensor makes.
    """
    if len(blocks) < _FEWEST_BLOCKS:
        return False
    middle = np.array([np.median(block, axis=0) for block in blocks])
    scatter = [np.median(np.abs(b - m), axis=0) / np.sqrt(len(b)) for b, m in zip(blocks, middle, strict=True)]
    usual = np.median(np.abs(middle), axis=0)
    sure = usual > _SURE * _MEDIAN_SIGMA * GAUSS_MAD * np.median(scatter, axis=0)
    sure &= usual > np.maximum(_ROUNDING * np.abs(values).max(axis=(0, 1)), _MOTION * motion)
    if not sure.any():
        return False
    # Where one sensor turns and the other does not yet, their difference is that of motions.
    spread = np.array(scatter)
    quiet = (spread <= _QUIET * np.quantile(spread, _RESTS, axis=0)).all(axis=1)
    if np.count_nonzero(quiet) >= _FEWEST_BLOCKS:
        middle, values = middle[quiet], values[quiet]
    shown = np.column_stack([np.ones(len(middle)), np.median(values, axis=1)])
    left = middle - shown @ np.linalg.lstsq(shown, middle, rcond=None)[0]
    unexplained = np.sqrt((left**2).sum(axis=0) / max(len(middle) - shown.shape[1], 1))
    explained = unexplained < _EXPLAINED * np.sqrt((middle**2).mean(axis=0))
    return bool(np.any(sure & explained))
