"""Stops predicted from the others: in the number of rows or of parameters, the same prediction."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.evidence.held_out import _Normal


@pytest.fixture(scope="module")
def fitted() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    W = rng.standard_normal((60, 25)) * np.logspace(-6, 6, 25)
    return W, rng.standard_normal(60), np.logspace(-10, 10, 25), rng.standard_normal(25) * np.logspace(4, -6, 25)


def predicted(fitted, rows):
    """Prediction written down from its definition: a fit to the other rows, and the covariance of its error."""
    W, e, weight, shift = fitted
    unit = 1.0 / np.sqrt(np.diag(W.T @ W) + weight)
    A = (np.delete(W, rows, axis=0).T @ np.delete(W, rows, axis=0) + np.diag(weight)) * np.outer(unit, unit)
    b = (np.delete(W, rows, axis=0).T @ np.delete(e, rows) + weight * shift) * unit
    error = e[rows] - W[rows] @ (unit * np.linalg.solve(A, b))
    S = np.eye(len(rows)) + (W[rows] * unit) @ np.linalg.solve(A, (W[rows] * unit).T)
    return error, -0.5 * (error @ np.linalg.solve(S, error) + np.linalg.slogdet(S)[1]), np.diag(S)


@pytest.mark.parametrize("number", [1, 8, 24, 25, 30, 34])
def test_rows_left_out_are_predicted_from_the_others(fitted, number):
    W, e, weight, shift = fitted
    rows = np.arange(10, 10 + number)
    normal, left_out = _Normal(W, e, weight, shift), np.isin(np.arange(len(e)), rows)
    every = [normal.without(left_out), normal._by_parameters(left_out), normal._anew(W[rows], e[rows])]
    for told in every:
        for mine, true in zip(told, predicted(fitted, rows), strict=True):
            assert mine == pytest.approx(true, rel=1e-6)


def test_a_row_that_alone_tells_of_a_parameter_is_predicted_as_badly_as_its_prior_says(fitted):
    W, e, weight, shift = fitted
    alone = np.zeros((61, 26))
    alone[:60, :25], alone[60, 25] = W, 1e5
    weight, shift = np.append(weight, 1.0), np.append(shift, 0.0)
    e = np.append(e, 3.0)
    normal, left_out = _Normal(alone, e, weight, shift), np.arange(61) == 60
    assert normal._by_rows(left_out) is None
    assert normal._by_parameters(left_out) is None
    error, score, spread = normal.without(left_out)
    assert error == pytest.approx([3.0])
    assert spread == pytest.approx([1.0 + 1e10])
    assert score == pytest.approx(-0.5 * np.log(1e10), rel=1e-6)
