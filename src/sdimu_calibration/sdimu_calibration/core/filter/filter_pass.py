"""One pass of navigation and Kalman filter over epochs; the compiled heart.

State: nine navigation errors (ins_errors), p coefficient deviations (true minus the value used in the sensor
compensation), three copies of the initial attitude error, which let later passes start from the smoothed attitude.

A dwell epoch of length T ends with, in this order,

    Zp = computed minus known position          = position error
    Zv = computed velocity minus zero           = velocity error
    Zw = w_mean - C_bn w_ie = C_bn [w_ie x] attitude + D_w dx + n_g mean
    Zf = f_mean + C_bn g    = C_bn [f x] attitude    + D_f dx + n_a mean

with C_nb at the end of the epoch and D the mean regressors. The same noise n drives the navigation, hence with gyro
and accelerometer noise densities q_g, q_a (power)

    E[attitude Zw'] = -C q_g,      E[velocity Zf'] = C q_a,       E[position Zf'] = C q_a T / 2,
    E[velocity Zw'] = -[f x] C q_g T / 2,                         E[position Zw'] = -[f x] C q_g T^2 / 6.

The table turns and does not travel, so errors grow along the force of gravity. What is measured leans off it by noise
and tilt errors, and a filter that takes the lean for an acceleration takes it for knowledge of azimuth, too.

While the table rests, Zv and Zp are integrals of Zf, so they are taken once after each motion; at every epoch they
would add information only if they had noise of their own. Derivation: doc/shared-noise.md. For the same reason nothing
is lost when a long dwell ends the navigation and begins it again at the known point: what the sensors add up to in a
dwell is in Zf, and to second order in the attitude it would contradict Zv and Zp of the next stop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.filter.kalman import predict, propagate, update, whiten
from sdimu_calibration.core.filter.running_mean import into_means
from sdimu_calibration.core.filter.shaken import at_the_end
from sdimu_calibration.core.matrix3 import applied, corner, elements, put, sparse_product, transposed
from sdimu_calibration.core.measurement_kind import ALL, SKIP
from sdimu_calibration.core.navigation.ins_errors import (
    add_columns,
    navigation_error_matrix,
    process_noise,
    responses,
    transition,
)
from sdimu_calibration.core.navigation.strapdown import mean_attitude, navigate_cycle, velocity_increment
from sdimu_calibration.core.rotation import orthonormal, rotation_vector, skew

NAV = 9
"""Number of navigation error states: position, velocity, attitude."""
COPY = 3
"""Number of copies of the initial attitude error: one an axis."""
MEASURED = 12
"""Number of rows of a full measurement: Zp, Zv, Zw, Zf."""


class PassInput(NamedTuple):
    """Data of a pass: n cycles, e epochs, m regressor columns."""

    dt: Floats
    """Length of each cycle (s), shape (n,)."""
    alpha: Floats
    upsilon: Floats
    coning: Floats
    sculling: Floats
    """`alpha`, `upsilon`, `coning`, `sculling`: as in `Cycles` (rad, m/s, rad, m/s), shape (n, 3)."""
    first: Ints
    last: Ints
    """`first`, `last`: first cycle of each epoch, and one after its last, shape (e,)."""
    white: Floats
    """Variance of the white noise, a multiple of that of a complete epoch (1), shape (e,)."""
    gap_angle: Floats
    gap_velocity: Floats
    """`gap_angle`, `gap_velocity`: sigma that missing samples add on every axis (rad, m/s), shape (e,)."""
    kind: Ints
    """``SKIP`` to ``HELD_ALL`` of `alignment.prepared`, shape (e,)."""
    restart: Bools
    """Before the epoch navigation starts anew from the known point, at rest (`restarts`), shape (e,)."""
    values: Floats
    """Regressors (SI), shape (n, m)."""
    channel: Ints
    parameter: Ints
    """`channel`, `parameter`: sensor axis and coefficient of each regressor, shape (m,)."""
    shift: Ints
    """Stop to whose attitude navigation goes before the epoch, -1 where it goes on as it is, shape (e,)."""
    C_stop: Floats
    """Attitude about which each of k stops is linearised, b to n (dimensionless), shape (k, 3, 3)."""
    share: Floats
    """Length of an epoch at rest over that of all rests so far, 0 of others (1), shape (e,)."""


class PassSettings(NamedTuple):
    """Constants of a pass."""

    reference: Floats
    """Latitude (rad), longitude (rad), height (m) of the known point, shape (3,)."""
    gravity_excess: float
    """Gravity of the site minus normal gravity (m/s^2)."""
    gyro_psd: float
    accel_psd: float
    """`gyro_psd`, `accel_psd`: white noise ((rad/s)^2/Hz, (m/s^2)^2/Hz)."""
    extra_gyro: float
    extra_accel: float
    """`extra_gyro`, `extra_accel`: variance of Zw and Zf beyond white noise ((rad/s)^2, (m/s^2)^2)."""
    velocity_sigma: float
    position_sigma: float
    """`velocity_sigma`, `position_sigma`: sigma of Zv and Zp (m/s, m)."""
    decay_rate: Floats
    drive: Floats
    """`decay_rate`, `drive`: decay (1/s) and added variance per second, which fades too, of each coefficient,
    shape (p,)."""
    shared_noise: bool
    """Model the cross-covariance M."""
    shaken: bool = False
    """The table vibrates at rest: the force of an epoch is that of its mean attitude, not of the one at its end."""
    averaged: Ints = np.empty((0, 2), dtype=np.int64)
    """Places of states of noise and of their means over the rests so far, as of `into_means`, shape (w, 2)."""


class PassState(NamedTuple):
    """State of a pass, of size s = 9 + p + 3; changed in place."""

    x: Floats
    """Mean (SI), shape (s,)."""
    P: Floats
    """Covariance, shape (s, s)."""
    C_nb: Floats
    """Shape (3, 3)."""
    velocity: Floats
    position: Floats
    """`velocity`, `position`: shape (3,). N, E, D (m/s); latitude (rad), longitude (rad), height (m)."""
    used: Floats
    """Coefficients in the compensation (SI), shape (p,)."""


class PassOutput(NamedTuple):
    """Output of a pass, one row an epoch; k = e where the matrices are kept, else 0. SI units.

    Of the state the kept matrices have the first t rows: all s, or the NAV navigation errors.
    """

    estimate: Floats
    """Coefficients, shape (e, p)."""
    sigma: Floats
    """Of every state, shape (e, s)."""
    innovation: Floats
    normalised: Floats
    """`innovation`, `normalised`: shape (e, 12). Innovations and ``L^-1`` times them; NaN where not measured."""
    innovation_sigma: Floats
    """Shape (e, 12). Predicted sigma of each innovation; NaN where not measured."""
    log_likelihood: Floats
    """Shape (e,)."""
    nis: Floats
    """Squared normalised innovation of position, velocity, rate, force, shape (e, 4)."""
    C_nb: Floats
    """At the end of the epoch, shape (e, 3, 3)."""
    stride: int
    """Epochs between snapshots of the covariance."""
    covariance: Floats
    """Of the coefficients, shape (ceil(e / stride), p, p)."""
    Phi: Floats
    """Shape (k, 9, 9). Transition of the navigation errors; zero for those of position and velocity after a restart."""
    G: Floats
    """Shape (k, 9, p). Their response to the coefficients; not kept (k, 9, 0) with the navigation errors alone."""
    H: Floats
    """Shape (k, 12, t)."""
    L: Floats
    """Lower Cholesky factor of the innovations' covariance, shape (k, 12, 12)."""
    K: Floats
    """Gain, shape (k, t, 12)."""


def new_output(epochs: int, parameters: int, keep: bool, stride: int, navigation_only: bool = False) -> PassOutput:
    """Allocate the output of a pass: matrices of every epoch where `keep`, the covariance every `stride` epochs.

    With `navigation_only` the matrices have the rows of the navigation errors alone, a fifth of them all.
    """
    e, p, s = epochs, parameters, NAV + parameters + COPY
    k = e if keep else 0
    t, g = (NAV, 0) if navigation_only else (s, p)
    nan = np.nan
    return PassOutput(
        np.zeros((e, p)),
        np.zeros((e, s)),
        np.full((e, MEASURED), nan),
        np.full((e, MEASURED), nan),
        np.full((e, MEASURED), nan),
        np.zeros(e),
        np.full((e, 4), nan),
        np.zeros((e, 3, 3)),
        stride,
        np.zeros((-(-e // stride), p, p)),
        np.zeros((k, NAV, NAV)),
        np.zeros((k, NAV, g)),
        np.zeros((k, MEASURED, t)),
        np.zeros((k, MEASURED, MEASURED)),
        np.zeros((k, t, MEASURED)),
    )


@compiled
def _navigate_epoch(
    data: PassInput,
    e: int,
    settings: PassSettings,
    state: PassState,
    f_n: Floats,
    G: Floats,
    D: Floats,
    sums: Floats,
    C_mean: Floats,
    R: Floats,
) -> float:
    """Navigate through an epoch along a force `f_n` (n, 3) of its cycles in NED, in place; return its length (s).

    Filled: G (9, p), D (6, p), and sums (6,) of angle and velocity increment in b; of the cycles of the epoch the mean
    attitude (n, 3, 3) and the responses (n, 6, 9).
    """
    error = np.empty(6)
    phi = np.empty(3)
    alpha = np.empty(3)
    upsilon = np.empty(3)
    sums[:] = 0.0
    T = 0.0
    first, count = data.first[e], data.last[e] - data.first[e]
    dts = data.dt[first : data.last[e]]
    error[:] = 0.0
    corrected = not state.used.any()
    for k in range(count):
        c = first + k
        dt = dts[k]
        T += dt
        if not corrected:
            error[:] = 0.0
            for j in range(data.channel.shape[0]):
                error[data.channel[j]] += data.values[c, j] * state.used[data.parameter[j]]
        for i in range(3):
            alpha[i] = data.alpha[c, i] - error[i] * dt
            upsilon[i] = data.upsilon[c, i] - error[3 + i] * dt
            phi[i] = alpha[i] + data.coning[c, i]
            sums[i] += alpha[i]
            sums[3 + i] += upsilon[i]
        gravity = earth.normal_gravity(state.position[0], state.position[2]) + settings.gravity_excess
        mean_attitude(state.C_nb, phi, C_mean[k])
        dv = velocity_increment(alpha, upsilon, data.sculling[c])
        navigate_cycle(state.C_nb, state.velocity, state.position, phi, dv, dt, gravity)
    responses(C_mean, f_n, dts, 0, count, earth.earth_rate(settings.reference[0]), R)
    add_columns(data.values[first : data.last[e]], data.channel, data.parameter, R, dts, G, D)
    return T


@compiled
def _measurement(
    settings: PassSettings, state: PassState, D: Floats, sums: Floats, T: float, p: int, white: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Build z (12,), H (12, s), R (12, 12) and M (s, 12) of a dwell epoch; `white` as in `PassInput`."""
    s = NAV + p + COPY
    gyro_psd, accel_psd = settings.gyro_psd * white, settings.accel_psd * white
    z = np.empty(MEASURED)
    H = np.zeros((MEASURED, s))
    R = np.zeros((MEASURED, MEASURED))
    M = np.zeros((s, MEASURED))
    C = state.C_nb
    C_bn = transposed(elements(C))
    r_n, r_e = earth.radii(settings.reference[0])
    height = settings.reference[2]
    w_ie = earth.earth_rate(settings.reference[0])
    g_n = np.zeros(3)
    g_n[2] = earth.normal_gravity(settings.reference[0], height) + settings.gravity_excess
    z[0] = (state.position[0] - settings.reference[0]) * (r_n + height)
    # The same limit as in the navigation: without it the east error would read zero at the pole.
    cos = np.cos(min(abs(settings.reference[0]), earth.POLE_LIMIT))
    z[1] = (state.position[1] - settings.reference[1]) * (r_e + height) * cos
    z[2] = height - state.position[2]
    w_b, g_b = applied(C_bn, w_ie[0], w_ie[1], w_ie[2]), applied(C_bn, g_n[0], g_n[1], g_n[2])
    for i in range(3):
        H[i, i] = 1.0
        H[3 + i, 3 + i] = 1.0
        z[3 + i] = state.velocity[i]
        z[6 + i] = sums[i] / T - w_b[i]
        z[9 + i] = sums[3 + i] / T + g_b[i]
        R[i, i] = settings.position_sigma**2
        R[3 + i, 3 + i] = settings.velocity_sigma**2
        R[6 + i, 6 + i] = gyro_psd / T + settings.extra_gyro
        R[9 + i, 9 + i] = accel_psd / T + settings.extra_accel
    put(sparse_product(C.T, skew(w_ie)), H, 6, 6)
    put(sparse_product(C.T, skew(-g_n)), H, 9, 6)
    for i in range(6):
        for j in range(p):
            H[6 + i, NAV + j] = D[i, j] / T
    if settings.shared_noise:
        fC = sparse_product(skew(-g_n), C)
        for i in range(3):
            for j in range(3):
                M[6 + i, 6 + j] = -gyro_psd * C[i, j]
                M[3 + i, 6 + j] = -gyro_psd * T / 2.0 * fC[i, j]
                M[i, 6 + j] = -gyro_psd * T**2 / 6.0 * fC[i, j]
                M[3 + i, 9 + j] = accel_psd * C[i, j]
                M[i, 9 + j] = accel_psd * T / 2.0 * C[i, j]
    return z, H, R, M


@compiled
def _feed_back(settings: PassSettings, state: PassState) -> None:
    """Move the mean of the errors of position and velocity into the navigation, in place."""
    x = state.x
    r_n, r_e = earth.radii(settings.reference[0])
    cos = np.cos(min(abs(settings.reference[0]), earth.POLE_LIMIT))
    state.position[0] -= x[0] / (r_n + settings.reference[2])
    state.position[1] -= x[1] / ((r_e + settings.reference[2]) * cos)
    state.position[2] += x[2]
    for i in range(3):
        state.velocity[i] -= x[3 + i]
        x[i] = x[3 + i] = 0.0


@compiled
def _go_on_from(C_nb: Floats, state: PassState) -> None:
    """Go on from the attitude `C_nb` (3, 3), in place: the attitude error is counted from there.

    No half product of shift and error is added as after a reset of the attitude: the rows of Zf know no second order,
    so an error in them is the tilt as it is seen, whatever the azimuth, and tilts so seen add. With the half product
    every shift says something about azimuth that no sample said.
    """
    turned = rotation_vector(sparse_product(C_nb, state.C_nb.T))
    for i in range(3):
        state.x[6 + i] -= turned[i]
    put(orthonormal(C_nb), state.C_nb, 0, 0)


@compiled
def _restart(settings: PassSettings, state: PassState) -> None:
    """Begin the navigation anew from the known point, at rest, in place; attitude and coefficients stay."""
    for i in range(3):
        state.position[i], state.velocity[i] = settings.reference[i], 0.0
    state.x[:6] = 0.0
    state.P[:6, :] = 0.0
    state.P[:, :6] = 0.0
    for i in range(3):
        state.P[i, i] = settings.position_sigma**2
        state.P[3 + i, 3 + i] = settings.velocity_sigma**2


@compiled
def _fade(settings: PassSettings, T: float, used: Floats, decay: Floats, drive: Floats) -> None:
    """Let coefficients `used` (p,) fade over an epoch (s), in place; fill how far, and the variance that they gain."""
    for j in range(used.shape[0]):
        rate = settings.decay_rate[j]
        d = np.exp(-rate * T)
        decay[j] = d
        # What came in early has faded by the end of the epoch.
        drive[j] = settings.drive[j] * (T if d == 1.0 else -np.expm1(-2.0 * rate * T) / (2.0 * rate))
        if d != 1.0:
            used[j] *= d


@compiled
def _write(out: PassOutput, e: int, low: int, innovation: Floats, white: Floats, L: Floats) -> None:
    """Write the innovations of an epoch, from row `low` on, their sigmas, likelihood and squares, in place."""
    for i in range(MEASURED - low):
        out.innovation[e, low + i], out.normalised[e, low + i] = innovation[i], white[i]
        variance = 0.0
        for j in range(i + 1):
            variance += L[i, j] ** 2
        out.innovation_sigma[e, low + i] = np.sqrt(variance)
    log = -0.5 * (MEASURED - low) * np.log(2.0 * np.pi)
    for i in range(MEASURED - low):
        log -= 0.5 * white[i] ** 2 + np.log(L[i, i])
    out.log_likelihood[e] = log
    for group in range(low // 3, 4):
        first = 3 * group - low
        out.nis[e, group] = white[first] ** 2 + white[first + 1] ** 2 + white[first + 2] ** 2


@compiled
def run_pass(data: PassInput, settings: PassSettings, state: PassState, out: PassOutput) -> None:
    """Navigate, propagate and measure, epoch by epoch; `state` and `out` are filled in place."""
    p = state.used.shape[0]
    G = np.zeros((NAV, p + COPY))
    D = np.zeros((6, p))
    sums = np.zeros(6)
    decay = np.ones(p + COPY)
    drive = np.zeros(p + COPY)
    gyro = np.eye(3) * settings.gyro_psd
    accel = np.eye(3) * settings.accel_psd
    longest = (data.last - data.first).max()
    C_mean, response = np.empty((longest, 3, 3)), np.empty((longest, 6, NAV))
    f_cycles = np.zeros((longest, 3))
    f_cycles[:, 2] = -earth.normal_gravity(settings.reference[0], settings.reference[2]) - settings.gravity_excess
    f_n = f_cycles[0]
    keep, kept, g = out.Phi.shape[0] > 0, out.H.shape[2], out.G.shape[2]
    for e in range(data.first.shape[0]):
        if data.shift[e] >= 0:
            _go_on_from(data.C_stop[data.shift[e]], state)
        if data.restart[e]:
            _restart(settings, state)
        position, velocity = state.position.copy(), state.velocity.copy()
        T = _navigate_epoch(data, e, settings, state, f_cycles, G[:, :p], D, sums, C_mean, response)
        Phi = transition(navigation_error_matrix(position, velocity, f_n), T)
        Q = process_noise(gyro * data.white[e], accel * data.white[e], f_n, T)
        for i in range(3):
            Q[3 + i, 3 + i] += data.gap_velocity[e] ** 2
            Q[6 + i, 6 + i] += data.gap_angle[e] ** 2
        _fade(settings, T, state.used, decay, drive)
        propagate(state.x, state.P, Phi, G, Q, decay, drive)
        kind = data.kind[e]
        if keep:
            put(Phi, out.Phi[e], 0, 0)
            if data.restart[e]:
                out.Phi[e, :, :6] = 0.0
            put(G[:, :g], out.G[e], 0, 0)
        if kind != SKIP:
            low = 0 if abs(kind) == ALL else 6
            if settings.shaken:
                at_the_end(settings.reference[0], f_n, data.dt[data.first[e] : data.last[e]], C_mean, state.C_nb, sums)
            z, H, R, M = _measurement(settings, state, D, sums, T, p, data.white[e])
            Hl, Ml, Rl = corner(H, low, 0), corner(M, 0, low), corner(R, low, low)
            if kind > 0:
                innovation, L, K = update(state.x, state.P, z[low:], Hl, Rl, Ml)
                if keep:
                    put(K[:kept], out.K[e], 0, low)
            else:
                innovation, L = predict(state.x, state.P, z[low:], Hl, Rl, Ml)
            white = whiten(L, innovation.reshape(-1, 1))[:, 0]
            _write(out, e, low, innovation, white, L)
            if keep:
                put(Hl[:, :kept], out.H[e], low, 0)
                put(L, out.L[e], low, low)
            if kind > 0:
                _feed_back(settings, state)
        if data.share[e] > 0.0:
            into_means(data.share[e], settings.averaged, NAV, state.x, state.P, state.used)
        for j in range(p):
            out.estimate[e, j] = state.used[j] + state.x[NAV + j]
        for i in range(state.x.shape[0]):
            out.sigma[e, i] = np.sqrt(state.P[i, i])
        put(state.C_nb, out.C_nb[e], 0, 0)
        if e % out.stride == 0:
            put(state.P[NAV : NAV + p, NAV : NAV + p], out.covariance[e // out.stride], 0, 0)
