"""A base that tilts within a rest: the gyros turn, and the accelerometers see gravity turn by the same angle.

What an IMU may show at rest (`phases.RestLimits`) has room for its bias and noise, and a slow tilt of minutes of arc
stays below that. Taken for rest, the step of the force is a step of the accelerometers' biases. No sensor error shows
in both triads as one angle: where a change of the force across its direction is that by which the gyros turned,

    f after - f before = -a x f,    a: integral of the rate less that of the rest,

the IMU moved. A turn about the vertical is seen by the gyros alone, and may be an error of theirs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.phases import Phases, table_says
from sdimu_calibration.core.data.windows import runs
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import DataFault, PhaseLog
from sdimu_calibration.core.specification import EPOCH_S, ImuSpecification
from sdimu_calibration.core.units import from_si

_LENGTHS = (1, 2, 4)
"""Numbers of seconds in which a tilt is looked for: slower ones are of the table, and effects of the catalogue."""
_BESIDE = 6
"""Number of seconds before and after, whose mean forces are compared: more average noise, and rests have no more."""
_SIGMAS = 6.0
"""Angle of the gyros (sigma) from which the forces are asked: by chance once in 1e9."""
_LOG_ODDS = 10.0
"""Log-likelihood (1) by which the forces must be likelier with the angle of the gyros than at rest: a second in ten
thousand may be one."""
_APART = 0.5
"""Difference of the two angles (share of that of the gyros) below which they are one: other causes are not that
alike."""
_TURNS = 4.0
"""Rate of a second in which the IMU moved (sigma of those at rest): one in ten thousand at rest has more."""
_EPS_S = 1e-6
"""Difference of two times (s) that are one: stamps are rounded to it."""
_Q90 = 1.645
"""Size that nine of ten normal values are below (sigma): values of pulses are often alike, and have no median."""


@dataclass(frozen=True)
class _Tilts:
    """What both triads say of the seconds `begin` to `begin + length` of a rest."""

    begin: Ints
    length: int
    gyros: Floats
    """Change of the force by the angle of the gyros (m/s^2), shape (n, 3)."""
    force: Floats
    """Change of the force across its direction (m/s^2), shape (n, 3)."""


def without_tilts(
    epochs: Epochs, log: PhaseLog | None, phases: Phases, imu: ImuSpecification, settle_s: float
) -> tuple[Phases, tuple[DataFault, ...]]:
    """Take the seconds out of rests in which both triads show that the IMU tilted; what follows is another stop.

    Parameters
    ----------
    imu : ImuSpecification
        Gives the least noise of both triads.
    settle_s : float
        No measurement for this long after motion (s).

    Returns
    -------
    phases : Phases
        The same object where nothing moved. Stops that a status numbers keep their numbers.
    faults : tuple of DataFault
        When the IMU moved, and by how much; not grave.
    """
    moved, largest = _moved(epochs, phases.dwell, imu)
    if not moved.any():
        return phases, ()
    dwell = phases.dwell & ~moved
    ends = np.flatnonzero(moved[:-1] & dwell[1:]) + 1
    used = phases.used & dwell
    for end in ends.tolist():
        used &= (epochs.start < epochs.start[end]) | (epochs.start >= epochs.start[end] + settle_s - _EPS_S)
    first = phases.first & used
    # The first measurement after motion tells velocity and place, too.
    at = np.flatnonzero(used)
    behind = np.searchsorted(at, ends)
    first[at[behind[behind < len(at)]]] = True
    silent = table_says(epochs, log)[1] < 0
    begins = np.zeros(len(epochs), dtype=np.int64)
    begins[ends] = 1
    stop = phases.stop + np.where(silent, np.cumsum(begins), 0)
    return replace(phases, dwell=dwell, used=used, first=first, stop=stop), (_told(epochs, moved, len(ends), largest),)


def _told(epochs: Epochs, moved: Bools, times: int, largest: float) -> DataFault:
    """Say when the IMU moved, and by how much at most (rad)."""
    seconds = np.flatnonzero(moved)
    begin, end = float(epochs.start[seconds[0]]), float(epochs.end[seconds[-1]])
    text = (
        f"the IMU tilted {counted(times, 'time')} within its rests, by up to {from_si(largest, 'arcsec'):.0f} arcsec "
        f"(first at {begin:.0f} s): gyros and accelerometers agree; these {len(seconds)} s are taken as motion"
    )
    return DataFault("motion at rest", text, len(seconds), begin, end)


def _moved(epochs: Epochs, dwell: Bools, imu: ImuSpecification) -> tuple[Bools, float]:
    """Seconds in which the IMU tilted, shape (m,), and the largest angle (rad)."""
    moved, largest = np.zeros(len(epochs), dtype=bool), 0.0
    rate = _rates(epochs, dwell)
    slow = np.linalg.norm(rate, axis=1)
    turns = slow > _TURNS * max(_sigma(slow[dwell]), imu.gyro_white_noise / np.sqrt(EPOCH_S)) if dwell.any() else moved
    for length in _LENGTHS:
        tilts = _tilts(epochs, dwell, rate, length)
        if not len(tilts.begin):
            continue
        least = imu.accel_white_noise * np.sqrt(2.0 / _BESIDE), imu.gyro_white_noise * np.sqrt(length)
        gravity = float(np.linalg.norm(epochs.f_mean[tilts.begin[0]]))
        seen, felt = (np.linalg.norm(x, axis=1) for x in (tilts.force, tilts.gyros))
        turned = felt > _SIGMAS * max(_sigma(felt), gravity * least[1])
        # Within reach of a turn the forces change by it: in a short recording that is most of it, and no noise.
        calm = ~_in_reach(tilts, turned, len(epochs))
        of_force = max(_sigma(seen[calm] if calm.any() else seen), least[0])
        apart = np.linalg.norm(tilts.force - tilts.gyros, axis=1)
        likelier = 0.5 * (seen**2 - apart**2) / of_force**2
        sure = turned & (likelier > _LOG_ODDS) & (apart < _APART * felt)
        for k in tilts.begin[sure].tolist():
            here = slice(k, k + length)
            moved[here] |= turns[here] | (slow[here] == slow[here].max())
        largest = max(largest, float(felt[sure].max(initial=0.0)) / gravity)
    # A motion that fills a part of a second only is not always seen in it.
    wide = moved.copy()
    wide[1:] |= moved[:-1]
    wide[:-1] |= moved[1:]
    return wide & dwell, largest


def _rates(epochs: Epochs, dwell: Bools) -> Floats:
    """Rate of each second less the usual one of its rest (rad/s), shape (m, 3)."""
    out = np.zeros_like(epochs.w_mean)
    for first, last in zip(*runs(dwell), strict=True):
        out[first:last] = epochs.w_mean[first:last] - np.median(epochs.w_mean[first:last], axis=0)
    return out


def _tilts(epochs: Epochs, dwell: Bools, rate: Floats, length: int) -> _Tilts:
    """Compare the angle of the gyros in some seconds of a rest with that of the forces before and after."""
    step = (epochs.end - epochs.start)[:, None]
    angle = np.vstack([np.zeros((1, 3)), np.cumsum(rate * step, axis=0)])
    sums = np.vstack([np.zeros((1, 3)), np.cumsum(epochs.f_mean, axis=0)])
    begins = [np.arange(first + _BESIDE, last - length - _BESIDE + 1) for first, last in zip(*runs(dwell), strict=True)]
    k: Ints = np.concatenate([np.empty(0, dtype=np.int64), *begins]).astype(np.int64)
    before = (sums[k] - sums[k - _BESIDE]) / _BESIDE
    after = (sums[k + length + _BESIDE] - sums[k + length]) / _BESIDE
    middle = 0.5 * (before + after)
    along = middle / np.linalg.norm(middle, axis=1, keepdims=True) if len(k) else middle
    change = after - before
    across = change - along * np.sum(along * change, axis=1, keepdims=True)
    return _Tilts(k, length, -np.cross(angle[k + length] - angle[k], middle), across)


def _in_reach(tilts: _Tilts, turned: Bools, seconds: int) -> Bools:
    """Say which of `tilts` compare forces before, in or after any that `turned`, shape (n,) of `seconds` epochs."""
    moving = np.zeros(seconds, dtype=np.int64)
    for second in range(tilts.length):
        moving[tilts.begin[turned] + second] = 1
    before = np.concatenate([[0], np.cumsum(moving)])
    return np.asarray(before[tilts.begin + tilts.length + _BESIDE] > before[tilts.begin - _BESIDE])


def _sigma(sizes: Floats) -> float:
    """Sigma of one component of values that are mostly noise, from their sizes."""
    return float(np.quantile(sizes, 0.9)) / _Q90 if len(sizes) else 0.0
