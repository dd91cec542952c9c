"""Tails of distributions that scipy does not have."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.probability import chi2_tail, squares_tail


@pytest.mark.parametrize("dof", [1, 7])
def test_the_tail_of_equal_squares_is_that_of_chi_square(dof):
    assert squares_tail(3.0 * 12.0, np.full(dof, 3.0)) == pytest.approx(chi2_tail(12.0, dof), rel=1e-9)


@pytest.mark.parametrize("weights", [[20.0, *[1.0] * 40], [8.0, 4.0, 2.0, 1.0], [5.0, 5.0, *[0.1] * 30]])
def test_the_tail_of_unequal_squares_is_that_of_draws(weights):
    drawn = np.random.default_rng(1).standard_normal((200_000, len(weights))) ** 2 @ weights
    for p in (0.05, 1e-3):
        # Three moments are not all of a distribution: a limit needs its probability to a third.
        assert squares_tail(float(np.quantile(drawn, 1.0 - p)), np.array(weights)) == pytest.approx(p, rel=0.3)
