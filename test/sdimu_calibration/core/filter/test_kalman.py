"""The filter's two steps against dense matrices and against conditioning of the joint Gaussian."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from sdimu_calibration.core.filter.kalman import cholesky, predict, propagate, update, whiten


def spd(rng, n):
    """Random symmetric positive matrix with sigmas over three decades."""
    A = rng.standard_normal((n, n))
    sigma = 10.0 ** rng.uniform(-1.5, 1.5, n)
    return (A @ A.T / n + 0.2 * np.eye(n)) * np.outer(sigma, sigma)


def relative(A, B):
    sigma = np.sqrt(np.diag(B))
    return np.abs((A - B) / np.outer(sigma, sigma)).max()


@pytest.mark.parametrize("seed", range(20))
def test_update_is_conditioning_of_the_joint_gaussian(seed):
    """With noise that is correlated with the state, the posterior is read off the joint covariance of x and z."""
    rng = np.random.default_rng(seed)
    n, m = 9, 4
    joint = spd(rng, n + m)  # of prediction error and measurement noise
    P, M, R = joint[:n, :n].copy(), joint[:n, n:].copy(), joint[n:, n:].copy()
    x, H, z = rng.standard_normal(n), rng.standard_normal((m, n)), rng.standard_normal(m)
    T = np.block([[np.eye(n), np.zeros((n, m))], [H, np.eye(m)]])
    cov = T @ joint @ T.T
    gain = np.linalg.solve(cov[n:, n:], cov[n:, :n]).T
    mean, left = x + gain @ (z - H @ x), cov[:n, :n] - gain @ cov[n:, :n]
    got_x, got_P = x.copy(), P.copy()
    ahead, spread = predict(got_x, got_P, z, H, R, M)
    np.testing.assert_array_equal(got_x, x)
    np.testing.assert_array_equal(got_P, P)
    innovation, L, K = update(got_x, got_P, z, H, R, M)
    np.testing.assert_allclose(ahead, innovation, rtol=0, atol=1e-13)
    np.testing.assert_allclose(spread, L, rtol=1e-9, atol=1e-10 * np.abs(L).max())
    np.testing.assert_allclose(innovation, z - H @ x, rtol=0, atol=1e-13)
    np.testing.assert_allclose(L @ L.T, cov[n:, n:], rtol=1e-10, atol=1e-10 * np.abs(cov[n:, n:]).max())
    np.testing.assert_allclose(K, gain, rtol=1e-7, atol=1e-9 * np.abs(gain).max())
    assert (np.abs(got_x - mean) / np.sqrt(np.diag(left))).max() < 1e-8
    assert relative(got_P, left) < 1e-8
    np.testing.assert_array_equal(got_P, got_P.T)


@pytest.mark.parametrize("seed", range(5))
def test_without_shared_noise_update_adds_information(seed):
    rng = np.random.default_rng(seed)
    n, m = 7, 3
    P, R = spd(rng, n), spd(rng, m)
    x, H, z = rng.standard_normal(n), rng.standard_normal((m, n)), rng.standard_normal(m)
    information = np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H
    left = np.linalg.inv(information)
    mean = left @ (np.linalg.solve(P, x) + H.T @ np.linalg.solve(R, z))
    update(x, P, z, H, R, np.zeros((n, m)))
    assert (np.abs(x - mean) / np.sqrt(np.diag(left))).max() < 1e-7
    assert relative(P, left) < 1e-7


def test_covariance_stays_positive_through_measurements_a_million_times_better_than_the_prior():
    rng = np.random.default_rng(3)
    n = 8
    x, P = np.zeros(n), np.eye(n) * 1e6
    for _ in range(200):
        update(x, P, np.zeros(3), rng.standard_normal((3, n)), np.eye(3) * 1e-6, np.zeros((n, 3)))
    assert np.linalg.eigvalsh(P).min() > 0.0


@pytest.mark.parametrize("seed", range(5))
def test_propagate_is_the_dense_product(seed):
    rng = np.random.default_rng(seed)
    k, q = 4, 6
    n = k + q
    x, P, Q = rng.standard_normal(n), spd(rng, n), spd(rng, k)
    Phi, G = rng.standard_normal((k, k)), rng.standard_normal((k, q))
    decay = np.where(rng.random(q) < 0.5, 1.0, rng.uniform(0.1, 0.9, q))
    drive = rng.uniform(0, 1, q) * (decay < 1.0)
    F = np.block([[Phi, G], [np.zeros((q, k)), np.diag(decay)]])
    mean, cov = F @ x, F @ P @ F.T + block_diag(Q, np.diag(drive))
    propagate(x, P, Phi, G, Q, decay, drive)
    np.testing.assert_allclose(x, mean, rtol=1e-12, atol=1e-12)
    assert relative(P, cov) < 1e-12
    np.testing.assert_array_equal(P, P.T)


def test_cholesky_and_whiten_are_their_definitions_and_a_bad_matrix_gives_nan():
    rng = np.random.default_rng(0)
    S = spd(rng, 6)
    L = cholesky(S)
    np.testing.assert_allclose(L, np.linalg.cholesky(S), rtol=1e-9, atol=1e-12)
    B = rng.standard_normal((6, 3))
    np.testing.assert_allclose(L @ whiten(L, B), B, rtol=0, atol=1e-12)
    assert np.isnan(cholesky(-np.eye(2))).any()
