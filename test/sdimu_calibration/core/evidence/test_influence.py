"""The influence of a stop is the change of the least squares when its rows are struck out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from sdimu_calibration.core.evidence.influence import influence

STOPS, ROWS, COEFFICIENTS = 5, 12, 4


def drawn(seed, outlier=0.0):
    """Rows of five stops, of which the third may be off by `outlier` sigma; one parameter more than is reported."""
    rng = np.random.default_rng(seed)
    stop = np.repeat(np.arange(STOPS), ROWS)
    W = rng.standard_normal((STOPS * ROWS, COEFFICIENTS + 1)) * np.array([1.0, 1e-3, 1e3, 1.0, 1.0])
    e = rng.standard_normal(len(stop)) + outlier * (stop == 2) * W[:, 0]
    weight, shift = np.array([0.1, 1e-8, 1e4, 0.1, 0.1]), rng.standard_normal(COEFFICIENTS + 1)
    return SimpleNamespace(W=W, e=e, stop=stop, weight=weight, shift=shift, coefficients=COEFFICIENTS)


def estimated(evidence, rows):
    J = evidence.W[rows].T @ evidence.W[rows] + np.diag(evidence.weight)
    d = evidence.W[rows].T @ evidence.e[rows] + evidence.weight * evidence.shift
    return np.linalg.inv(J) @ d, np.sqrt(np.diag(np.linalg.inv(J)))


def test_it_is_the_difference_to_a_fit_without_the_stop():
    evidence = drawn(1)
    stops, moved = influence(evidence)
    np.testing.assert_array_equal(stops, np.arange(STOPS))
    whole, sigma = estimated(evidence, np.ones(len(evidence.e), dtype=bool))
    for stop in range(STOPS):
        without, _ = estimated(evidence, evidence.stop != stop)
        np.testing.assert_allclose(moved[stop], ((without - whole) / sigma)[:COEFFICIENTS], atol=1e-8)


def test_a_stop_that_contradicts_the_others_stands_out_in_the_coefficient_that_it_moves():
    _, moved = influence(drawn(2, outlier=3.0))
    worst = np.unravel_index(np.argmax(np.abs(moved)), moved.shape)
    assert worst == (2, 0)
    assert abs(moved[2, 0]) > 3.0
