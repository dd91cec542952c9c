"""Missing samples: what stands in their place, how far it is known, and when it is not known well enough.

**White noise.** A gap of m samples is bridged by the mean of its two neighbours (`strapdown`), whose noise then counts
1 + m/2 times instead of once. Against m + 2 samples of their own the variance of the integral grows from m + 2 to
2 (1 + m/2)^2, by m + m^2/2 samples. An epoch that holds n intervals has 1 + (m + m^2/2) / n times the variance, in
the navigation and in both Zw and Zf, because both take the same bridged samples.

**Motion.** In a turn the rate within the gap is not known. With an angular acceleration of at most a (the largest
within half a second of a short gap, or in the recording) the missing angle lies within +- a T^2 / 4 of the straight
line between the two neighbours: the area of the steepest way up and down again. The sigma is that bound over the root
of three. Rates that differ at the two ends leave less room, but only if they are known at the very ends: a corner of
the motion beside the gap tells otherwise. The force turns with the body: a straight line between two directions an
angle A apart is too short by up to g A^2 / 12 in the mean, and wrong by g times what the angle is wrong.

**At rest** nothing is added: an IMU that rests before and after, with the same force and rate, did not move; where
these differ it moved or was switched off, and no covariance is honest. Source: own derivation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.phases import Phases
from sdimu_calibration.core.navigation.strapdown import Cycles
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import ClockStep, DataError, DataFault
from sdimu_calibration.core.results import NOT_TRUSTED
from sdimu_calibration.core.wording import Work

_TOLD = 0.5
"""Ratio of the sigma of a step's angle to that angle from which a pause of the driver is not excluded: gravity leaves
less."""
GAP_SHARE = 0.1
"""Uncertainty of a bridged angle, as a share of it: a turn need not run on evenly."""
LINEAR_RAD = 1e-3
"""Attitude error (sigma) from which the linearised filter errs by more than its noise: g d^2 / 2 is 0.5 ug."""
_LONG_S = 2.0
"""Length of a gap at rest (s) from which people must know of it: long enough to switch an IMU off and on."""
_COMPARED_S = 20.0
"""Longest reading on each side of a gap that is compared (s): biases hardly change over it."""
_DIFFERENT = 6.0
"""Difference (sigma) from which readings before and after a gap at rest are called different: chance ends below."""
_LEAST_COMPARED_S = 3.0
"""Shortest reading on each side of a gap that is compared (s): a shorter one is noise."""
_STILL_RAD_S2 = 1e-4
"""Least angular acceleration reckoned with (rad/s^2): where none is seen there may still be some."""
_NEAR_S = 0.5
"""Time before and after a gap that says how steady a turn runs (s): ramps are longer."""
_SHORT_S = 0.25
"""Length of a gap (s) that is taken for steady: a turn that runs steady before and after it has no time to change."""


@dataclass(frozen=True)
class Bridges:
    """What missing samples leave uncertain."""

    white: Floats
    """Variance of the white noise of each epoch over that of a whole one, shape (e,)."""
    angle: Floats
    velocity: Floats
    """`angle`, `velocity`: sigma of the attitude (rad) and velocity (m/s) that each epoch adds, about every axis,
    shape (e,)."""


def largest_acceleration(cycles: Cycles) -> float:
    """Largest angular acceleration between neighbouring whole cycles (rad/s^2)."""
    whole = (cycles.lost[1:] == 0) & (cycles.lost[:-1] == 0)
    if not whole.any():
        return _STILL_RAD_S2
    return max(float(_steps(cycles)[whole].max()), _STILL_RAD_S2)


def _steps(cycles: Cycles) -> Floats:
    """Angular acceleration between neighbouring cycles (rad/s^2), shape (n - 1,)."""
    rate = cycles.alpha / cycles.dt[:, None]
    step = np.sqrt(np.sum(np.diff(rate, axis=0) ** 2, axis=1))
    return np.asarray(step * 2.0 / (cycles.dt[1:] + cycles.dt[:-1]))


def _nearby(cycles: Cycles) -> Floats:
    """Largest angular acceleration within `_NEAR_S` of each cycle (rad/s^2), shape (n,)."""
    from scipy.ndimage import maximum_filter1d  # noqa: PLC0415 (0.2 s that a whole recording does not need)

    step = _steps(cycles)
    beside = np.maximum(np.append(step, 0.0), np.insert(step, 0, 0.0))
    width = 2 * math.ceil(_NEAR_S / float(np.median(cycles.dt))) + 1
    return np.asarray(np.maximum(maximum_filter1d(beside, width, mode="nearest"), _STILL_RAD_S2))


def bridges(
    cycles: Cycles, epochs: Epochs, dwell: Bools, nominal_s: float, acceleration: float, gravity: float
) -> Bridges:
    """Uncertainty that missing samples leave in each epoch.

    Parameters
    ----------
    dwell : ndarray of bool, shape (e,)
    nominal_s : float
        Sample interval (s).
    acceleration : float
        Largest angular acceleration to reckon with in a gap of any length (rad/s^2).
    gravity : float
        m/s^2.
    """
    e = len(epochs)
    at = np.flatnonzero(cycles.lost > 0)
    white, angle, velocity = np.ones(e), np.zeros(e), np.zeros(e)
    if not len(at):
        return Bridges(white, angle, velocity)
    m = cycles.lost[at].astype(np.float64)
    epoch = np.searchsorted(epochs.last, at, side="right")
    inside = epoch < e
    at, m, epoch = at[inside], m[inside], epoch[inside]
    intervals = np.maximum((epochs.end - epochs.start) / nominal_s, 1.0)
    white += np.bincount(epoch, m + 0.5 * m**2, e) / intervals
    moving = ~_rests(dwell, epoch)
    at, m, epoch = at[moving], m[moving], epoch[moving]
    T = m * nominal_s
    rate = cycles.alpha / cycles.dt[:, None]
    before, after = rate[np.maximum(at - 1, 0)], rate[np.minimum(at + 1, len(rate) - 1)]
    # The rates beside the gap are means over a sample each: they are half a sample further apart than its ends.
    steepest = np.where(T <= _SHORT_S, _nearby(cycles)[at], acceleration)
    bound = 0.25 * steepest * (T + 0.5 * nominal_s) ** 2
    error = bound / np.sqrt(3.0)
    turned = np.sqrt(np.sum((0.5 * (before + after)) ** 2, axis=1)) * T + error
    force = gravity * T * np.hypot(turned**2 / 12.0, error)
    angle[:] = np.sqrt(np.bincount(epoch, error**2, e))
    velocity[:] = np.sqrt(np.bincount(epoch, force**2, e))
    return Bridges(white, angle, velocity)


_ONE_BY_ONE = 3
"""Number of equal steps of the clock at most that are told one by one: more have one cause."""


def stepped(
    found: Bridges, cycles: Cycles, epochs: Epochs, dwell: Bools, steps: tuple[ClockStep, ...], gravity: float
) -> tuple[Bridges, tuple[DataFault, ...]]:
    """Add what steps of the clock leave uncertain, and tell them.

    Where stamps go on, the angle that was turned in the length of the step is that between the samples or nothing, as
    the driver paused or the clock was set: the sigma is that angle over the root of three, or what gravity leaves
    (`whole_steps`). No pause sets stamps back.

    Parameters
    ----------
    dwell : ndarray of bool, shape (e,)
    gravity : float
        m/s^2.
    """
    angle, velocity, faults = found.angle.copy(), found.velocity.copy(), []
    for step in steps:
        cycle, error = open_angle(step, cycles)
        epoch = min(int(np.searchsorted(epochs.last, cycle, side="right")), len(epochs) - 1)
        resting = bool(_rests(dwell, np.array([epoch]))[0])
        if not resting:
            angle[epoch] = math.hypot(angle[epoch], error)
            velocity[epoch] = math.hypot(velocity[epoch], gravity * abs(step.size_s) * error)
        faults.append(step_fault(step, resting))
    return Bridges(found.white, angle, velocity), told_together(faults)


def open_angle(step: ClockStep, cycles: Cycles) -> tuple[int, float]:
    """Place a step of the clock among the cycles, with the sigma of the angle (rad) that it leaves open."""
    cycle = min(int(np.searchsorted(cycles.t, step.t)), len(cycles) - 1)
    if step.size_s <= 0.0:
        return cycle, 0.0
    return cycle, float(np.linalg.norm(cycles.alpha[cycle])) / float(cycles.dt[cycle]) * step.size_s * step.open


def step_fault(step: ClockStep, resting: bool) -> DataFault:
    """Tell a step of the clock."""
    pause = ", or the driver paused" if step.size_s > 0.0 and step.open > _TOLD else ""
    text = f"{step} {'at rest' if resting else 'while the IMU turned'}{pause}: samples are taken as even"
    return DataFault("clock", text, 1, step.t, step.t)


def told_together(steps: Sequence[DataFault]) -> tuple[DataFault, ...]:
    """Tell steps of the clock that are alike in one line, where they are many. `steps`: as `step_fault` tells them."""
    alike: dict[str, list[DataFault]] = {}
    for one in steps:
        alike.setdefault(one.text.replace(f" at {one.start_s:.1f} s", ""), []).append(one)
    out: list[DataFault] = []
    for own in alike.values():
        if len(own) <= _ONE_BY_ONE:
            out += own
            continue
        begin, end = own[0].start_s, own[-1].end_s
        often = f", {len(own)} times from {begin:.1f} to {end:.1f} s,"
        out.append(DataFault("clock", own[0].text.replace(f" at {begin:.1f} s", often), len(own), begin, end))
    return tuple(sorted(out, key=lambda fault: fault.start_s))


def weighed(found: Bridges, epochs: Epochs, t: Floats, excess: Floats) -> Bridges:
    """Add noise beyond the usual to the epochs it falls into.

    Parameters
    ----------
    t : ndarray, shape (k,)
        Times of the noise (s), as `sample_screening.wild` gives them.
    excess : ndarray, shape (k,)
        Variance beyond the usual one, over the usual one, times its length (s), as `sample_screening.wild` gives it.
    """
    if not len(t):
        return found
    at = np.searchsorted(epochs.end, t)
    at, excess = at[at < len(epochs)], excess[at < len(epochs)]
    more = np.bincount(at, excess, len(epochs)) / (epochs.end - epochs.start)
    return Bridges(found.white + more, found.angle, found.velocity)


def _rests(dwell: Bools, epoch: Ints) -> Bools:
    """Whether the IMU rests in an epoch and in those beside it."""
    last = len(dwell) - 1
    return np.asarray(dwell[epoch] & dwell[np.maximum(epoch - 1, 0)] & dwell[np.minimum(epoch + 1, last)])


def judge(
    cycles: Cycles,
    epochs: Epochs,
    phases: Phases,
    nominal_s: float,
    found: Bridges,
    noise: tuple[float, float],
    unsound: tuple[DataFault, ...] = (),
) -> tuple[DataFault, ...]:
    """Say what is missing, and refuse what cannot be bridged.

    Parameters
    ----------
    noise : tuple of float
        White noise densities of gyro (rad/s/sqrt(Hz)) and accelerometer (m/s^2/sqrt(Hz)).
    unsound : tuple of DataFault
        Why samples were taken away; said with a refusal.
    """
    at = np.flatnonzero(cycles.lost > 0)
    length = epochs.end - epochs.start
    drift = np.hypot(found.angle, noise[0] * np.sqrt(np.maximum(found.white - 1.0, 0.0) * length))
    worst = int(np.argmax(drift))
    if drift[worst] > LINEAR_RAD:
        missing = cycles.lost[epochs.first[worst] : epochs.last[worst]].sum() * nominal_s
        because = f" ({'; '.join(fault.text for fault in unsound)})" if unsound else ""
        where = "at rest" if phases.dwell[worst] else "while the IMU turned"
        usual = "stamps are uncertain" if found.angle[worst] > 0.0 else "readings are wild"
        what = f"{missing:.2f} s of samples are missing" if missing else usual
        raise DataError(
            f"/imu/data_raw: {what} {where} at {epochs.start[worst]:.1f} s (stop "
            f"{phases.stop[worst]}): the attitude after them is known only to {np.degrees(drift[worst]) * 60.0:.3g} "
            f"arcmin; repeat the test, or cut the recording before or after ({Work.CUT}){because}"
        )
    epoch = np.minimum(np.searchsorted(epochs.last, at, side="right"), len(epochs) - 1)
    resting = _rests(phases.dwell, epoch)
    long = cycles.lost[at] * nominal_s >= _LONG_S
    faults = [
        _long_gap(cycles, epochs, phases, int(k), int(e), nominal_s, noise)
        for k, e in zip(at[resting & long], epoch[resting & long], strict=True)
    ]
    for rows, where in ((at[resting], "at rest"), (at[~resting], "while the IMU turned")):
        if len(rows):
            lost = int(cycles.lost[rows].sum())
            t = cycles.t[rows]
            missing = f"{counted(lost, 'sample is', 'samples are')} missing by their stamps {where}"
            text = f"{missing}, {counted(len(rows), 'gap')}, bridged"
            faults.append(DataFault("gap", text, lost, float(t[0]), float(t[-1])))
    return tuple(faults)


def _long_gap(
    cycles: Cycles, epochs: Epochs, phases: Phases, cycle: int, epoch: int, nominal_s: float, noise: tuple[float, float]
) -> DataFault:
    """Compare what is before a long gap at rest with what is after it."""
    seconds = float(cycles.lost[cycle]) * nominal_s
    at = float(cycles.t[cycle]) - seconds
    text = f"{seconds:.1f} s of samples are missing at rest at {at:.1f} s (stop {phases.stop[epoch]})"
    sides = [_beside(phases.dwell, epoch, step) for step in (-1, 1)]
    length = epochs.end - epochs.start
    total = [float(length[rows].sum()) for rows in sides]
    if min(total) >= _LEAST_COMPARED_S:
        for triad, mean, density in (("gyro", epochs.w_mean, noise[0]), ("accelerometer", epochs.f_mean, noise[1])):
            a, b = ((mean[rows] * length[rows, None]).sum(axis=0) / s for rows, s in zip(sides, total, strict=True))
            sigma = density * np.sqrt(1.0 / total[0] + 1.0 / total[1])
            z = np.abs(b - a) / max(sigma, 1e-30)
            if z.max() > _DIFFERENT:
                worst = f"{triad} {'xyz'[int(np.argmax(z))]}"
                raise DataError(
                    f"/imu/data_raw: {text}, and {worst} differs by {z.max():.0f} sigma after "
                    f"them: the IMU was moved or switched off; cut the recording there ({Work.CUT}), or repeat it"
                )
    told = f"{text}: if the IMU was switched off, its biases may have changed, and the estimate is {NOT_TRUSTED}"
    return DataFault(
        "long gap", Note(told, Topic.NOT_TRUSTED), int(cycles.lost[cycle]), at, float(cycles.t[cycle]), grave=True
    )


def _beside(dwell: Bools, epoch: int, step: int) -> Ints:
    """Epochs of the same rest on one side of an epoch, at most `_COMPARED_S`."""
    out: list[int] = []
    k = epoch + step
    while 0 <= k < len(dwell) and dwell[k] and len(out) < _COMPARED_S:
        out.append(k)
        k += step
    return np.array(out, dtype=np.int64)
