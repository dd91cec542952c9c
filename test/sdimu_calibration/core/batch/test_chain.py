"""Elimination along a chain is least squares of all rows at once."""

import numpy as np

from sdimu_calibration.core.batch.chain import Link, solve

LINKS, OWN, COMMON = 5, 3, 4


def random_chain(generator):
    wide, last = 2 * OWN + COMMON + 1, LINKS - 1
    return [
        Link(generator.standard_normal((6, OWN + COMMON + 1)), generator.standard_normal((3 if k < last else 0, wide)))
        for k in range(LINKS)
    ]


def dense(links):
    """Rows and values of all links, side by side."""
    rows = []
    for k, link in enumerate(links):
        for part, own in ((link.rows, OWN), (link.step, 2 * OWN)):
            row = np.zeros((len(part), LINKS * OWN + COMMON + 1))
            if len(part):
                row[:, k * OWN : k * OWN + own], row[:, -COMMON - 1 :] = part[:, :own], part[:, own:]
            rows.append(row)
    whole = np.vstack(rows)
    return whole[:, :-1], whole[:, -1]


def test_solution_covariance_and_misfit_are_those_of_dense_least_squares():
    for seed in range(5):
        links = random_chain(np.random.default_rng(seed))
        A, r = dense(links)
        x, misfit, _, _ = np.linalg.lstsq(A, r, rcond=None)
        found = solve(links, OWN)
        np.testing.assert_allclose(found.common, x[-COMMON:], atol=1e-10)
        np.testing.assert_allclose(found.links.ravel(), x[:-COMMON], atol=1e-10)
        np.testing.assert_allclose(found.covariance, np.linalg.inv(A.T @ A)[-COMMON:, -COMMON:], atol=1e-10)
        np.testing.assert_allclose(found.chi2, misfit[0], rtol=1e-10)
        np.testing.assert_allclose(found.log_det, 0.5 * np.linalg.slogdet(A.T @ A)[1], rtol=1e-10)
        assert found.dof == A.shape[0] - A.shape[1]
