"""A force predicted from everything but itself is that of a least squares without it."""

import numpy as np

from sdimu_calibration.core.handheld.handheld_fit import forces_ahead


def test_it_is_what_a_fit_without_the_rest_predicts():
    rng = np.random.default_rng(5)
    k, u = 7, 5
    m = 6 * k + 4
    rows, residual, sigma = rng.standard_normal((m, u)), rng.standard_normal(m), rng.uniform(0.5, 2.0, m)
    Q, R = np.linalg.qr(rows / sigma[:, None])
    step = -np.linalg.solve(R, Q.T @ (residual / sigma))
    found = forces_ahead(Q, (residual + rows @ step) / sigma, sigma, k)
    total = 0.0
    for i in range(k):
        at = np.arange(6 * i + 3, 6 * i + 6)
        other = np.setdiff1d(np.arange(m), at)
        part = rows[other] / sigma[other, None]
        P = np.linalg.inv(part.T @ part)
        error = residual[at] - rows[at] @ (P @ part.T @ (residual[other] / sigma[other]))
        C = np.diag(sigma[at] ** 2) + rows[at] @ P @ rows[at].T
        np.testing.assert_allclose(found.error[i], error, rtol=1e-10)
        np.testing.assert_allclose(found.sigma[i], np.sqrt(np.diag(C)), rtol=1e-10)
        total += error @ np.linalg.solve(C, error)
    np.testing.assert_allclose(found.rms, np.sqrt(total / (3 * k)), rtol=1e-10)


def test_a_rest_that_alone_tells_a_coefficient_is_predicted_by_no_other():
    rows = np.random.default_rng(6).standard_normal((12, 4))
    # The first rest alone knows the last coefficient; rounding then makes what is left of it negative.
    rows[:, 3] = 0.0
    rows[3:6, 3] = 1e13, 2e13, 3e13
    Q = np.linalg.qr(rows)[0]
    for sign in (1.0, 1.0 + 1e-15, 1.0 + 1e-14):
        found = forces_ahead(sign * Q, np.ones(12), np.ones(12), 2)
        assert np.isfinite(found.sigma).all()
        assert np.isfinite(found.rms)
        assert found.sigma[0].max() > 1e3 * found.sigma[1].max()
