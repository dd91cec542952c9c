"""Compressed rows say the same of the parameters as all rows."""

import numpy as np
import pytest

from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint import reduction as room
from sdimu_calibration.core.joint.reduction import compressed, unit_noise

UNITS = np.array([1e-7, 1e-4, 1.0, 30.0, 1e5])


@pytest.mark.parametrize("seed", range(20))
def test_compressed_rows_hold_all_information(seed):
    rng = np.random.default_rng(seed)
    W, e = rng.normal(size=(200, 5)) / UNITS, rng.normal(size=200)
    A, y = compressed(W, e)
    assert A.shape == (5, 5)
    scale = np.outer(UNITS, UNITS)
    np.testing.assert_allclose((A.T @ A) * scale, (W.T @ W) * scale, atol=1e-9)
    np.testing.assert_allclose((A.T @ y) * UNITS, (W.T @ e) * UNITS, atol=1e-9)
    best, *_ = np.linalg.lstsq(W, e, rcond=None)
    left = e - W @ best
    assert e @ e - y @ y == pytest.approx(left @ left, rel=1e-9)


def test_columns_that_are_one_give_one_row():
    rng = np.random.default_rng(1)
    a = rng.normal(size=(50, 1))
    A, y = compressed(np.hstack([a, 2.0 * a, np.zeros_like(a)]), rng.normal(size=50))
    assert A.shape == (1, 3)
    assert y.shape == (1,)
    assert A[0, 1] == pytest.approx(2.0 * A[0, 0])
    assert A[0, 2] == 0.0


@pytest.mark.parametrize("seed", range(10))
def test_noise_with_a_memory_is_whitened_by_its_covariance(seed):
    rng = np.random.default_rng(seed)
    modes, W = rng.normal(size=(40, 3)) * 2.0, rng.normal(size=(40, 4))
    S = np.eye(40) + modes @ modes.T
    white = unit_noise(InStops.of(modes, np.arange(40) // 10), W)
    np.testing.assert_allclose(white.T @ white, W.T @ np.linalg.solve(S, W), atol=1e-10)


@pytest.mark.parametrize("seed", range(10))
def test_what_is_of_the_recording_alone_is_estimated_along(seed):
    rng = np.random.default_rng(seed)
    W, e = rng.normal(size=(60, 6)), rng.normal(size=60)
    p, weight, shift = 3, np.array([0.5, 2.0]), np.array([0.3, -0.7])
    # Columns 3 and 4 are of the recording alone; 5 is a candidate.
    rows = room._without(np.column_stack([W, e]), p, weight, shift)
    d = W.T @ e
    d[3:5] += weight * shift
    given = Information(W.T @ W, d).given(np.array([3, 4]), weight)
    kept = [0, 1, 2, 5]
    np.testing.assert_allclose(rows[:, :-1].T @ rows[:, :-1], given.J[np.ix_(kept, kept)], atol=1e-10)
    np.testing.assert_allclose(rows[:, :-1].T @ rows[:, -1], given.d[kept], atol=1e-10)


def test_a_row_that_tells_nothing_beside_the_priors_is_left_out():
    # Gravity and a common scale factor: one column but for 2e-6 of it, priors of a thousand sigma.
    A, y, weight = np.array([[1.0, 1.0], [1e-6, -1e-6]]), np.array([5.0, 4.0]), np.array([1e-6, 1e-6])
    rows, values = room._telling(A, y, weight)
    np.testing.assert_array_equal(rows, A[:1])
    np.testing.assert_array_equal(values, y[:1])
    # With priors ten thousand times as wide it tells something, and so it may of a third parameter.
    assert len(room._telling(A, y, weight * 1e-8)[1]) == 2
    assert len(room._telling(np.column_stack([A, [0.0, 1e-6]]), y, weight)[1]) == 2
