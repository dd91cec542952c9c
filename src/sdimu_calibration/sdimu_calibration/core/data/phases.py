"""Dwell or not: what the table says, checked against what the IMU feels.

An epoch is used for measurements when the table says dwell all through it, the IMU agrees, and the settling time
after the last motion is over. Where the table says nothing (no status topic, or none for `STALE_S`), the
IMU decides alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Bools, Ints
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.effects.bias import ACCEL_BIAS, GYRO_BIAS
from sdimu_calibration.core.effects.mass_unbalance import GYRO_MASS_UNBALANCE
from sdimu_calibration.core.effects.scale import ACCEL_SCALE
from sdimu_calibration.core.navigation.strapdown import CYCLE_S
from sdimu_calibration.core.probability import GAUSS_MAD
from sdimu_calibration.core.recording import DataFault, PhaseLog
from sdimu_calibration.core.specification import EPOCH_S, ImuSpecification
from sdimu_calibration.core.units import STANDARD_GRAVITY

STALE_S = 2.5
"""Age from which a status says nothing any more (s): it is sent at every change and at 1 Hz."""
RESTART_S = 110.0
"""Time at rest (s) after which navigation starts anew from the known point: by g times the square of an attitude error
of 1e-4 rad, two digits below the sigma of the velocity."""
_SIGMAS = 6.0
"""Limit of rest (sigma of what bias and noise can do): beyond it the guard calls an IMU moving."""

_WHOLE_S = 1.5 * EPOCH_S
"""Longest epoch that measures (s): a longer one has a gap in it."""
_DENIED = 0.1
"""Share of the rest that a status may call rotating unnoticed: its tables settle."""

_LEAST_FORCE = 0.01 * STANDARD_GRAVITY
"""Least limit of the force at rest (m/s^2): a force error that nobody specified must not throw away the stops that show
it."""


@dataclass(frozen=True)
class RestLimits:
    """What an IMU at rest can show at most."""

    rate: float
    """Body rate (rad/s)."""
    force: float
    """Deviation of |f| from gravity (m/s^2)."""
    shaken: float = 0.0
    """Rate of a cycle (rad/s) where the table says dwell and vibrates; 0 where it does not."""


def rest_limits(imu: ImuSpecification) -> RestLimits:
    """Limits of rest from an IMU's specification."""
    prior = imu.prior
    bias = np.hypot(prior.get(GYRO_BIAS.name, 0.0), prior.get(GYRO_MASS_UNBALANCE.name, 0.0))
    seen = imu.in_means_over(CYCLE_S)
    noise = seen.gyro_white_noise / np.sqrt(CYCLE_S)
    force = np.hypot(prior.get(ACCEL_BIAS.name, 0.0), STANDARD_GRAVITY * prior.get(ACCEL_SCALE.name, 0.0))
    return RestLimits(
        rate=earth.RATE + _SIGMAS * float(np.sqrt(3.0) * np.hypot(bias, noise)),
        force=max(_LEAST_FORCE, _SIGMAS * float(np.hypot(force, imu.in_means_over(EPOCH_S).accel_white_noise))),
    )


@dataclass
class PhaseState:
    """What the classification of one block hands to the next."""

    motion_end: float = -np.inf
    at_rest: bool = True
    fresh: bool = False
    stop: int = 0


@dataclass(frozen=True)
class Phases:
    """Phase of each epoch."""

    dwell: Bools
    """Table (or the IMU, where the table is silent) says rest and the IMU agrees, shape (m,)."""
    used: Bools
    """A measurement is taken, shape (m,)."""
    first: Bools
    """The first measurement after motion, shape (m,)."""
    stop: Ints
    """Index of the stop, shape (m,)."""
    contradicted: Bools
    """The table says dwell while the IMU moves, shape (m,)."""
    denied: Bools
    """The table says rotating while the IMU rests, shape (m,)."""


def table_says(epochs: Epochs, log: PhaseLog | None) -> tuple[NDArray[np.int8], Ints]:
    """Say what the status holds of each epoch.

    Returns
    -------
    said : ndarray of int8, shape (m,)
        1 dwell all through, 0 rotating in some, -1 nothing.
    stop : ndarray of int, shape (m,)
    """
    m = len(epochs)
    if log is None or not len(log.t):
        return np.full(m, -1, dtype=np.int8), np.full(m, -1, dtype=np.int64)
    eps = 1e-6
    i0 = np.searchsorted(log.t, epochs.start + eps, side="right") - 1
    i1 = np.searchsorted(log.t, epochs.end - eps, side="right") - 1
    known = (i0 >= 0) & (epochs.end - log.t[np.maximum(i1, 0)] <= STALE_S)
    rotating_before = np.concatenate([[0], np.cumsum(~log.dwell)])
    rotating = rotating_before[i1 + 1] - rotating_before[np.maximum(i0, 0)] > 0
    said = np.where(rotating, 0, 1).astype(np.int8)
    said[~known] = -1
    # Numbers that change at rest, or do not change over a turn, would join what is apart: then dwells are counted.
    stop = log.stop if numbers_make_sense(log) else np.full(len(log.t), -1, dtype=np.int64)
    return said, np.where(known, stop[np.maximum(i1, 0)], -1)


def numbers_make_sense(log: PhaseLog) -> bool:
    """Whether the status gives every dwell a number of its own."""
    dwell = np.flatnonzero(log.dwell)
    begins = np.concatenate([[True], np.diff(dwell) > 1])[: len(dwell)]
    number = log.stop[dwell]
    changes = np.concatenate([[True], np.diff(number) != 0])[: len(dwell)]
    return bool((begins == changes).all()) and len(np.unique(number[begins])) == int(begins.sum())


def classify(
    epochs: Epochs, log: PhaseLog | None, limits: RestLimits, gravity: float, settle_s: float, state: PhaseState
) -> Phases:
    """Decide the phase of each epoch.

    Parameters
    ----------
    gravity : float
        At the site (m/s^2).
    settle_s : float
        No measurement for this long after motion (s).
    state : PhaseState
        Carried from block to block, changed in place.
    """
    said, said_stop = table_says(epochs, log)
    calm = (said == 1) & (np.sqrt(np.sum(epochs.w_mean**2, axis=1)) < limits.rate)
    quiet = (epochs.peak_rate < limits.rate) | (calm & (epochs.peak_rate < limits.shaken))
    still = quiet & (np.abs(np.sqrt(np.sum(epochs.f_mean**2, axis=1)) - gravity) < limits.force)
    m = len(epochs)
    dwell = still & (said != 0)
    whole = epochs.end - epochs.start < _WHOLE_S
    used = np.zeros(m, dtype=bool)
    first = np.zeros(m, dtype=bool)
    stop = np.zeros(m, dtype=np.int64)
    for k in range(m):
        if dwell[k] and not state.at_rest:
            state.stop += 1
        state.at_rest = bool(dwell[k])
        if not dwell[k]:
            state.motion_end, state.fresh = epochs.end[k], True
        elif whole[k] and epochs.start[k] >= state.motion_end + settle_s - 1e-6:
            used[k], first[k] = True, state.fresh
            state.fresh = False
        if said_stop[k] >= 0:
            state.stop = int(said_stop[k])
        stop[k] = state.stop
    return Phases(dwell, used, first, stop, (said == 1) & ~still, (said == 0) & still)


def without_early_motion(epochs: Epochs, log: PhaseLog | None, phases: Phases, gyro_white_noise: float) -> Phases:
    """Take the last seconds of a dwell away in which a turn began gently, where the table is silent.

    `RestLimits.rate` has room for bias and Earth rate. A turn that starts without a jump of its acceleration stays
    below it for a second, at a hundred sigma of the noise. Only seconds before a turn are judged, by the mean rate of
    their own dwell: no sensor error comes before its cause, whereas what follows a turn may be one.

    Parameters
    ----------
    gyro_white_noise : float
        Of the specification (rad/s/sqrt(Hz)); the recording's own is taken where it is larger.
    """
    silent = table_says(epochs, log)[0] < 0
    dwell = phases.dwell.copy()
    ends = np.flatnonzero(dwell[:-1] & silent[:-1] & ~dwell[1:])
    if not len(ends):
        return phases
    pairs = dwell[1:] & dwell[:-1]
    steps = np.abs(np.diff(epochs.w_mean, axis=0)[pairs])
    measured = GAUSS_MAD / np.sqrt(2.0) * float(np.median(steps)) if len(steps) else 0.0
    limit = _EARLY_SIGMAS * max(gyro_white_noise / np.sqrt(EPOCH_S), measured)
    moving = np.concatenate([[-1], np.flatnonzero(~dwell)])
    for end in ends:
        start = int(moving[np.searchsorted(moving, end) - 1]) + 1
        middle = np.median(epochs.w_mean[start : end + 1], axis=0)
        away = np.max(np.abs(epochs.w_mean[start : end + 1] - middle), axis=1) > limit
        # The first half of a dwell is what the rest is compared with.
        k = end
        while k > (start + end) // 2 and away[k - start]:
            dwell[k] = False
            k -= 1
    return replace(phases, dwell=dwell, used=phases.used & dwell, first=phases.first & dwell)


_EARLY_SIGMAS = 5.0
"""Deviation from the mean rate of its dwell (sigma): beyond it the last second before a turn belongs to the turn."""


def restarts(epochs: Epochs, phases: Phases) -> Bools:
    """Epochs before which navigation starts anew from the known point, `RESTART_S` apart in the rest of a stop.

    Returns
    -------
    ndarray of bool, shape (e,)
    """
    out = np.zeros(len(phases.used), dtype=bool)
    # A second in a rest that is not used does not make it a new rest.
    at = np.flatnonzero(phases.used)
    if not len(at):
        return out
    begins = np.append(True, np.diff(phases.stop[at]) != 0)
    first = np.maximum.accumulate(np.where(begins, np.arange(len(at)), 0))
    count = np.floor((epochs.start[at] - epochs.start[at[first]] + 1e-6) / RESTART_S)
    out[at] = ~begins & (count > np.append(0.0, count[:-1]))
    return out


def contradictions(epochs: Epochs, phases: Phases, log: PhaseLog | None, feels_turns: bool) -> tuple[DataFault, ...]:
    """Say where the status and the IMU do not agree.

    Parameters
    ----------
    feels_turns : bool
        The specification distinguishes a slow turn from rest; without it rest is no statement against the status.
    """
    length = epochs.end - epochs.start
    out = []
    for where, kind, text in (
        (phases.contradicted, "motion at rest", "the IMU moved for {:.0f} s in which the table said dwell"),
        (phases.denied, "status", "the table said rotating for {:.0f} s in which the IMU rested"),
    ):
        seconds = float(length[where].sum()) if feels_turns or kind != "status" else 0.0
        if seconds > (_DENIED * float(length[phases.dwell].sum()) if kind == "status" else 0.0):
            t = epochs.start[where]
            line = f"{text.format(seconds)} (first at {t[0]:.1f} s, stop {phases.stop[where][0]}); not used"
            out.append(DataFault(kind, line, round(seconds), float(t[0]), float(epochs.end[where][-1])))
    if log is not None and len(log.t) and epochs.end[-1] - log.t[-1] > STALE_S:
        begin, end = float(log.t[-1]), float(epochs.end[-1])
        line = f"the status ends at {begin:.1f} s, the recording at {end:.1f} s: between, the IMU alone decides on rest"
        out.append(DataFault("status", line, round(end - begin), begin, end))
    return tuple(out)
