"""How a sensor error shows in the innovations: Friedland's separate-bias recursion.

The navigation filter runs with the coefficients known. A parameter that adds ``A(t)`` to the sensors then adds the
column W to its whitened innovations, by the recursion

    U = Phi V + G_in,   S = H U + D,   W = L^-1 S,   V = U - K S,

G_in the navigation's response over the epoch, D the direct term, Phi, H, L, K the filter's own. Given W for every
parameter, known and suspected, everything that follows is linear least squares on the whitened innovations e: ``e = W
theta + white noise``.

Sources: B. Friedland, "Treatment of bias in recursive filtering", IEEE Trans. Automatic Control 14 (1969); A.
Willsky, H. Jones, "A generalized likelihood ratio approach ...", ibid. 21 (1976).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.filter.filter_pass import MEASURED, NAV, PassOutput
from sdimu_calibration.core.filter.kalman import whiten
from sdimu_calibration.core.matrix3 import corner, put
from sdimu_calibration.core.navigation.ins_errors import add_columns, responses


@compiled
def _responses(
    C_nb: Floats, f_b: Floats, dt: Floats, w_ie: Floats, weight: Floats, f_n: Floats, R: Floats, direct: Floats
) -> None:
    """Response of the navigation over an epoch of n cycles, and of the mean of each sensor, to the sensor axes.

    Parameters
    ----------
    C_nb, f_b, dt, w_ie
        Attitude, force (m/s^2) and length (s) of the cycles; Earth's rate in NED (rad/s). Of the force its vertical
        part counts: the table does not travel.
    weight : ndarray, shape (n, 6, 6) or (0, 6, 6)
        Change of corrected rate and force per change of the measured ones; none is the identity.
    f_n, R, direct : ndarray, shapes (n, 3), (n, 6, 9), (n, 6, 6)
        Filled: force in NED; response to each axis; with a `weight`, integral of all sensors for each axis.
    """
    n = dt.shape[0]
    for c in range(n):
        f_n[c, 0] = f_n[c, 1] = 0.0
        f_n[c, 2] = C_nb[c, 2, 0] * f_b[c, 0] + C_nb[c, 2, 1] * f_b[c, 1] + C_nb[c, 2, 2] * f_b[c, 2]
    responses(C_nb, f_n, dt, 0, n, w_ie, R)
    if weight.shape[0] == 0:
        return
    own = np.empty((6, NAV))
    for c in range(n):
        put(R[c], own, 0, 0)
        for s in range(6):
            for i in range(NAV):
                R[c, s, i] = 0.0
                for axis in range(6):
                    R[c, s, i] += weight[c, axis, s] * own[axis, i]
            for axis in range(6):
                direct[c, s, axis] = weight[c, axis, s] * dt[c]


@compiled
def _add_weighed_columns(
    values: Floats, channel: Ints, parameter: Ints, R: Floats, direct: Floats, G: Floats, D: Floats
) -> None:
    """Do as `add_columns` does, where an error of one sensor axis shows in the corrected samples of all.

    Of n cycles: regressors (n, m), with the sensor axis and parameter (m,) of each; R (n, 6, 9) and direct (n, 6, 6) of
    `_responses`. Filled: G (9, q) and D (6, q), of the navigation and of the integrals of the sensors.
    """
    G[:, :] = 0.0
    D[:, :] = 0.0
    g, d = np.empty(NAV), np.empty(6)
    for j in range(channel.shape[0]):
        ch, k = channel[j], parameter[j]
        g[:] = 0.0
        d[:] = 0.0
        for c in range(values.shape[0]):
            v = values[c, j]
            if v != 0.0:
                for i in range(NAV):
                    g[i] += R[c, ch, i] * v
                for i in range(6):
                    d[i] += direct[c, ch, i] * v
        for i in range(NAV):
            G[i, k] += g[i]
        for i in range(6):
            D[i, k] += d[i]


class Epochs(NamedTuple):
    """Epochs, as in `filter_pass.PassInput`."""

    first: Ints
    last: Ints
    """`first`, `last`: cycles from `first` to before `last`, shape (e,)."""
    kind: Ints
    """What each measures, shape (e,)."""


class Regressors(NamedTuple):
    """Regressors of parameters."""

    values: Floats
    """Columns, of n cycles, shape (n, m)."""
    channel: Ints
    parameter: Ints
    """`channel`, `parameter`: sensor axis and parameter of each column, shape (m,)."""


class _Cycles(NamedTuple):
    """Motion over n cycles for the compiled loops: end (n,), attitude (n, 3, 3), force (n, 3), length (n,)."""

    t: Floats
    C_nb: Floats
    f_b: Floats
    dt: Floats


class _Filter(NamedTuple):
    """Matrices of the filter, one each an epoch."""

    Phi: Floats
    H: Floats
    L: Floats
    K: Floats


@compiled
def _measure(known: _Filter, e: int, low: int, D: Floats, seconds: float, V: Floats, W: Floats, row: int) -> None:
    """Write what an epoch e measures, from channel `low` on, to W from `row` on, and take it out of V (9, q).

    `D` (6, q) are the integrals of the sensors over the `seconds` of the epoch.
    """
    S = corner(known.H[e, :, :NAV], low, 0) @ V
    for i in range(6):
        for j in range(S.shape[1]):
            S[6 - low + i, j] += D[i, j] / seconds
    put(whiten(corner(known.L[e], low, low), S), W, row, 0)
    taken = corner(known.K[e, :NAV], 0, low) @ S
    for i in range(NAV):
        for j in range(S.shape[1]):
            V[i, j] -= taken[i, j]


@compiled
def _signatures(
    cycles: _Cycles, epochs: Epochs, regressors: Regressors, w_ie: Floats, weight: Floats, known: _Filter, W: Floats
) -> None:
    """Fill W (rows, q), one row a measured scalar, in the order of epochs and channels."""
    C_nb, f_b, dt = cycles.C_nb, cycles.f_b, cycles.dt
    values, channel, parameter = regressors.values, regressors.channel, regressors.parameter
    first, last, kind = epochs.first, epochs.last, epochs.kind
    q = W.shape[1]
    V = np.zeros((NAV, q))
    G = np.zeros((NAV, q))
    D = np.zeros((6, q))
    longest = (last - first).max()
    R, f_n, direct = np.empty((longest, 6, NAV)), np.empty((longest, 3)), np.empty((longest, 6, 6))
    row = 0
    for e in range(first.shape[0]):
        a, b = first[e], last[e]
        _responses(C_nb[a:b], f_b[a:b], dt[a:b], w_ie, weight[a:b], f_n, R, direct)
        if weight.shape[0]:
            _add_weighed_columns(values[a:b], channel, parameter, R, direct, G, D)
        else:
            add_columns(values[a:b], channel, parameter, R, dt[a:b], G, D)
        V = known.Phi[e] @ V
        for i in range(NAV):
            for j in range(q):
                V[i, j] += G[i, j]
        if kind[e] == 0:
            continue
        low = 0 if abs(kind[e]) == 2 else 6
        m = MEASURED - low
        _measure(known, e, low, D, dt[a:b].sum(), V, W, row)
        row += m


def signatures(
    seen: Motion,
    epochs: Epochs,
    output: PassOutput,
    regressors: Regressors,
    latitude: float,
    weight: Floats | None,
    W: Floats,
) -> None:
    """Signatures of q parameters in the whitened innovations of a navigation filter.

    Parameters
    ----------
    seen : Motion
        Predicted motion, n cycles.
    output : PassOutput
        Of the pass with known coefficients, with its matrices kept.
    regressors : Regressors
        In m columns.
    latitude : float
        Of the site (rad).
    weight : ndarray, shape (n, 6, 6), or None
        Change of corrected rate and force per change of the measured ones; None is the identity.
    W : ndarray, shape (rows, q)
        Filled; rows in the order of `measured_rows`.
    """
    whole = regressors._replace(values=np.ascontiguousarray(regressors.values))
    _signatures(_cycles(seen), epochs, whole, earth.earth_rate(latitude), _or_none(weight), _filter(output), W)


def _cycles(seen: Motion) -> _Cycles:
    return _Cycles(seen.t, np.ascontiguousarray(seen.C_nb), np.ascontiguousarray(seen.f), seen.dt)


def _filter(output: PassOutput) -> _Filter:
    return _Filter(output.Phi, output.H, output.L, output.K)


@compiled
def _add_constant(share: float, column: int, response: Floats, V: Floats) -> None:
    """Add a constant error of each axis over a `share` of a cycle to V (9, ...); response (6, 9)."""
    for s in range(6):
        for i in range(NAV):
            V[i, column + s] += share * response[s, i]


@compiled
def _add_integral(share: float, column: int, direct: Floats, D: Floats) -> None:
    """Add what it makes of the integrals of the corrected sensors to D (6, ...); direct (6, 6) (s)."""
    for s in range(6):
        for i in range(6):
            D[i, column + s] += share * direct[s, i]


@compiled
def _add_own_integral(seconds: float, column: int, D: Floats) -> None:
    """Add the integral of each sensor of its own constant error to D (6, ...)."""
    for s in range(6):
        D[s, column + s] += seconds


@compiled
def _constant_signatures(
    cycles: _Cycles, epochs: Epochs, start: Floats, end: Floats, w_ie: Floats, weight: Floats, known: _Filter, W: Floats
) -> None:
    """Fill W (rows, 6 s): a constant error of each axis in each of s stretches, which follow each other."""
    t, C_nb, f_b, dt = cycles.t, cycles.C_nb, cycles.f_b, cycles.dt
    first, last, kind = epochs.first, epochs.last, epochs.kind
    count = start.shape[0]
    V = np.zeros((NAV, 6 * count))
    D = np.zeros((6, 6 * count))
    longest = (last - first).max()
    R, f_n, direct = np.empty((longest, 6, NAV)), np.empty((longest, 3)), np.empty((longest, 6, 6))
    row = 0
    for e in range(first.shape[0]):
        a, b = first[e], last[e]
        low = 0 if abs(kind[e]) == 2 else 6
        m = MEASURED - low if kind[e] else 0
        if t[b - 1] <= start[0]:
            row += m
            continue
        _responses(C_nb[a:b], f_b[a:b], dt[a:b], w_ie, weight[a:b], f_n, R, direct)
        V = known.Phi[e] @ V
        D[:, :] = 0.0
        for k in range(count):
            if t[b - 1] <= start[k] or t[a] - dt[a] >= end[k]:
                continue
            for c in range(a, b):
                share = (min(t[c], end[k]) - max(t[c] - dt[c], start[k])) / dt[c]
                if share <= 0.0:
                    continue
                share = min(share, 1.0)
                _add_constant(share, 6 * k, R[c - a], V)
                if weight.shape[0]:
                    _add_integral(share, 6 * k, direct[c - a], D)
                else:
                    _add_own_integral(share * dt[c], 6 * k, D)
        if m == 0:
            continue
        _measure(known, e, low, D, dt[a:b].sum(), V, W, row)
        row += m


def constant_signatures(
    seen: Motion,
    epochs: Epochs,
    output: PassOutput,
    start: Floats,
    end: Floats,
    latitude: float,
    weight: Floats | None,
    W: Floats,
) -> None:
    """Signatures of a constant error of each sensor axis in each of s stretches of time.

    Parameters
    ----------
    seen : Motion
        Predicted motion, n cycles.
    output : PassOutput
        Of the pass with known coefficients, with its matrices kept.
    start, end : ndarray, shape (s,)
        Begin and end of each stretch (s), in the order of time.
    latitude : float
        Of the site (rad).
    weight : ndarray, shape (n, 6, 6), or None
        Change of corrected rate and force per change of the measured ones (SI); None is the identity.
    W : ndarray, shape (rows, 6 s)
        Filled from the first stretch on, per rad/s or m/s^2, and left as it is before; column ``6 stretch + axis``.
    """
    _constant_signatures(
        _cycles(seen),
        epochs,
        np.ascontiguousarray(start),
        np.ascontiguousarray(end),
        earth.earth_rate(latitude),
        _or_none(weight),
        _filter(output),
        W,
    )


def _or_none(weight: Floats | None) -> Floats:
    """Give weights to a compiled loop: (n, 6, 6), or (0, 6, 6) for the identity."""
    return np.zeros((0, 6, 6)) if weight is None else np.ascontiguousarray(weight)


def measured_rows(output: PassOutput) -> tuple[Ints, Ints]:
    """Say which measurement each row of the signatures is, in the order of epochs and channels.

    Returns
    -------
    epoch, channel : ndarray of int, shape (rows,)
        Channels 0-11 are position, velocity, rate, force, three each.
    """
    epoch, channel = np.nonzero(np.isfinite(output.normalised))
    return epoch.astype(np.int64), channel.astype(np.int64)
