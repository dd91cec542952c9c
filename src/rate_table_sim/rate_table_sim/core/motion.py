"""The motion of a table that carries out a plan."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from zlib import crc32

import numpy as np

from rate_table_sim.core.attitude import attitude_of, first_orientation
from rate_table_sim.core.profile import trapezoid
from rate_table_sim.core.specification import AXES, Imperfections, TableSpecification
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table.gimbals import assign_turns


@dataclass(frozen=True)
class TableMotion:
    """What the table does, at its sample rate, both ends included."""

    t: Floats
    """Seconds from the start, shape (n,)."""
    angle: Floats
    rate: Floats
    """`angle`, `rate`: shape (n, 3). Axis angles (rad, not wrapped) and rates (rad/s): outer, middle, inner; about x,
    y, z when free."""
    encoder_angle: Floats
    """Angles as the encoders read them (rad), shape (n, 3)."""
    stop: Ints
    """Shape (n,). Index of the stop; while rotating, of the stop that was left."""
    dwell: Bools
    """Phase that holds from the sample on, shape (n,)."""
    q_nt: Floats
    """True orientation of the platform against NED, scalar first, shape (n, 4)."""
    omega_nt_t: Floats
    """True rate of the platform against NED, in t (rad/s), shape (n, 3)."""
    names: tuple[str, str, str]


def table_motion(plan: Plan, table: TableSpecification, seed: int = 0) -> TableMotion:
    """Carry out a plan. `seed`: of the encoder noise; nothing else is random."""
    if table.axes is None:
        columns = tuple((AXES.index(turn.axis), 1.0) for turn in plan.turns)
    else:
        columns = assign_turns(plan, table.axes)
    angle, rate, stop, dwell = _axis_motion(plan, table.sample_rate_hz, columns)
    q_nt, omega = attitude_of(table).motion(angle, rate, angle[0], first_orientation(table))
    return TableMotion(
        t=grid_times(0, len(angle), table.sample_rate_hz),
        angle=angle,
        rate=rate,
        encoder_angle=Encoder(table.imperfections, seed).read(angle),
        stop=stop,
        dwell=dwell,
        q_nt=q_nt,
        omega_nt_t=omega,
        names=table.axis_names,
    )


def phase_changes(motion: TableMotion) -> tuple[Floats, Bools, Ints]:
    """Report phase and stop at every change and once a second.

    Returns
    -------
    t, dwell, stop : ndarray, shape (m,)
        Time (s), True for dwell, index of the stop; each entry holds from its time on.
    """
    at = reported_samples(motion)
    return motion.t[at], motion.dwell[at], motion.stop[at]


def reported_samples(motion: TableMotion, before: TableMotion | None = None) -> Ints:
    """Find the samples at which phase and stop are reported: at every change and once a second.

    Parameters
    ----------
    before : TableMotion, optional
        The stretch before this one; its last sample was reported, or held what was.

    Returns
    -------
    ndarray of int, shape (m,)
        Indices of samples; phase and stop hold from each on.
    """
    state = np.column_stack([motion.stop, motion.dwell, np.floor(motion.t + 1e-9)])
    if before is None:
        return np.flatnonzero(np.r_[True, np.any(np.diff(state, axis=0) != 0, axis=1)])
    last = (before.stop[-1], before.dwell[-1], np.floor(before.t[-1] + 1e-9))
    return np.flatnonzero(np.any(np.diff(np.vstack([last, state]), axis=0) != 0, axis=1))


def grid_times(first: int, stop: int, rate_hz: float) -> Floats:
    """Return the times of the samples first ... stop - 1 (s)."""
    # k * denominator / numerator keeps 0.01 s steps at the nearest double, without accumulation.
    rate = Fraction(rate_hz).limit_denominator(10**6)
    return np.arange(first, stop) * rate.denominator / rate.numerator


def _axis_motion(
    plan: Plan, sample_rate_hz: float, columns: tuple[tuple[int, float], ...]
) -> tuple[Floats, Floats, Ints, Bools]:
    """Angle and rate (n, 3), stop and dwell (n,)."""
    profiles = [
        trapezoid(turn, plan.acceleration_rad_s2, sample_rate_hz, k) for k, turn in enumerate(plan.turns, start=1)
    ]
    rests = [round(length * sample_rate_hz) for length in plan.dwell_s]
    if min(rests) < 1:
        raise DataError(f"plan {plan.name}: stop {rests.index(min(rests))} is shorter than a table sample")
    n = sum(rests) + sum(p.samples for p in profiles) + 1
    angle, rate = np.zeros((n, 3)), np.zeros((n, 3))
    stop, dwell = np.zeros(n, dtype=np.int64), np.ones(n, dtype=np.bool_)
    at = rests[0]
    for number, (profile, (column, sign), rest) in enumerate(zip(profiles, columns, rests[1:], strict=True), start=1):
        end = at + profile.samples
        turned, speed = profile.angle_and_rate()
        angle[at + 1 :] = angle[at]
        angle[at : end + 1, column] += sign * turned
        angle[end:] = angle[end]
        rate[at : end + 1, column] = sign * speed
        dwell[at:end] = False
        stop[end:] = number
        at = end + rest
    return angle, rate, stop, dwell


class Encoder:
    """Reads the angles of the axes, block by block with the digits of one block."""

    def __init__(self, errors: Imperfections, seed: int) -> None:
        self._errors = errors
        self._random = np.random.default_rng(np.random.SeedSequence([seed, crc32(b"encoder")]))

    def read(self, angle: Floats) -> Floats:
        """Angles as read, shape (n, 3) (rad), of the true ones."""
        reading = angle
        if self._errors.encoder_noise_rad:
            reading = reading + self._errors.encoder_noise_rad * self._random.standard_normal(angle.shape)
        if self._errors.encoder_resolution_rad:
            reading = np.round(reading / self._errors.encoder_resolution_rad) * self._errors.encoder_resolution_rad
        return reading.copy()
