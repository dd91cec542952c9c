"""The motion of a table that carries out a plan."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from rate_table_sim.core.gimbal import gimbal_axes, gimbal_motion, quaternion_product, turn_quaternion
from rate_table_sim.core.profile import trapezoid
from rate_table_sim.core.specification import AXES, Imperfections, TableSpecification
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table.gimbals import assign_turns, unit

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TableMotion:
    """What the table does, at its sample rate, both ends included.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Seconds from the start.
    angle, rate : ndarray, shape (n, 3)
        Axis angles (rad, not wrapped) and rates (rad/s): outer, middle, inner; about x, y, z when free.
    encoder_angle : ndarray, shape (n, 3)
        Angles as the encoders read them (rad).
    stop : ndarray of int, shape (n,)
        Index of the stop; while rotating, of the stop that was left.
    dwell : ndarray of bool, shape (n,)
        Phase that holds from the sample on.
    q_nt : ndarray, shape (n, 4)
        True orientation of the platform against NED, scalar first.
    omega_nt_t : ndarray, shape (n, 3)
        True rate of the platform against NED, in t (rad/s).
    names : tuple of str
        Of the three axes.
    """

    t: Floats
    angle: Floats
    rate: Floats
    encoder_angle: Floats
    stop: NDArray[np.int64]
    dwell: NDArray[np.bool_]
    q_nt: Floats
    omega_nt_t: Floats
    names: tuple[str, str, str]


def table_motion(plan: Plan, table: TableSpecification, seed: int = 0) -> TableMotion:
    """Carry out a plan.

    Parameters
    ----------
    plan : Plan
    table : TableSpecification
    seed : int
        Of the encoder noise; nothing else is random.

    Raises
    ------
    DataError
        When a turn exceeds the acceleration limit or no gimbal axis can make it.
    """
    if table.axes is None:
        columns = tuple((AXES.index(turn.axis), 1.0) for turn in plan.turns)
    else:
        columns = assign_turns(plan, table.axes)
    angle, rate, stop, dwell, turned_by = _axis_motion(plan, table.sample_rate_hz, columns)
    if table.axes is None:
        q_nt, omega = _free_motion(plan, angle, rate, turned_by, table.imperfections)
    else:
        q_nt, omega = _gimbal_motion(angle, rate, table.axes, table.imperfections)
    return TableMotion(
        t=_grid(len(angle), table.sample_rate_hz),
        angle=angle,
        rate=rate,
        encoder_angle=_encoder(angle, table.imperfections, seed),
        stop=stop,
        dwell=dwell,
        q_nt=q_nt,
        omega_nt_t=omega,
        names=table.axis_names,
    )


def phase_changes(motion: TableMotion) -> tuple[Floats, NDArray[np.bool_], NDArray[np.int64]]:
    """Report phase and stop at every change and once a second.

    Returns
    -------
    t, dwell, stop : ndarray, shape (m,)
        Time (s), True for dwell, index of the stop; each entry holds from its time on.
    """
    changed = np.r_[True, (np.diff(motion.stop) != 0) | (motion.dwell[1:] != motion.dwell[:-1])]
    seconds = np.arange(int(motion.t[-1] + 1e-9) + 1)
    at = np.union1d(np.flatnonzero(changed), np.searchsorted(motion.t, seconds - 1e-9))
    at = at[at < len(motion.t)]
    return motion.t[at], motion.dwell[at], motion.stop[at]


def _grid(n: int, rate_hz: float) -> Floats:
    # k * denominator / numerator keeps 0.01 s steps at the nearest double, without accumulation.
    rate = Fraction(rate_hz).limit_denominator(10**6)
    return np.arange(n) * rate.denominator / rate.numerator


def _axis_motion(
    plan: Plan, sample_rate_hz: float, columns: tuple[tuple[int, float], ...]
) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Angle and rate (n, 3), stop and dwell (n,), and the number of turns begun before each sample (n,)."""
    profiles = [
        trapezoid(turn, plan.acceleration_rad_s2, sample_rate_hz, k) for k, turn in enumerate(plan.turns, start=1)
    ]
    rests = [round(length * sample_rate_hz) for length in plan.dwell_s]
    if min(rests) < 1:
        raise DataError(f"plan {plan.name}: stop {rests.index(min(rests))} is shorter than a table sample")
    n = sum(rests) + sum(p.samples for p in profiles) + 1
    angle, rate = np.zeros((n, 3)), np.zeros((n, 3))
    stop, dwell = np.zeros(n, dtype=np.int64), np.ones(n, dtype=np.bool_)
    begun = np.zeros(n, dtype=np.int64)
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
        begun[at + 1 :] = number
        at = end + rest
    return angle, rate, stop, dwell, begun


def _gimbal_motion(
    angle: Floats, rate: Floats, axes: tuple[str, str, str], errors: Imperfections
) -> tuple[Floats, Floats]:
    axis = gimbal_axes(axes, errors)
    p = np.cross(unit(axes[1]), axis[2])
    p /= np.linalg.norm(p)
    frame = np.array([p, np.cross(axis[2], p)])
    return gimbal_motion(angle, rate, axis, _base_tilt(errors), errors.wobble_rad, frame)


def _base_tilt(errors: Imperfections) -> Floats:
    return np.array([errors.base_tilt_north_rad, errors.base_tilt_east_rad, 0.0])


def _free_motion(
    plan: Plan, angle: Floats, rate: Floats, begun: NDArray[np.int64], errors: Imperfections
) -> tuple[Floats, Floats]:
    """Orientation when every turn is about a platform axis: a product of turns, no gimbals."""
    gimbal_errors = (
        errors.outer_middle_nonorthogonality_rad,
        errors.middle_inner_nonorthogonality_rad,
        errors.wobble_rad,
    )
    if any(gimbal_errors):
        raise DataError("a table with axes: free has no gimbals: set non-orthogonality and wobble to 0")
    q_nt = np.empty((len(angle), 4))
    q_nt[begun == 0] = turn_quaternion(_base_tilt(errors))
    for number, turn in enumerate(plan.turns, start=1):
        column = AXES.index(turn.axis)
        here = np.flatnonzero(begun == number)
        turned = angle[here, column] - angle[here[0] - 1, column]
        before = q_nt[here[0] - 1]
        about = quaternion_product(before, np.eye(4)[1 + column])
        # q (cos + e sin) = q cos + (q e) sin: one product per turn.
        q_nt[here] = np.outer(np.cos(0.5 * turned), before) + np.outer(np.sin(0.5 * turned), about)
    return q_nt, rate.copy()


def _encoder(angle: Floats, errors: Imperfections, seed: int) -> Floats:
    reading = angle
    if errors.encoder_noise_rad:
        rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(b"encoder")]))
        reading = reading + errors.encoder_noise_rad * rng.standard_normal(angle.shape)
    if errors.encoder_resolution_rad:
        reading = np.round(reading / errors.encoder_resolution_rad) * errors.encoder_resolution_rad
    return reading.copy()
