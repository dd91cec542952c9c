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

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.filter.filter_pass import MEASURED, NAV, PassOutput
from sdimu_calibration.core.filter.kalman import whiten
from sdimu_calibration.core.matrix3 import applied, elements
from sdimu_calibration.core.navigation.ins_errors import add_columns, responses


@compiled
def _signatures(
    C_nb: Floats, f_b: Floats, dt: Floats, first: Ints, last: Ints, kind: Ints,
    values: Floats, channel: Ints, parameter: Ints, q: int, w_ie: Floats,
    Phi: Floats, H: Floats, L: Floats, K: Floats, W: Floats,
) -> None:  # fmt: skip
    """Fill W (rows, q), one row a measured scalar, in the order of epochs and channels."""
    V = np.zeros((NAV, q))
    G = np.zeros((NAV, q))
    D = np.zeros((6, q))
    longest = (last - first).max()
    R, f_n = np.empty((longest, 6, NAV)), np.empty((longest, 3))
    row = 0
    for e in range(first.shape[0]):
        a, b = first[e], last[e]
        for c in range(a, b):
            f_n[c - a, 0], f_n[c - a, 1], f_n[c - a, 2] = applied(elements(C_nb[c]), f_b[c, 0], f_b[c, 1], f_b[c, 2])
        responses(C_nb[a:b], f_n, dt[a:b], 0, b - a, w_ie, R)
        add_columns(values[a:b], channel, parameter, R, dt[a:b], G, D)
        V = Phi[e] @ V + G
        if kind[e] == 0:
            continue
        low = 0 if abs(kind[e]) == 2 else 6
        m = MEASURED - low
        S = np.ascontiguousarray(H[e, low:, :NAV]) @ V
        S[6 - low :] += D / dt[a:b].sum()
        W[row : row + m] = whiten(np.ascontiguousarray(L[e, low:, low:]), S)
        V -= np.ascontiguousarray(K[e, :NAV, low:]) @ S
        row += m


def signatures(
    seen: Motion, first: Ints, last: Ints, kind: Ints, output: PassOutput,
    values: Floats, channel: Ints, parameter: Ints, latitude: float, W: Floats,
) -> None:  # fmt: skip
    """Signatures of q parameters in the whitened innovations of a navigation filter.

    Parameters
    ----------
    seen : Motion
        Predicted motion, n cycles.
    first, last, kind : ndarray of int, shape (e,)
        Epochs, as in `filter_pass.PassInput`.
    output : PassOutput
        Of the pass with known coefficients, with its matrices kept.
    values : ndarray, shape (n, m)
        Regressor columns.
    channel, parameter : ndarray of int, shape (m,)
        Sensor axis and parameter of each column.
    latitude : float
        Of the site (rad).
    W : ndarray, shape (rows, q)
        Filled; rows in the order of `measured_rows`.
    """
    _signatures(
        np.ascontiguousarray(seen.C_nb), np.ascontiguousarray(seen.f), seen.dt, first, last, kind,
        np.ascontiguousarray(values), channel, parameter, W.shape[1], earth.earth_rate(latitude),
        output.Phi, output.H, output.L, output.K, W,
    )  # fmt: skip


def measured_rows(output: PassOutput) -> tuple[Ints, Ints]:
    """Epoch and channel (0-11: position, velocity, rate, force, three each) of every row."""
    epoch, channel = np.nonzero(np.isfinite(output.normalised))
    return epoch.astype(np.int64), channel.astype(np.int64)
