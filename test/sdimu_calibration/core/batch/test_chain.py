"""Elimination along a chain is least squares of all rows at once."""

import numpy as np

from sdimu_calibration.core.batch.chain import Link, solve

LINKS, OWN, COMMON = 5, 3, 4


def random_chain(generator):
    links = []
    for k in range(LINKS):
        last = k == LINKS - 1
        steps = 0 if last else 3
        links.append(
            Link(
                generator.standard_normal((6, OWN)),
                generator.standard_normal((6, COMMON)),
                generator.standard_normal(6),
                generator.standard_normal((steps, OWN)),
                generator.standard_normal((steps, OWN)),
                generator.standard_normal((steps, COMMON)),
                generator.standard_normal(steps),
            )
        )
    return links


def dense(links):
    width = LINKS * OWN + COMMON
    rows, residual = [], []
    for k, link in enumerate(links):
        own = np.zeros((len(link.residual), width))
        own[:, k * OWN : (k + 1) * OWN], own[:, -COMMON:] = link.own, link.common
        step = np.zeros((len(link.step_residual), width))
        step[:, k * OWN : (k + 1) * OWN], step[:, -COMMON:] = link.step_own, link.step_common
        if len(step):
            step[:, (k + 1) * OWN : (k + 2) * OWN] = link.step_next
        rows += [own, step]
        residual += [link.residual, link.step_residual]
    return np.vstack(rows), np.concatenate(residual)


def test_solution_covariance_and_misfit_are_those_of_dense_least_squares():
    for seed in range(5):
        links = random_chain(np.random.default_rng(seed))
        A, r = dense(links)
        x, misfit, _, _ = np.linalg.lstsq(A, -r, rcond=None)
        found = solve(links)
        np.testing.assert_allclose(found.common, x[-COMMON:], atol=1e-10)
        np.testing.assert_allclose(found.links.ravel(), x[:-COMMON], atol=1e-10)
        np.testing.assert_allclose(found.covariance, np.linalg.inv(A.T @ A)[-COMMON:, -COMMON:], atol=1e-10)
        np.testing.assert_allclose(found.chi2, misfit[0], rtol=1e-10)
        np.testing.assert_allclose(found.log_det, 0.5 * np.linalg.slogdet(A.T @ A)[1], rtol=1e-10)
        assert found.dof == A.shape[0] - A.shape[1]
