"""A table that vibrates at rest: what the status calls a dwell shakes faster than a second, and goes nowhere.

The guard of the rests (`phases.RestLimits`) asks every cycle of a tenth of a second for a rate within bias and noise.
Two seconds of arc at 17 Hz are beyond that of a navigation-grade IMU, and are no motion: means over a second stay
within. The table's word then stands, with room for as much as its rests usually shake.

A vibration is bounded: its angle at the end of a second scatters less than that of white noise with the same scatter
from cycle to cycle. That tells it from a density that is stated too small.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Bools
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.phases import Phases, RestLimits, table_says
from sdimu_calibration.core.navigation.strapdown import CYCLE_S, Cycles
from sdimu_calibration.core.recording import DataFault, PhaseLog
from sdimu_calibration.core.units import from_si

_SHAKEN = 0.2
"""Share of the seconds of all dwells that must be beyond the limit by their cycles alone: what happens now and then,
somebody who leans on the table, is no vibration of it."""
_USUAL = 0.9
"""Share of these seconds that shakes less than what is called usual: the rest may be something else."""
_ROOM = 2.0
"""Ratio of the limit to the usual rate of the cycles: a vibration that beats doubles, a turn does not stay below."""
_FEWEST = 20
"""Number of seconds at rest at least: fewer tell nothing usual."""
_LOUD = 3.0
"""Ratio of the scatter of cycles to that of the stated noise (1): below it a vibration is lost in the noise."""
_BOUNDED = 0.3
"""Ratio of the variance of the angle over a second to that of white noise with the scatter of the cycles, below which
it is bounded: white noise has 1, known to a third by twenty seconds."""


def with_vibration(
    cycles: Cycles, epochs: Epochs, log: PhaseLog | None, limits: RestLimits, gravity: float, density: float | None
) -> tuple[RestLimits, tuple[DataFault, ...]]:
    """Give the limits room for a vibration that the dwells of the status show all the time.

    Parameters
    ----------
    log : PhaseLog or None
        Without a status nobody says that a shaking IMU rests.
    gravity : float
        At the site (m/s^2).
    density : float or None
        White noise of the gyros (rad/s/sqrt(Hz)); None where they count pulses, whose residue looks like a vibration.

    Returns
    -------
    limits : RestLimits
        The same object where the dwells do not vibrate beyond them.
    faults : tuple of DataFault
        What to say of a vibration; none grave.
    """
    said, _ = table_says(epochs, log)
    rate = np.linalg.norm(epochs.w_mean, axis=1)
    force = np.abs(np.linalg.norm(epochs.f_mean, axis=1) - gravity)
    calm = (said == 1) & (rate < limits.rate) & (force < limits.force)
    if calm.sum() < _FEWEST:
        return limits, ()
    beyond = bool(np.sum(calm & (epochs.peak_rate >= limits.rate)) > _SHAKEN * calm.sum())
    if not beyond and (density is None or not _bounded(cycles, epochs, calm, density)):
        return limits, ()
    usual = float(np.quantile(epochs.peak_rate[calm], _USUAL))
    fast, slow = (from_si(v, "deg/h") for v in (usual, float(np.median(rate[calm]))))
    text = (
        f"the table vibrates in its dwells: means over {CYCLE_S:g} s reach {fast:.3g} deg/h where those over a second "
        f"are {slow:.3g} deg/h; the status is taken at its word, the scatter as noise"
    )
    at = np.flatnonzero(calm)
    fault = DataFault("vibration", text, len(at), float(epochs.start[at[0]]), float(epochs.end[at[-1]]))
    return replace(limits, shaken=max(_ROOM * usual, limits.rate)) if beyond else limits, (fault,)


def _bounded(cycles: Cycles, epochs: Epochs, calm: Bools, density: float) -> bool:
    """Whether cycles scatter more than their noise, and the angle over a second does not."""
    at = np.flatnonzero(calm)
    # Neighbouring seconds of one stop: what is constant there cancels.
    near = np.diff(at) == 1
    if near.sum() < _FEWEST:
        return False
    count = epochs.last - epochs.first
    length = (epochs.end - epochs.start)[at]
    rows = slice(0, int(epochs.last[-1]))
    off = cycles.alpha[rows] - np.repeat(epochs.w_mean, count, axis=0) * cycles.dt[rows, None]
    # Of the steps of a second one is taken up by their mean; the median knows no second in which somebody leans on it.
    free = 3.0 * np.maximum(count[at] - 1, 1)
    step = float(np.median(np.add.reduceat(np.sum(off**2, axis=1), epochs.first)[at] / free))
    cycle = float(np.median(length / count[at]))
    if step < _LOUD**2 * density**2 * cycle:
        return False
    difference = np.diff(epochs.w_mean[at] * length[:, None], axis=0)[near]
    angle = 0.5 * float(np.median(np.sum(difference**2, axis=1))) / _MEDIAN_OF_THREE
    return angle < _BOUNDED * step * float(np.median(length)) / cycle


_MEDIAN_OF_THREE = 2.366
"""Median of a chi-square (1): of three degrees of freedom."""


def scatter_of_seconds(epochs: Epochs, phases: Phases, gyro_white_noise: float) -> float:
    """Measure what a vibration adds to the mean rates of epochs at rest.

    Parameters
    ----------
    gyro_white_noise : float
        Density (rad/s/sqrt(Hz)), which is taken off.

    Returns
    -------
    float
        Sigma of an axis (rad/s), root mean square of the three.
    """
    square, dof = 0.0, 0
    for stop in np.unique(phases.stop[phases.used]):
        rate = epochs.w_mean[phases.used & (phases.stop == stop)]
        square, dof = square + float(np.sum((rate - rate.mean(axis=0)) ** 2)), dof + 3 * (len(rate) - 1)
    if not dof:
        return 0.0
    seconds = float(np.mean((epochs.end - epochs.start)[phases.used]))
    return float(np.sqrt(max(square / dof - gyro_white_noise**2 / seconds, 0.0)))
