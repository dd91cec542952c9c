"""The Kalman filter's two steps, for a state whose first rows move and whose other rows do not.

Knows no navigation: every row of the state has the SI unit of its owner, a covariance the product of two of them,
and whitened quantities are dimensionless. The measurement noise may be correlated with the process noise of the
interval that it ends (the same samples drive the navigation and make the measurement), so the update carries the
cross-covariance M.

Source: the joint covariance of prediction error and measurement noise is [[P, M], [M', R]]; with gain K the error after
the update is [I - KH, -K] times it, for every K (Jazwinski, *Stochastic Processes and Filtering Theory*,
section 7.3; Simon, *Optimal State Estimation*, section 7.1). That product, multiplied out with ``B = H P + M'`` and
the innovation's covariance S, is ``P - K B - B' K' + K S K'``: as Joseph's form it is right for every K, so that
rounding in K counts only squared, and as ``P - K F - F' K'`` with ``F = B - S K' / 2`` it is symmetric to the digit.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.matrix3 import put, sparse_product


@compiled
def propagate(x: Floats, P: Floats, Phi: Floats, G: Floats, Q: Floats, decay: Floats, drive: Floats) -> None:
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
    put(Phi, F, 0, 0)
    put(G, F, 0, k)
    FP = F @ P
    FPF, Fx = FP @ F.T, F @ x
    for i in range(k):
        x[i] = Fx[i]
        for j in range(k):
            P[i, j] = FPF[i, j] + Q[i, j]
        for j in range(k, n):
            P[i, j] = FP[i, j]
    for i in range(k, n):
        d = decay[i - k]
        if d != 1.0:
            x[i] *= d
            for j in range(k):
                P[j, i] *= d
            for j in range(k, n):
                P[i, j] *= d
            for j in range(k, n):
                P[j, i] *= d
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
    """Lower Cholesky factor; a matrix that is not positive definite gives NaN rather than an exception.

    Parameters
    ----------
    S : ndarray, shape (m, m)

    Returns
    -------
    ndarray, shape (m, m)
    """
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
    """Solve ``L X = B`` for lower triangular L.

    Parameters
    ----------
    L : ndarray, shape (m, m)
    B : ndarray, shape (m, q)

    Returns
    -------
    ndarray, shape (m, q)
    """
    # Element by element: a row operation on arrays would allocate for every pair of rows.
    X = B.copy()
    for i in range(L.shape[0]):
        for m in range(i):
            for j in range(X.shape[1]):
                X[i, j] -= L[i, m] * X[m, j]
        for j in range(X.shape[1]):
            X[i, j] /= L[i, i]
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
    m, n = H.shape
    B = sparse_product(H, P)
    HM = sparse_product(H, M)
    S = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            S[i, j] = R[i, j] + HM[i, j] + HM[j, i]
    for i in range(m):
        for k in range(n):
            h = H[i, k]
            if h != 0.0:
                for j in range(m):
                    S[j, i] += B[j, k] * h
    for i in range(m):
        for j in range(n):
            B[i, j] += M[j, i]
    L = cholesky(S)
    Kt = whiten(L, B)
    # K' = S^-1 B by back substitution of L' on the whitened rows.
    for i in range(m - 1, -1, -1):
        for j in range(i + 1, m):
            for k in range(n):
                Kt[i, k] -= L[j, i] * Kt[j, k]
        for k in range(n):
            Kt[i, k] /= L[i, i]
    innovation = z.copy()
    for i in range(m):
        for k in range(n):
            innovation[i] -= H[i, k] * x[k]
    for i in range(m):
        for k in range(n):
            x[k] += Kt[i, k] * innovation[i]
    F = sparse_product(S, Kt)
    for i in range(m):
        for k in range(n):
            F[i, k] = B[i, k] - 0.5 * F[i, k]
    KF = Kt.T @ F
    for i in range(n):
        for j in range(n):
            P[i, j] -= KF[i, j] + KF[j, i]
    K = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            K[i, j] = Kt[j, i]
    return innovation, L, K


@compiled
def predict(x: Floats, P: Floats, z: Floats, H: Floats, R: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Compare a measurement with its prediction, and do not take it.

    Parameters
    ----------
    x : ndarray, shape (n,)
    P : ndarray, shape (n, n)
    z : ndarray, shape (m,)
    H : ndarray, shape (m, n)
    R : ndarray, shape (m, m)
    M : ndarray, shape (n, m)
        All as of `update`.

    Returns
    -------
    innovation : ndarray, shape (m,)
    L : ndarray, shape (m, m)
        Lower Cholesky factor of the innovation's covariance.
    """
    HM = sparse_product(H, M)
    S = sparse_product(sparse_product(H, P), H.T)
    Hx = sparse_product(H, x.reshape(-1, 1))
    innovation = z.copy()
    for i in range(len(z)):
        innovation[i] -= Hx[i, 0]
        for j in range(len(z)):
            S[i, j] = S[i, j] + HM[i, j] + HM[j, i] + R[i, j]
    return innovation, cholesky(S)
