"""Recording of a plan by a perfect IMU: no sensor errors, no noise.

The table turns about its own axes; a constant mount rotation relates them to those of the IMU. A turn is a rotation
about one fixed axis with a trapezoidal rate, so the angle is a closed formula at every instant, and the sensors measure
a constant vector turned by that angle. Its mean over a sample is a mean of a cosine and a sine, computed by
Gauss-Legendre with three nodes (error of sixth order in the angle of one sample).

Used by the covariance simulation and the bound of the batch estimator. The simulator of the tests is a separate
implementation, so that an error here cannot cancel there.
"""

from __future__ import annotations

import math

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.specification import Site

RATE_HZ = 20.0
"""Sample rate (Hz): two samples a navigation cycle."""
_NODES = 0.5 + np.array([-1.0, 0.0, 1.0]) * math.sqrt(15.0) / 10.0
"""Nodes of Gauss-Legendre, a share of the interval: exact to the fifth order."""
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
"""Weights of Gauss-Legendre (1): for the same three nodes."""


def ramp_length(turn: Turn, acceleration_rad_s2: float, number: int) -> float:
    """Length of each ramp of the trapezoidal rate that makes a turn at its mean rate.

    With angle A, length T and ramps t_r at acceleration a: ``A = a t_r (T - t_r)``, the smaller root.

    `number`: of the turn in the plan, for the message. Gives the length in s.
    """
    size = abs(turn.angle_rad)
    length = size / turn.rate_rad_s
    root = length**2 - 4.0 * size / acceleration_rad_s2
    if root < -1e-9 * length**2:
        raise DataError(
            f"turn {number}: {math.degrees(turn.angle_rad):g} deg about {turn.axis} at a mean of "
            f"{math.degrees(turn.rate_rad_s):g} deg/s needs more than the limit of "
            f"{math.degrees(acceleration_rad_s2):g} deg/s^2 (lower the rate or raise the acceleration)"
        )
    return 2.0 * size / acceleration_rad_s2 / (length + math.sqrt(max(root, 0.0)))


def turned(t: Floats, turn: Turn, ramp_s: float) -> tuple[Floats, Floats]:
    """Angle (rad) and rate (rad/s) of a turn, shape (m,) each; the angle is constant before and after it.

    Parameters
    ----------
    t : ndarray, shape (m,)
        Time after the start of the turn (s); any shape.
    """
    length = turn.duration_s
    peak = turn.angle_rad / (length - ramp_s)
    at = np.clip(t, 0.0, length)
    to_end = np.minimum(at, length - at)
    ramp = np.minimum(to_end, ramp_s)
    part = peak * (ramp**2 / (2.0 * ramp_s) + (to_end - ramp))
    return np.where(2.0 * at <= length, part, turn.angle_rad - part), peak * ramp / ramp_s


_LEAST_DWELL_S = 2.0
"""Shortest first dwell (s): contains a complete epoch of a second, wherever the epochs begin."""


def nominal_recording(plan: Plan, site: Site, mount_rad: Floats | None = None, C_nt: Floats | None = None) -> Recording:
    """Record a plan with a perfect IMU.

    Parameters
    ----------
    mount_rad : ndarray, shape (3,), optional
        Rotation vector of the IMU on the table (rad), ``C_tb = rotation_matrix(mount)``; zero by default.
    C_nt : ndarray, shape (3, 3), optional
        Attitude of the table at stop 0, t to n; by default its X, Y, Z point north, east, down.

    Returns
    -------
    Recording
        With the phases of the table, as in the status topic.
    """
    if plan.dwell_s[0] < _LEAST_DWELL_S:
        raise DataError(
            f"plan {plan.name}: its first stop of {plan.dwell_s[0]:g} s is shorter than the {_LEAST_DWELL_S:g} s "
            "in which an epoch at rest can be told from motion; dwell longer"
        )
    gravity = site.gravity_m_s2 or float(earth.normal_gravity(site.latitude_rad, site.height_m))
    C_tb = rotation_matrix(np.zeros(3) if mount_rad is None else np.asarray(mount_rad, dtype=float))
    begin, end, ramps = _schedule(plan)
    total = end[-1] + plan.dwell_s[-1] if plan.turns else plan.dwell_s[0]
    edges = np.arange(math.floor(total * RATE_HZ + 1e-6) + 1) / RATE_HZ
    # Each sample lies in the span of one turn (from the start of the turn to that of the next), but for the few
    # that a start cuts: those see the table at rest before it, which the clipped angle gives too.
    span = np.maximum(np.searchsorted(begin, edges[1:] - 1e-9, side="left") - 1, 0)
    omega, force = np.empty((len(edges) - 1, 3)), np.empty((len(edges) - 1, 3))
    C_nt = np.eye(3) if C_nt is None else C_nt
    w_ie, down = earth.earth_rate(site.latitude_rad), np.array([0.0, 0.0, 1.0])
    for k, turn in enumerate(plan.turns):
        rows = np.flatnonzero(span == k)
        axis = _unit(turn.axis)
        mean_cos, mean_sin, mean_rate = _means(edges[rows] - begin[k], 1.0 / RATE_HZ, turn, ramps[k])
        omega[rows] = _turned_back(C_nt.T @ w_ie, axis, mean_cos, mean_sin) + mean_rate[:, None] * axis
        force[rows] = -gravity * _turned_back(C_nt.T @ down, axis, mean_cos, mean_sin)
        C_nt = C_nt @ rotation_matrix(turn.angle_rad * axis)
    if not plan.turns:
        omega[:], force[:] = C_nt.T @ w_ie, -gravity * (C_nt.T @ down)
    return Recording(0, edges[1:], omega @ C_tb, force @ C_tb, phase=_phases(begin, end, total))


def _schedule(plan: Plan) -> tuple[Floats, Floats, list[float]]:
    """Start and end of every turn (s), shape (turns,), and its ramps."""
    ramps = [ramp_length(t, plan.acceleration_rad_s2, k) for k, t in enumerate(plan.turns, start=1)]
    length = np.array([t.duration_s for t in plan.turns])
    end = np.cumsum(np.asarray(plan.dwell_s[: len(length)]) + length)
    return end - length, end, ramps


def _means(start: Floats, interval: float, turn: Turn, ramp_s: float) -> tuple[Floats, Floats, Floats]:
    """Mean cosine and sine of the turned angle and mean rate over samples that begin at `start` (m,)."""
    angle, _ = turned(start[:, None] + interval * _NODES, turn, ramp_s)
    first, _ = turned(start, turn, ramp_s)
    last, _ = turned(start + interval, turn, ramp_s)
    return np.cos(angle) @ _WEIGHTS, np.sin(angle) @ _WEIGHTS, (last - first) / interval


def _turned_back(v: Floats, axis: Floats, cos: Floats, sin: Floats) -> Floats:
    """Vector `v` (3,) seen from axes that have turned about `axis`; `cos`, `sin` (m,) of the angle; (m, 3)."""
    along = axis * (axis @ v)
    return np.asarray(along + cos[:, None] * (v - along) - sin[:, None] * np.cross(axis, v))


def _phases(begin: Floats, end: Floats, total: float) -> PhaseLog:
    """Status at every change and once a second, as a table sends it."""
    t = np.union1d(np.arange(math.floor(total) + 1.0), np.concatenate([begin, end]))
    stop = np.searchsorted(end, t, side="right")
    dwell = np.searchsorted(begin, t, side="right") == stop
    return PhaseLog(t, dwell, stop.astype(np.int64))


def _unit(letter: str) -> Floats:
    return np.asarray(np.eye(3)["XYZ".index(letter)])
