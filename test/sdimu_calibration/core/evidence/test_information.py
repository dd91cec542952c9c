"""Information on some parameters with others estimated along: a Schur complement, and nothing left on the others."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.evidence.information import Information


def test_what_is_estimated_along_is_left_without_information_and_the_rest_is_that_of_the_joint_estimate():
    rng = np.random.default_rng(3)
    W, e = rng.standard_normal((40, 5)), rng.standard_normal(40)
    known, weight = np.array([0, 2]), np.array([0.5, 3.0])
    left = Information(W.T @ W, W.T @ e).given(known, weight)
    assert not left.J[known].any()
    assert not left.J[:, known].any()
    assert not left.d[known].any()
    others = np.array([1, 3, 4])
    prior = np.zeros(5)
    prior[known] = weight
    joint = np.linalg.solve(W.T @ W + np.diag(prior), W.T @ e)
    alone = np.linalg.solve(left.J[np.ix_(others, others)], left.d[others])
    np.testing.assert_allclose(alone, joint[others], rtol=1e-10)


def test_an_information_that_rounding_made_negative_has_no_likelihood_and_no_warning():
    J = np.diag([1.0, -1e-16])
    with np.errstate(invalid="raise"):
        assert Information(J, np.zeros(2)).log_likelihood(np.array([1.0, 0.0])) == -np.inf
