"""What noise takes of the information on something else: against the dense Schur complement, and of no modes."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.evidence.taken import divided, nothing_taken, taken


@pytest.fixture
def problem():
    rng = np.random.default_rng(3)
    A = rng.standard_normal((7, 9))
    return np.eye(7) + A @ A.T, rng.standard_normal(7), rng.standard_normal((4, 7))


def test_it_is_the_schur_complement_and_the_likelihood_of_the_modes(problem):
    M, y, across = problem
    modes = taken(M, y, across)
    np.testing.assert_allclose(modes.J, across @ np.linalg.solve(M, across.T), rtol=1e-12)
    np.testing.assert_allclose(modes.d, across @ np.linalg.solve(M, y), rtol=1e-12)
    assert modes.gain == pytest.approx(0.5 * y @ np.linalg.solve(M, y) - 0.5 * np.linalg.slogdet(M)[1], rel=1e-12)


def test_a_factor_divides_both_ways(problem):
    M, y, across = problem
    L = taken(M, y, across).L
    np.testing.assert_allclose(divided(L, across), np.linalg.solve(L, across.T), rtol=1e-12)
    np.testing.assert_allclose(divided(L, across, turned=True), np.linalg.solve(L.T, across.T), rtol=1e-12)


def test_no_modes_take_nothing():
    for none in (nothing_taken(4), taken(np.zeros((0, 0)), np.zeros(0), np.zeros((4, 0)))):
        assert none.gain == 0.0
        assert not none.J.any()
        assert not none.d.any()
        assert none.J.shape == (4, 4)


def test_what_is_no_information_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        taken(-np.eye(2), np.zeros(2), np.zeros((1, 2)))
