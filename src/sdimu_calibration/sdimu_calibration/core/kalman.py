"""The Kalman filter's two steps, for a state whose first rows move and whose other rows do not.

Knows no navigation. The measurement noise may be correlated with the process noise of the interval that it ends
(the same samples drive the navigation and make the measurement), so the update carries the cross-covariance M.

Source: the joint covariance of prediction error and measurement noise is [[P, M], [M', R]]; with gain K the error after
the update is [I - KH, -K] times it, for every K (Jazwinski, *Stochastic Processes and Filtering Theory*,
section 7.3; Simon, *Optimal State Estimation*, section 7.1). That product is Joseph's form and stays
symmetric and positive whatever rounding does to K.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.compiled import compiled

Floats = NDArray[np.float64]


@compiled
def propagate(
    x: Floats, P: Floats, Phi: Floats, G: Floats, Q: Floats, decay: Floats, drive: Floats
) -> None:
    """Propagate mean and covariance over an interval, in place.

    Parameters
    ----------
    x : ndarray, shape (n,)
    P : ndarray, shape (n, n)
    Phi : ndarray, shape (k, k)
        Transition of the first k rows.
    G : ndarray, shape (k, n - k)
        Their response to the others.
    Q : ndarray, shape (k, k)
        Process noise of the first rows.
    decay, drive : ndarray, shape (n - k,)
        Factor and added variance of each of the others over the interval (1 and 0 for constants).
    """
    k = Phi.shape[0]
    n = x.shape[0]
    F = np.empty((k, n))
    F[:, :k] = Phi
    F[:, k:] = G
    FP = F @ P
    x[:k] = F @ x
    P[:k, :k] = FP @ F.T + Q
    P[:k, k:] = FP[:, k:]
    for i in range(k, n):
        d = decay[i - k]
        if d != 1.0:
            x[i] *= d
            P[:k, i] *= d
            P[i, k:] *= d
            P[k:, i] *= d
        P[i, i] += drive[i - k]
    for i in range(k):
        for j in range(k, n):
            P[j, i] = P[i, j]
        for j in range(i):
            mean = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = mean
            P[j, i] = mean


@compiled
def cholesky(S: Floats) -> Floats:
    """Lower Cholesky factor; a matrix that is not positive gives NaN rather than an exception."""
    n = S.shape[0]
    L = np.zeros((n, n))
    for j in range(n):
        d = S[j, j]
        for m in range(j):
            d -= L[j, m] * L[j, m]
        L[j, j] = np.sqrt(d)
        for i in range(j + 1, n):
            v = S[i, j]
            for m in range(j):
                v -= L[i, m] * L[j, m]
            L[i, j] = v / L[j, j]
    return L


@compiled
def whiten(L: Floats, B: Floats) -> Floats:
    """Solve ``L X = B`` for lower triangular L; `B` shape (m, q)."""
    X = B.copy()
    for i in range(L.shape[0]):
        for m in range(i):
            X[i] -= L[i, m] * X[m]
        X[i] /= L[i, i]
    return X


@compiled
def update(x: Floats, P: Floats, z: Floats, H: Floats, R: Floats, M: Floats) -> tuple[Floats, Floats, Floats]:
    """Take one measurement, in place.

    Parameters
    ----------
    x : ndarray, shape (n,)
    P : ndarray, shape (n, n)
    z : ndarray, shape (m,)
        ``z = H x + noise``.
    H : ndarray, shape (m, n)
    R : ndarray, shape (m, m)
        Covariance of the noise.
    M : ndarray, shape (n, m)
        Covariance of the prediction error's newest process noise with the measurement noise.

    Returns
    -------
    innovation : ndarray, shape (m,)
    L : ndarray, shape (m, m)
        Lower Cholesky factor of the innovation's covariance S.
    K : ndarray, shape (n, m)
        Gain.
    """
    HP = H @ P
    HM = H @ M
    S = HP @ H.T + HM + HM.T + R
    L = cholesky(S)
    Y = whiten(L, HP + M.T)
    # K' = S^-1 (HP + M') by back substitution of L' on the whitened rows.
    m = L.shape[0]
    Kt = Y.copy()
    for i in range(m - 1, -1, -1):
        for j in range(i + 1, m):
            Kt[i] -= L[j, i] * Kt[j]
        Kt[i] /= L[i, i]
    K = np.ascontiguousarray(Kt.T)
    innovation = z - H @ x
    x += K @ innovation
    A_P = P - K @ HP
    A_M = M - K @ HM
    P[:, :] = A_P - (A_P @ H.T + A_M - K @ R) @ Kt - K @ A_M.T
    n = x.shape[0]
    for i in range(n):
        for j in range(i):
            mean = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = mean
            P[j, i] = mean
    return innovation, L, K
