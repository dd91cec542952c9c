"""Likelihood of the size of noise in a chain of modes: as the dense matrices have it."""

import numpy as np
import pytest

from sdimu_calibration.core.evidence.tridiagonal import Tridiagonal


def information(modes: int, rank: int, seed: int):
    """Of that rank, over twelve powers of ten, and a vector in its range."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((modes, rank)) * np.logspace(-6.0, 0.0, rank)
    return root @ root.T, root @ rng.standard_normal(rank)


@pytest.mark.parametrize(("modes", "rank"), [(1, 1), (2, 2), (40, 40), (40, 7)])
def test_gain_and_largest_eigenvalue_are_those_of_the_dense_matrix(modes, rank):
    J, d = information(modes, rank, modes + rank)
    chain = Tridiagonal.of(J, d)
    assert chain.largest == pytest.approx(np.linalg.eigvalsh(J)[-1], rel=1e-9)
    variance = np.logspace(-3.0, 6.0, 19)
    dense = [
        0.5 * v * d @ np.linalg.solve(np.eye(modes) + v * J, d) - 0.5 * np.linalg.slogdet(np.eye(modes) + v * J)[1]
        for v in variance
    ]
    np.testing.assert_allclose(chain.gain(variance), dense, rtol=1e-7, atol=1e-9)


def test_the_upper_half_is_read_and_the_caller_keeps_the_matrices():
    J, d = information(12, 12, 3)
    before = J.copy()
    upper = np.triu(J)
    np.testing.assert_array_equal(Tridiagonal.of(upper, d).own, Tridiagonal.of(J, d).own)
    np.testing.assert_array_equal(J, before)


def test_noise_that_nothing_pulls_at_only_costs():
    J, _ = information(9, 9, 5)
    gain = Tridiagonal.of(J, np.zeros(9)).gain(np.array([0.0, 1.0, 10.0]))
    assert gain[0] == 0.0
    assert gain[2] < gain[1] < 0.0


def test_information_that_is_negative_by_rounding_is_none():
    """What coefficients take up leaves differences of large numbers."""
    J, d = information(30, 5, 11)
    gain = Tridiagonal.of(J - 1e-7 * np.eye(30), d).gain(np.logspace(0.0, 9.0, 10))
    assert np.isfinite(gain).all()


def test_no_modes_are_no_noise():
    """As of a kind that no stretch shows: drawn in turns, where none is."""
    chain = Tridiagonal.of(np.zeros((0, 0)), np.zeros(0))
    assert len(chain.own) == len(chain.gain(np.empty(0))) == 0
