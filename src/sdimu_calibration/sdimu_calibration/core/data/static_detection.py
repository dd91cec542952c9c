"""Rests of an IMU that a hand moved: found from the samples alone, however short, with the noise learned from them.

`phases` decides by the second and by what a table says; a hand rests for a second or five, nobody says when, and the
specification of a cheap sensor is no measure of what its samples do. Here the quietest windows of the recording say
what the noise is; a window is rest when its scatter is that noise and its mean rate is that of the other quiet windows.

Source of the idea: Tedaldi, Pretto & Menegatti, "A robust and easy to implement method for IMU calibration without
external equipments", ICRA 2014 (variance of the accelerometers against that of the first rest). Here both triads
decide, no first rest is needed, and the mean rate is looked at, which a slow even turn does not hide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.data.blocks import let_go
from sdimu_calibration.core.data.windows import block_means, runs
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification

WINDOW_S = 0.3
"""Length of a window (s): shorter than any rest worth having, longer than a swing of a trembling hand (0.1 s)."""
SHORTEST_S = 0.4
"""Shortest rest that is used (s): what half a window at both ends leaves of one that is worth having."""
_QUIETEST = 0.1
"""Share of all windows from which the noise is learned: the quietest ones are rests."""
SCATTER = 4.0
"""Scatter (variance) of rest, as a multiple of that of the quietest windows: a hand makes more."""
_DRIFT = np.radians(1.0)
"""Mean rates at rest may differ by so much (rad/s): what gravity and warmth do to the bias of a cheap gyro."""
_RAMP = 4.0
"""Distance of the mean rate of a window from that of its neighbourhood (sigma) that is a ramp: one window of noise in
five thousand is as far off, and cuts one sample of a rest."""
_NEAR_S = 10.0
"""Length of the neighbourhood (s): a table of 0.5 deg/s^2 runs up to what is taken for rest in 2 s of them, and the
bias of a cheap gyro does not leave its noise."""
HOLE = 3.0
"""Distance of two samples (intervals): in a longer one a hand may have moved."""
_EARTH_SEEN = 3.0
"""Ratio of the Earth's rate to the gyros' white noise in a rest: from here on it is seen."""
_SAME_ATTITUDE = np.radians(0.3)
"""Angle between two pieces of one rest (rad), by the forces and by the gyros: four sigmas of half a second of a noisy
accelerometer; a turn that is worth making is longer."""
_NUDGE = np.radians(1.0)
"""Angle that the gyros may leave a rest by and come back (rad): longer, the mean force is that of other attitudes."""
_FRAGMENT_S = 3.0
"""Gap between two pieces of one rest (s): what a jolt or a burst of noise takes."""
_FEWEST = 10
"""Number of pairs of neighbouring means at least: of three axes they give the noise to an eighth."""
_BLOCK_S = 0.5
"""Noise is learned from the differences of means over so much (s): slow enough for what a filter in the sensor does."""


@dataclass(frozen=True)
class StaticIntervals:
    """Rests of a recording."""

    first: Ints
    last: Ints
    """`first`, `last`: samples ``first:last`` of each, shape (k,)."""
    gyro_white_noise: float
    accel_white_noise: float
    """`gyro_white_noise`, `accel_white_noise`: densities learned at rest (rad/s/sqrt(Hz), m/s^2/sqrt(Hz))."""

    def __len__(self) -> int:
        """Return the number of rests."""
        return len(self.first)


def detect_static(recording: Recording, scatter: float = SCATTER) -> StaticIntervals:
    """Find where the IMU rests.

    Parameters
    ----------
    scatter : float
        Scatter (variance) of a window at rest at most, as a multiple of that of the quietest windows.
    """
    dt = recording.interval_s
    width = max(round(WINDOW_S / dt), 4)
    if len(recording.t) < 10 * width:
        raise DataError(f"/imu/data_raw: {recording.t[-1]:.1f} s are too short to find rests in")
    still, mean = _still(recording, width, _DRIFT, HOLE, scatter)
    first, last = runs(still)
    long = last - first >= max(round(SHORTEST_S / dt), 3)
    if not long.any():
        raise DataError("/imu/data_raw: no rest of half a second was found: put the IMU down between the turns")
    first, last = _without_ramps(recording, mean, first[long], last[long])
    return StaticIntervals(*joined(recording, first, last, _FRAGMENT_S), *noise_at(recording, first, last))


def noise_at(recording: Recording, first: Ints, last: Ints) -> tuple[float, float]:
    """White noise of the gyros (rad/s/sqrt(Hz)) and of the accelerometers (m/s^2/sqrt(Hz)) at rests.

    Parameters
    ----------
    first, last : ndarray of int, shape (k,)
        Samples ``first:last`` of each rest.
    """
    dt = recording.interval_s
    return _density(recording.omega_ib_b, first, last, dt), _density(recording.f_ib_b, first, last, dt)


def _without_ramps(recording: Recording, mean: Floats, first: Ints, last: Ints) -> tuple[Ints, Ints]:
    """Cut the begin and the end of turns off the rests.

    A table runs up within a second or two. In that time its mean rate is below what the bias of a cheap gyro may change
    by between two attitudes, and at a high sample rate its scatter is below that of the noise. Within one rest the bias
    does not change: the ramp is where the mean rate leaves that of its neighbourhood.

    Parameters
    ----------
    mean : ndarray, shape (n, 3)
        Mean rate of the window about each sample (rad/s).
    first, last : ndarray of int, shape (k,)
        Samples ``first:last`` of each rest.

    Returns
    -------
    first, last : ndarray of int, shape (k,)
        Of the same rests.
    """
    near = round(_NEAR_S / recording.interval_s)
    sides = [slice(a, a + min(near, (b - a + 1) // 2)) for a, b in zip(first, last, strict=True)]
    sides += [slice(b - (side.stop - side.start), b) for side, b in zip(sides, last, strict=True)]
    away = [np.abs(mean[side] - np.median(mean[side], axis=0)) for side in sides]
    # The median of absolute deviations of normal noise is 0.67 sigma.
    sigma = np.median(np.concatenate(away), axis=0) / 0.6745
    leaves = [np.any(a > _RAMP * sigma, axis=1) for a in away]
    k = len(first)
    begins = np.array([int(np.argmin(out)) for out in leaves[:k]])
    ends = np.array([int(np.argmin(out[::-1])) for out in leaves[k:]])
    return first + begins, last - ends


def joined(recording: Recording, first: Ints, last: Ints, longest_s: float) -> tuple[Ints, Ints]:
    """Join the pieces of one rest that a jolt, a burst of noise or a base that rocks cut.

    Pieces are no rests of their own: the errors that the model leaves at an attitude are the same in all of them. The
    mean over the whole rest, jolt included, is that of gravity, as the jolt begins and ends at the same attitude, at
    rest.

    Parameters
    ----------
    first, last : ndarray of int, shape (k,)
        Samples ``first:last`` of each piece.
    longest_s : float
        Longest gap between two pieces (s).

    Returns
    -------
    first, last : ndarray of int, shape (m,)
        Of the rests.
    """
    cut = [
        recording.t[c] - recording.t[b - 1] > longest_s or not _one_rest(recording, (a, b), (c, d))
        for a, b, c, d in zip(first[:-1], last[:-1], first[1:], last[1:], strict=True)
    ]
    ends = np.array([*cut, True])
    return first[np.append(True, ends[:-1])], last[ends]


def _one_rest(recording: Recording, before: tuple[int, int], after: tuple[int, int]) -> bool:
    """Decide whether the IMU stood at one attitude before and after a gap, and hardly left it in between."""
    (a, b), (c, d) = before, after
    force = [recording.f_ib_b[at].mean(axis=0) for at in (slice(a, b), slice(c, d))]
    unit = [f / np.linalg.norm(f) for f in force]
    bias = np.concatenate([recording.omega_ib_b[a:b], recording.omega_ib_b[c:d]]).mean(axis=0)
    step = np.diff(recording.t[b - 1 : c])[:, None]
    way = np.linalg.norm(np.cumsum((recording.omega_ib_b[b:c] - bias) * step, axis=0), axis=1)
    apart = max(float(np.linalg.norm(unit[1] - unit[0])), float(way[-1]) if len(way) else 0.0)
    return bool(apart < _SAME_ATTITUDE and way.max(initial=0.0) < _NUDGE)


def hides_earth_rate(recording: Recording, imu: ImuSpecification) -> bool:
    """Decide whether navigation has nothing to hold on to because a rest does not show the Earth's rate.

    It does not when the gyros' white noise in the usual rest, specified or learned, exceeds a third of it.
    """
    if _EARTH_SEEN * imu.gyro_white_noise < earth.RATE:  # seen within a second: no need to look at the samples
        return False
    try:
        rests = detect_static(recording)
    except DataError:
        return False
    usual = _usual_rest(recording, rests)
    return bool(_EARTH_SEEN * max(imu.gyro_white_noise, rests.gyro_white_noise) / np.sqrt(usual) > earth.RATE)


def _usual_rest(recording: Recording, rests: StaticIntervals) -> float:
    """Median length of a rest (s): of the dwells that the table states, else of the rests found."""
    stated = None if recording.phase is None else recording.phase.usual_dwell_s(float(recording.t[-1]))
    if stated is not None:
        return stated
    return float(np.median(recording.t[rests.last - 1] - recording.t[rests.first]))


def still_samples(recording: Recording, width: int, turning: float, hole: float, scatter: float = SCATTER) -> Bools:
    """Find the samples about which the IMU rests.

    Parameters
    ----------
    width : int
        Samples of the window about each: it rests when both triads scatter as they do in the quietest windows, and the
        mean rate is that of all windows at rest.
    turning : float
        Deviation of the mean rate that is a turn (rad/s).
    hole : float
        Sample intervals between two samples from which nobody knows what happened between them.
    scatter : float
        Scatter (variance) of a window at rest at most, as a multiple of that of the quietest windows.

    Returns
    -------
    ndarray of bool, shape (n,)
        False for half a window at both ends of the recording and to both sides of a hole.
    """
    return _still(recording, width, turning, hole, scatter)[0]


def _still(recording: Recording, width: int, turning: float, hole: float, scatter: float) -> tuple[Bools, Floats]:
    """Find the samples about which the IMU rests (n,), and the mean rate of the window about each (n, 3)."""
    mean = np.zeros(recording.omega_ib_b.shape)
    still = _like_the_quietest(recording.omega_ib_b, width, mean, scatter)
    still &= _like_the_quietest(recording.f_ib_b, width, np.empty((0, 3)), scatter)
    if still.any():
        middle = np.array([np.median(mean[still, axis]) for axis in range(3)])
        _leave_near(mean, middle, turning, still)
    apart = np.diff(recording.t, prepend=0.0) > hole * recording.interval_s
    if apart.any():
        still &= ~(np.convolve(apart, np.ones(width), mode="same")[: len(still)] > 0)
    return still, mean


def _like_the_quietest(values: Floats, width: int, mean: Floats, most: float) -> Bools:
    """Windows that scatter as the quietest do, or less than the resolution of the sensor; fills `mean` as `_slide`."""
    values = np.ascontiguousarray(values)
    scatter = np.full(len(values), np.inf)
    _slide(values, values.mean(axis=0), width, mean, scatter)
    floor = float(np.sum(resolution(values) ** 2) / 12.0)
    like = np.asarray(scatter <= max(most * float(np.quantile(scatter, _QUIETEST)), floor))
    let_go(values)
    return like


@compiled
def _slide(values: Floats, middle: Floats, width: int, mean: Floats, scatter: Floats) -> None:
    """Put mean (n, 3) and summed variance (n,) of `width` samples at the middle one of each window, in place.

    Sums are of ``values - middle``: squares of gravity would leave no digits for its scatter. Near the ends both stay
    what they are. A `mean` of no rows is not filled.
    """
    total, squares = np.zeros(3), np.zeros(3)
    for i in range(len(values)):
        at = i - width + 1 + width // 2
        if i >= width - 1:
            scatter[at] = 0.0
        for k in range(3):
            new = values[i, k] - middle[k]
            total[k] += new
            squares[k] += new * new
            if i >= width:
                old = values[i - width, k] - middle[k]
                total[k] -= old
                squares[k] -= old * old
            if i >= width - 1:
                within = total[k] / width
                if len(mean):
                    mean[at, k] = within + middle[k]
                scatter[at] += squares[k] / width - within * within


@compiled
def _leave_near(mean: Floats, middle: Floats, most: float, still: Bools) -> None:
    """Leave of `still` (n,) what has a mean (n, 3) within `most` of `middle` (3,) on each axis, in place."""
    for i in range(len(still)):
        for k in range(3):
            still[i] &= abs(mean[i, k] - middle[k]) < most


def resolution(values: Floats) -> Floats:
    """Smallest step between neighbouring samples of each axis, shape (3,), in the unit of `values`.

    Parameters
    ----------
    values : ndarray, shape (n, 3)
        Rate or force (rad/s or m/s^2).

    Returns
    -------
    ndarray, shape (3,)
        In the unit of `values`; zero for an axis that never changes.
    """
    smallest = np.full(3, np.inf)
    _smallest_steps(np.ascontiguousarray(values), smallest)
    return np.where(np.isfinite(smallest), smallest, 0.0)


@compiled
def _smallest_steps(values: Floats, smallest: Floats) -> None:
    """Lower `smallest` (3,) to the smallest step between neighbouring rows (n, 3) that is not zero, in place."""
    for i in range(1, len(values)):
        for k in range(3):
            step = abs(values[i, k] - values[i - 1, k])
            if 0.0 < step < smallest[k]:
                smallest[k] = step


def two_sample_variance(values: Floats, first: Ints, last: Ints, width: int) -> tuple[float, int]:
    """Half the mean square of the differences of neighbouring means in the rests: the Allan variance, not overlapping.

    Parameters
    ----------
    values : ndarray, shape (n, 3)
        Rate or force (rad/s or m/s^2).
    first, last : ndarray of int, shape (k,)
        Samples ``first:last`` of each rest.
    width : int
        Samples of a mean.

    Returns
    -------
    variance : float
        Mean of the axes (square of the unit of `values`); 0 where there is no pair.
    count : int
        Number of pairs of neighbours.
    """
    squares, count = 0.0, 0
    for a, b in zip(first, last, strict=True):
        means = block_means(values[a:b], width)
        squares += float(np.sum(np.diff(means, axis=0) ** 2))
        count += max(len(means) - 1, 0)
    return 0.5 * squares / max(3 * count, 1), count


def _density(values: Floats, first: Ints, last: Ints, dt: float) -> float:
    """White-noise density of a triad from successive block means of the rests (two-sample variance)."""
    width = max(round(_BLOCK_S / dt), 1)
    variance, count = two_sample_variance(values, first, last, width)
    if count >= _FEWEST:
        return float(np.sqrt(variance * width * dt))
    within = [np.var(values[a:b], axis=0, ddof=1) for a, b in zip(first, last, strict=True)]
    return float(np.sqrt(np.mean(within) * dt))
