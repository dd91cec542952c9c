"""Tails of distributions that scipy does not have."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.probability import chi2_tail, in_percents, squares_tail


@pytest.mark.parametrize("dof", [1, 7])
def test_the_tail_of_equal_squares_is_that_of_chi_square(dof):
    assert squares_tail(3.0 * 12.0, np.full(dof, 3.0)) == pytest.approx(chi2_tail(12.0, dof), rel=1e-9)


@pytest.mark.parametrize("weights", [[20.0, *[1.0] * 40], [8.0, 4.0, 2.0, 1.0], [5.0, 5.0, *[0.1] * 30]])
def test_the_tail_of_unequal_squares_is_that_of_draws(weights):
    drawn = np.random.default_rng(1).standard_normal((200_000, len(weights))) ** 2 @ weights
    for p in (0.05, 1e-3):
        # Three moments are not all of a distribution: a limit needs its probability to a third.
        assert squares_tail(float(np.quantile(drawn, 1.0 - p)), np.array(weights)) == pytest.approx(p, rel=0.3)


@pytest.mark.parametrize(
    ("shares", "told"),
    [
        ((0.515, 0.485), ["52 %", "48 %"]),
        ((0.436, 0.376, 0.188), ["44 %", "37 %", "19 %"]),
        ((0.335, 0.335, 0.33), ["34 %", "33 %", "33 %"]),
        ((0.546, 0.194, 0.127), ["55 %", "19 %", "13 %"]),
        ((0.6, 0.43), ["60 %", "43 %"]),
        ((0.57, 0.29), ["57 %", "29 %"]),
        ((0.997, 0.002), ["> 99 %", "< 1 %"]),
        ((), []),
    ],
    ids=str,
)
def test_percents_of_a_list_add_up_as_its_probabilities_do(shares, told):
    """A class was told as 52 % or 49 %, another as 44 %, 38 % or 19 %."""
    found = in_percents(shares)
    pairs = zip(found, shares, strict=True)
    assert found == told
    assert all(abs(float(text.rstrip(" %")) - 100.0 * p) < 1.0 for text, p in pairs if text[0] not in "<>")
