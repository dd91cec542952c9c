"""What a handheld run gives the least squares of `handheld`: means at rest, and the turns between the rests.

Between two rests only the gyros count: a hand moves the IMU about, so velocity and place are unknown. The samples of
a turn are freed of the sensor errors exactly (`correct_cycles`), not to first order, and the derivatives follow the
slope of the errors: with errors of per cent both are needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sdimu_calibration.core.alignment.prepared import nominal_interval
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.data.gaps import GAP_SHARE, open_angle
from sdimu_calibration.core.data.static_detection import StaticIntervals
from sdimu_calibration.core.data.trembling_rests import Sway, sway
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.motion import NO_PAST, Motion
from sdimu_calibration.core.handheld.range_end import at_range_end
from sdimu_calibration.core.matrix3 import elements, multiplied, orthonormal3, rotation3, store
from sdimu_calibration.core.navigation.correct_cycles import correct_cycles
from sdimu_calibration.core.navigation.strapdown import Cycles, Reducer
from sdimu_calibration.core.navigation.track import MAGNETIC_FIELD, Correction, Surroundings, motion, temperatures
from sdimu_calibration.core.recording import Recording, TemperatureLog

_UNSEEN_S = 0.25
"""Length of a gap (s) in a turn from which a hand may have done anything in it: it turns by 20 deg in that time."""
_EPS_S = 1e-9
"""Difference of two times (s) that are one: rounding of sums of intervals is below it."""
_ANY_TURN = 10.0
"""Sigma of the angle of such a turn (rad): more than an angle can be, so that its equation has no weight."""


@dataclass(frozen=True)
class HandheldRun:
    """A handheld recording, reduced: k rests and the k - 1 turns between them."""

    t: Floats
    seconds: Floats
    """`t`, `seconds`: middle and length of each rest (s), shape (k,)."""
    mean: Floats
    """Mean rate (rad/s) and specific force (m/s^2) at each rest, as measured, shape (k, 6)."""
    cycles: Cycles
    first: Ints
    last: Ints
    """`first`, `last`: cycles of each turn, shape (k - 1,)."""
    turn_s: Floats
    path: Floats
    gap: Floats
    """`turn_s`, `path`, `gap`: duration (s), angle summed over all ways (rad), and uncertainty (rad) of what gaps and
    steps of the clock leave open of each turn, shape (k - 1,)."""
    temperature: TemperatureLog | None
    sway: Sway
    """How far the IMU moves about its mean at each rest."""
    whole: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """Shape (w,). Turns that are stated to be whole ones about the vertical."""
    whole_sigma: float = 0.0
    """How well the IMU was put back after them (rad, one sigma)."""

    @property
    def unseen(self) -> Bools:
        """Turns of which a part is missing that may be any motion, shape (k - 1,): they say nothing."""
        return np.asarray(self.gap >= _ANY_TURN)


def reduce_run(recording: Recording, rests: StaticIntervals) -> HandheldRun:
    """Take the means of the rests and the cycles of the turns.

    A turn is cut at whole cycles, of a tenth of a second, inside the two rests that it joins; the means are taken
    between these cuts, so that no sample is used twice.
    """
    nominal = nominal_interval(recording.t)
    cycles = Reducer(nominal).add(recording.t, recording.omega_ib_b, recording.f_ib_b)
    start = cycles.t - cycles.dt
    begin = np.searchsorted(start, recording.t[np.maximum(rests.first - 1, 0)] - _EPS_S)
    end = np.searchsorted(cycles.t, recording.t[rests.last - 1] + _EPS_S, side="right")
    # A rest shorter than its cuts leave keeps the one cycle in its middle.
    end = np.maximum(end, begin + 1)
    total = np.vstack([np.zeros(7), np.cumsum(np.hstack([cycles.dt[:, None], cycles.alpha, cycles.upsilon]), axis=0)])
    part = total[end] - total[begin]
    first, last = end[:-1], begin[1:]
    angle = np.sqrt(np.sum(cycles.alpha**2, axis=1))
    gap = GAP_SHARE**2 * np.sum(cycles.gap_angle**2, axis=1)
    gap[cycles.lost * nominal > _UNSEEN_S] = _ANY_TURN**2
    for step in recording.clock_steps:
        cycle, error = open_angle(step, cycles)
        gap[cycle] += _ANY_TURN**2 if step.size_s > _UNSEEN_S else error**2
    gap[_clipped_cycles(recording, cycles.t)] = _ANY_TURN**2
    return HandheldRun(
        0.5 * (start[begin] + cycles.t[end - 1]),
        part[:, 0],
        part[:, 1:] / part[:, :1],
        cycles,
        first,
        last,
        _sums(cycles.dt, first, last),
        _sums(angle, first, last),
        np.sqrt(_sums(gap, first, last)),
        recording.temperature,
        sway(recording, rests),
    )


def _clipped_cycles(recording: Recording, t: Floats) -> Ints:
    """Cycles, which end at `t` (s), in which a gyro stands at the end of its range: nobody knows its rate there."""
    clipped = np.any(at_range_end(recording)[:, :3], axis=1)
    return np.unique(np.minimum(np.searchsorted(t, recording.t[clipped] - _EPS_S), len(t) - 1))


def _sums(values: Floats, first: Ints, last: Ints) -> Floats:
    """Sum over ranges of rows."""
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    return np.asarray(total[last] - total[first])


def seen_at_rest(run: HandheldRun, C_nb: Floats, rate_n: Floats, gravity: float) -> Motion:
    """Make what a perfect IMU sees at the rests.

    Parameters
    ----------
    run : HandheldRun
        With k rests.
    C_nb : ndarray, shape (k, 3, 3)
        Attitudes (dimensionless).
    rate_n : ndarray, shape (3,)
        Earth's rate in the frame of the attitudes (rad/s).
    gravity : float
        m/s^2.
    """
    k = len(run.t)
    heat, heat_rate = temperatures(run.temperature, run.t, causal=False)
    none = np.zeros((k, 3))
    w = np.einsum("kij,i->kj", C_nb, rate_n)
    return Motion(
        run.t,
        run.seconds,
        w,
        -gravity * C_nb[:, 2, :],
        C_nb,
        none,
        none,
        np.ones(k, dtype=bool),
        heat,
        heat_rate,
        none,
        none,
        np.full(k, np.inf),
        MAGNETIC_FIELD,
        none,
        NO_PAST,
    )


@dataclass(frozen=True)
class Turns:
    """Turns, freed of sensor errors."""

    C_nb: Floats
    """Attitude at the end of each turn, by the gyros, against a frame that does not turn, shape (k - 1, 3, 3)."""
    by_coefficient: Floats
    """Change of that attitude (small turn in n) per unit of each coefficient taken out of the samples,
    shape (k - 1, 3, p)."""
    seen: Motion
    """What a perfect IMU saw in every cycle of the recording."""
    weight: Floats
    """Small turn in n per measured rate (rad/s) and force (m/s^2) of every cycle, shape (n, 3, 6)."""

    def by_parameter(self, run: HandheldRun, values: Floats, terms: Sequence[tuple[int, int]], count: int) -> Floats:
        """Change of the attitudes per unit of some parameters (rad), shape (k - 1, 3, count).

        Parameters
        ----------
        values : ndarray, shape (n, m)
            Regressors of `seen` (SI).
        terms : sequence of (int, int), length m
            Sensor axis and parameter of each column.
        """
        out = np.zeros((len(run.first), 3, count))
        for column, (channel, parameter) in enumerate(terms):
            out[:, :, parameter] -= _sums(self.weight[:, :, channel] * values[:, column, None], run.first, run.last)
        return out


def turns(run: HandheldRun, model: ImuModel, coefficients: Floats, C_nb: Floats, gravity: float) -> Turns:
    """Integrate the gyros over every turn from the attitude of its rest.

    Parameters
    ----------
    coefficients : ndarray, shape (p,)
        At which the samples are corrected (SI).
    C_nb : ndarray, shape (k, 3, 3)
        Attitudes of the rests (dimensionless).
    gravity : float
        m/s^2.
    """
    cycles = run.cycles
    none = np.zeros(len(cycles), dtype=bool)
    # Earth rate is below what the gyros know of themselves here: the table's rate and the body's are one.
    around = Surroundings(0.0, gravity, run.temperature)
    near = motion(cycles, none, Correction(model, coefficients), C_nb[0].copy(), around, predicted=False)
    clean = correct_cycles(cycles, near, model, coefficients)
    phi = clean.cycles.alpha + clean.cycles.coning
    middle, end = _integrate(np.ascontiguousarray(C_nb), run.first, run.last, np.ascontiguousarray(phi))
    weight = middle @ clean.weight[:, :3, :] * cycles.dt[:, None, None]
    found = Turns(end, np.zeros(0), clean.seen, weight)
    terms = list(zip(model.channel.tolist(), model.parameter.tolist(), strict=True))
    known = found.by_parameter(run, model.regressors(clean.seen), terms, len(model.prior))
    return replace(found, by_coefficient=known)


@compiled
def _integrate(C_nb: Floats, first: Ints, last: Ints, phi: Floats) -> tuple[Floats, Floats]:
    """Attitude in the middle of every cycle of the turns (n, 3, 3), and at the end of each turn (k - 1, 3, 3)."""
    middle = np.zeros((phi.shape[0], 3, 3))
    end = np.empty((first.shape[0], 3, 3))
    for k in range(first.shape[0]):
        C = elements(C_nb[k])
        for c in range(first[k], last[k]):
            half = rotation3(0.5 * phi[c, 0], 0.5 * phi[c, 1], 0.5 * phi[c, 2])
            between = multiplied(C, half)
            store(between, middle[c])
            C = orthonormal3(multiplied(between, half))
        store(C, end[k])
    return middle, end
