"""Strapdown navigation in two speeds.

Sample rate: angular-rate and specific-force samples become *cycles* of at most `CYCLE_S`, each with its
integrated angle, velocity increment, coning and sculling (`Reducer`). Cycle rate: attitude, velocity and
position in local-level NED (`navigate_cycle`).

Source: P. G. Savage, "Strapdown Inertial Navigation Integration Algorithm Design", parts 1 and 2,
J. Guidance, Control and Dynamics 21 (1998): coning eq. (48), rotation and sculling compensation eqs. (55)-(57), with
the previous-sample terms that make both exact for a linear ramp of rate and force (drift of fourth order).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.matrix3 import applied, elements, multiplied, orthonormal3, rotation3, store

CYCLE_S = 0.1
"""Longest navigation cycle (s): coning and sculling are integrated at the sample rate, so 10 Hz is enough."""
CYCLE_ANGLE = 0.05
"""Angle at which a cycle closes early (rad): the series of coning and sculling are of low order."""
GAP = 1.5
"""Interval between samples that counts as a gap, a multiple of the nominal one: halfway to one lost sample."""


@dataclass(frozen=True)
class Cycles:
    """Navigation cycles; every array has n rows, SI, body frame at the start of the cycle."""

    t: Floats
    dt: Floats
    """`t`, `dt`: end and length (s), shape (n,)."""
    alpha: Floats
    upsilon: Floats
    """`alpha`, `upsilon`: integrals of body rate (rad) and specific force (m/s), shape (n, 3)."""
    coning: Floats
    sculling: Floats
    """`coning`, `sculling`: shape (n, 3). Their corrections: rotation vector = alpha + coning; velocity increment =
    upsilon + alpha x upsilon / 2 + ... + sculling (`velocity_increment`)."""
    samples: Ints
    lost: Ints
    """`samples`, `lost`: samples in the cycle, and samples missing before them, shape (n,)."""
    gap_angle: Floats
    """Angle bridged by interpolation where samples are missing (rad), shape (n, 3)."""

    def __len__(self) -> int:
        """Return the number of cycles."""
        return len(self.t)

    def __getitem__(self, rows: slice) -> Cycles:
        """Return the cycles of a slice."""
        return Cycles(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @staticmethod
    def concatenate(parts: list[Cycles]) -> Cycles:
        """Join blocks of cycles."""
        names = Cycles.__dataclass_fields__
        return Cycles(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


# Columns of the table that the compiled reducer fills, one row a cycle.
_T, _DT, _ALPHA, _UPS, _CON, _SCUL, _N, _LOST, _GAP, _COLUMNS = 0, 1, 2, 5, 8, 11, 14, 15, 16, 19
# The carry: open cycle in the same columns, then time, rate and force of the last sample, then "have one".
_LAST_T, _LAST_W, _LAST_F, _HAVE, _CARRY = 19, 20, 23, 26, 27


@compiled
def _add_twice_crossed(
    carry: Floats, share: float, x0: float, x1: float, x2: float, u0: float, u1: float, u2: float
) -> None:
    """Add ``share * x x (x x u)`` to the sculling of the open cycle."""
    along, square = x0 * u0 + x1 * u1 + x2 * u2, x0 * x0 + x1 * x1 + x2 * x2
    carry[_SCUL] += share * (x0 * along - u0 * square)
    carry[_SCUL + 1] += share * (x1 * along - u1 * square)
    carry[_SCUL + 2] += share * (x2 * along - u2 * square)


@compiled
def _reduce(t: Floats, omega: Floats, force: Floats, nominal: float, carry: Floats, out: Floats) -> int:
    """Add samples to the open cycle in `carry` and write closed ones to `out`; return their number."""
    count = 0
    for k in range(t.shape[0]):
        dt = t[k] - carry[_LAST_T]
        missing = 0.0
        w0, w1, w2 = omega[k, 0], omega[k, 1], omega[k, 2]
        f0, f1, f2 = force[k, 0], force[k, 1], force[k, 2]
        p0, p1, p2, q0, q1, q2 = w0, w1, w2, f0, f1, f2
        if carry[_HAVE] > 0.0:
            p0, p1, p2 = carry[_LAST_W], carry[_LAST_W + 1], carry[_LAST_W + 2]
            q0, q1, q2 = carry[_LAST_F], carry[_LAST_F + 1], carry[_LAST_F + 2]
            if dt > GAP * nominal:
                # The sample covers only its own interval; before it, the mean of its neighbours.
                missing = np.round(dt / nominal) - 1.0
                share = (dt - nominal) / dt
                w0 += 0.5 * share * (p0 - w0)
                w1 += 0.5 * share * (p1 - w1)
                w2 += 0.5 * share * (p2 - w2)
                f0 += 0.5 * share * (q0 - f0)
                f1 += 0.5 * share * (q1 - f1)
                f2 += 0.5 * share * (q2 - f2)
                for i in range(3):
                    carry[_GAP + i] += 0.5 * (omega[k, i] + carry[_LAST_W + i]) * (dt - nominal)
        a0, a1, a2 = w0 * dt, w1 * dt, w2 * dt
        u0, u1, u2 = f0 * dt, f1 * dt, f2 * dt
        s = dt / 6.0
        x0, x1, x2 = carry[_ALPHA] + s * p0, carry[_ALPHA + 1] + s * p1, carry[_ALPHA + 2] + s * p2
        y0, y1, y2 = carry[_UPS] + s * q0, carry[_UPS + 1] + s * q1, carry[_UPS + 2] + s * q2
        carry[_CON] += 0.5 * (x1 * a2 - x2 * a1)
        carry[_CON + 1] += 0.5 * (x2 * a0 - x0 * a2)
        carry[_CON + 2] += 0.5 * (x0 * a1 - x1 * a0)
        carry[_SCUL] += 0.5 * (x1 * u2 - x2 * u1 + y1 * a2 - y2 * a1)
        carry[_SCUL + 1] += 0.5 * (x2 * u0 - x0 * u2 + y2 * a0 - y0 * a2)
        carry[_SCUL + 2] += 0.5 * (x0 * u1 - x1 * u0 + y0 * a1 - y1 * a0)
        # Second order, theta x (theta x f) / 2 integrated over the sample with theta growing evenly from its start.
        x0, x1, x2 = carry[_ALPHA] + 0.5 * a0, carry[_ALPHA + 1] + 0.5 * a1, carry[_ALPHA + 2] + 0.5 * a2
        _add_twice_crossed(carry, 0.5, x0, x1, x2, u0, u1, u2)
        _add_twice_crossed(carry, 1.0 / 24.0, a0, a1, a2, u0, u1, u2)
        carry[_ALPHA] += a0
        carry[_ALPHA + 1] += a1
        carry[_ALPHA + 2] += a2
        carry[_UPS] += u0
        carry[_UPS + 1] += u1
        carry[_UPS + 2] += u2
        carry[_DT] += dt
        carry[_N] += 1.0
        carry[_LOST] += missing
        carry[_LAST_T] = t[k]
        carry[_HAVE] = 1.0
        for i in range(3):
            carry[_LAST_W + i] = omega[k, i]
            carry[_LAST_F + i] = force[k, i]
        # The next whole multiple of the cycle after the cycle's start.
        boundary = (np.floor((t[k] - carry[_DT] + 0.5 * nominal) / CYCLE_S) + 1.0) * CYCLE_S
        angle2 = carry[_ALPHA] ** 2 + carry[_ALPHA + 1] ** 2 + carry[_ALPHA + 2] ** 2
        if t[k] >= boundary - 0.5 * nominal or angle2 > CYCLE_ANGLE**2:
            carry[_T] = t[k]
            # What `velocity_increment` adds for a force that is constant in the body.
            x0, x1, x2 = carry[_ALPHA], carry[_ALPHA + 1], carry[_ALPHA + 2]
            _add_twice_crossed(carry, -1.0 / 6.0, x0, x1, x2, carry[_UPS], carry[_UPS + 1], carry[_UPS + 2])
            for column in range(_COLUMNS):
                out[count, column] = carry[column]
            count += 1
            carry[:_COLUMNS] = 0.0
    return count


class Reducer:
    """Samples in blocks of any length in, whole cycles out; the cuts between blocks leave no trace.

    Parameters
    ----------
    nominal_s : float
        Nominal sample interval (s); a cycle boundary takes the sample that ends nearest to it.
    """

    def __init__(self, nominal_s: float) -> None:
        self.nominal_s = nominal_s
        self._carry = np.zeros(_CARRY)

    def add(self, t: Floats, omega_ib_b: Floats, f_ib_b: Floats) -> Cycles:
        """Take samples and return the cycles that they close.

        Parameters
        ----------
        t : ndarray, shape (n,)
            End of each sample (s), ascending; the first interval starts at 0.
        omega_ib_b, f_ib_b : ndarray, shape (n, 3)
            Mean rate (rad/s) and specific force (m/s^2) over the interval.
        """
        out = np.empty((len(t), _COLUMNS))
        n = _reduce(
            np.ascontiguousarray(t),
            np.ascontiguousarray(omega_ib_b),
            np.ascontiguousarray(f_ib_b),
            self.nominal_s,
            self._carry,
            out,
        )
        rows = out[:n]
        return Cycles(
            rows[:, _T].copy(),
            rows[:, _DT].copy(),
            rows[:, _ALPHA:_UPS].copy(),
            rows[:, _UPS:_CON].copy(),
            rows[:, _CON:_SCUL].copy(),
            rows[:, _SCUL:_N].copy(),
            rows[:, _N].astype(np.int64),
            rows[:, _LOST].astype(np.int64),
            rows[:, _GAP:_COLUMNS].copy(),
        )


@compiled
def navigate_cycle(
    C_nb: Floats, velocity: Floats, position: Floats, phi: Floats, dv: Floats, dt: float, gravity: float
) -> None:
    """Advance attitude, velocity and position by one cycle, in place.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
    velocity : ndarray, shape (3,)
        N, E, D (m/s).
    position : ndarray, shape (3,)
        Latitude (rad), longitude (rad), height (m).
    phi, dv : ndarray, shape (3,)
        Rotation vector (rad) and velocity increment (m/s) in the body frame at the cycle's start.
    dt : float
        Length of the cycle (s).
    gravity : float
        Magnitude of gravity at the present position (m/s^2).
    """
    lat = position[0]
    w_n, w_d = earth.RATE * np.cos(lat), -earth.RATE * np.sin(lat)
    lat_c = min(max(lat, -earth.POLE_LIMIT), earth.POLE_LIMIT)
    r_n, r_e = earth.radii(lat_c)
    r_n += position[2]
    r_e += position[2]
    t_n, t_e, t_d = velocity[1] / r_e, -velocity[0] / r_n, -velocity[1] * np.tan(lat_c) / r_e
    # Turn of NED against inertial space in this cycle, and half of it for the mid-cycle attitude.
    z0, z1, z2 = -(w_n + t_n) * dt, -t_e * dt, -(w_d + t_d) * dt
    C = elements(C_nb)
    u0, u1, u2 = applied(C, dv[0], dv[1], dv[2])
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    c_n, c_e, c_d = 2.0 * w_n + t_n, t_e, 2.0 * w_d + t_d
    velocity[0] += u0 + 0.5 * (z1 * u2 - z2 * u1) - (c_e * v2 - c_d * v1) * dt
    velocity[1] += u1 + 0.5 * (z2 * u0 - z0 * u2) - (c_d * v0 - c_n * v2) * dt
    velocity[2] += u2 + 0.5 * (z0 * u1 - z1 * u0) - (c_n * v1 - c_e * v0) * dt + gravity * dt
    position[0] += 0.5 * (v0 + velocity[0]) * dt / r_n
    position[1] += 0.5 * (v1 + velocity[1]) * dt / (r_e * np.cos(lat_c))
    position[2] -= 0.5 * (v2 + velocity[2]) * dt
    turned = multiplied(multiplied(rotation3(z0, z1, z2), C), rotation3(phi[0], phi[1], phi[2]))
    store(orthonormal3(turned), C_nb)


@compiled
def velocity_increment(alpha: Floats, upsilon: Floats, sculling: Floats) -> Floats:
    """Velocity increment of a cycle.

    ``upsilon + alpha x upsilon / 2 + alpha x (alpha x upsilon) / 6 + sculling``: Savage's rotation compensation with
    its coefficients (1 - cos a)/a^2 and (1 - sin a / a)/a^2 to second order. Without the second-order term a table at
    2 deg/s makes the force across its axis 2 ppm too small. `sculling` holds what a force that turns in the body (the
    table turns, gravity does not) changes in both orders; leaving out the second makes 2 ppm at 20 deg/s.

    Parameters
    ----------
    alpha, upsilon, sculling : ndarray, shape (3,)
        As in `Cycles`.

    Returns
    -------
    ndarray, shape (3,)
        In the body frame at the start of the cycle (m/s).
    """
    c0 = alpha[1] * upsilon[2] - alpha[2] * upsilon[1]
    c1 = alpha[2] * upsilon[0] - alpha[0] * upsilon[2]
    c2 = alpha[0] * upsilon[1] - alpha[1] * upsilon[0]
    a2 = alpha[0] ** 2 + alpha[1] ** 2 + alpha[2] ** 2
    first, second = 0.5 - a2 / 24.0, 1.0 / 6.0 - a2 / 120.0
    dv = np.empty(3)
    dv[0] = upsilon[0] + first * c0 + second * (alpha[1] * c2 - alpha[2] * c1) + sculling[0]
    dv[1] = upsilon[1] + first * c1 + second * (alpha[2] * c0 - alpha[0] * c2) + sculling[1]
    dv[2] = upsilon[2] + first * c2 + second * (alpha[0] * c1 - alpha[1] * c0) + sculling[2]
    return dv


@compiled
def mean_attitude(C_nb: Floats, phi: Floats, out: Floats) -> None:
    """Put the mean of `C_nb` over a cycle that turns by `phi` into `out`: ``C_nb (1 + [phi x] / 2 + [phi x]^2 / 6)``.

    The half sum of both ends would be short by a twelfth of the angle's square; a lever arm shows it.

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        At the start of the cycle (1).
    phi : ndarray, shape (3,)
        Rotation vector of the cycle (rad).
    out : ndarray, shape (3, 3)
        Filled (1).
    """
    x, y, z = phi
    for i in range(3):
        a, b, c = C_nb[i, 0], C_nb[i, 1], C_nb[i, 2]
        u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
        out[i, 0] = a + 0.5 * u + (v * z - w * y) / 6.0
        out[i, 1] = b + 0.5 * v + (w * x - u * z) / 6.0
        out[i, 2] = c + 0.5 * w + (u * y - v * x) / 6.0


def navigate(
    cycles: Cycles, C_nb: Floats, latitude: float, height: float, gravity: float, level: bool = False
) -> tuple[Floats, Floats]:
    """Navigate freely from rest at a known point.

    Parameters
    ----------
    cycles : Cycles
        Of n cycles.
    C_nb : ndarray, shape (3, 3)
        Attitude at the start, b to n (dimensionless).
    latitude, height, gravity : float
        Of the point (rad, m, m/s^2).
    level : bool
        Hold the height, as an altimeter would.

    Returns
    -------
    C_nb : ndarray, shape (n + 1, 3, 3)
        Attitude before each cycle and after the last (dimensionless).
    moved : ndarray, shape (n + 1, 6)
        Velocity (m/s) and displacement (m) there, N, E, D.
    """
    excess = gravity - float(earth.normal_gravity(latitude, height))
    vectors = (cycles.alpha, cycles.upsilon, cycles.coning, cycles.sculling, cycles.dt)
    steps = Steps(*(np.ascontiguousarray(v) for v in vectors))
    return _navigate(C_nb.copy(), steps, latitude, height, excess, level)


class Steps(NamedTuple):
    """What a navigation takes of n cycles, contiguous: as in `Cycles`."""

    alpha: Floats
    upsilon: Floats
    coning: Floats
    sculling: Floats
    """`alpha`, `upsilon`, `coning`, `sculling`: shape (n, 3)."""
    dt: Floats
    """Shape (n,)."""


@compiled
def _navigate(
    C_nb: Floats, steps: Steps, latitude: float, height: float, gravity_excess: float, level: bool
) -> tuple[Floats, Floats]:
    """Attitudes and movements as of `navigate`; `C_nb` is moved to the end, in place."""
    n = steps.dt.shape[0]
    track, moved = np.empty((n + 1, 3, 3)), np.zeros((n + 1, 6))
    velocity, position = np.zeros(3), np.zeros(3)
    position[0], position[2] = latitude, height
    r_n, r_e = earth.radii(latitude)
    cos = np.cos(min(abs(latitude), earth.POLE_LIMIT))
    track[0] = C_nb
    for k in range(n):
        dv = velocity_increment(steps.alpha[k], steps.upsilon[k], steps.sculling[k])
        gravity = earth.normal_gravity(position[0], position[2]) + gravity_excess
        turned = steps.alpha[k] + steps.coning[k]
        navigate_cycle(C_nb, velocity, position, turned, dv, steps.dt[k], gravity)
        if level:
            velocity[2], position[2] = 0.0, height
        track[k + 1] = C_nb
        moved[k + 1, :3] = velocity
        moved[k + 1, 3] = (position[0] - latitude) * (r_n + height)
        moved[k + 1, 4] = position[1] * (r_e + height) * cos
        moved[k + 1, 5] = height - position[2]
    return track, moved
