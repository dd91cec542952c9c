"""Stops predicted from the others: from the fit to all rows and from that to the others, the same prediction."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.evidence.held_out import _Normal
from sdimu_calibration.core.evidence.in_stops import InStops


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


def normal_of(W, e, weight, shift, rows):
    """Normal equations of a test with two stops, the second one of these rows."""
    stop = np.isin(np.arange(len(e)), rows).astype(np.int64)
    # Half of the columns stand beside those that are known, as a model stands beside noise.
    columns = InStops.of(W[:, :12], stop).beside(W[:, 12:])
    return _Normal.of(columns, e, weight, shift)


@pytest.mark.parametrize("number", [1, 8, 24, 25, 30, 34])
def test_rows_left_out_are_predicted_from_the_others(fitted, number, monkeypatch):
    rows = np.arange(10, 10 + number)
    normal = normal_of(*fitted, rows)
    assert normal._of_fit_to_all(1) is not None
    of_all = normal.without(1)
    monkeypatch.setattr(_Normal, "_of_fit_to_all", lambda *_: None)
    anew = normal_of(*fitted, rows).without(1)
    for told in (of_all, anew):
        for mine, true in zip(told, predicted(fitted, rows), strict=True):
            assert mine == pytest.approx(true, rel=1e-6)


def test_a_row_that_alone_tells_of_a_parameter_is_predicted_as_badly_as_its_prior_says(fitted):
    W, e, weight, shift = fitted
    alone = np.zeros((61, 26))
    alone[:60, :25], alone[60, 25] = W, 1e5
    weight, shift = np.append(weight, 1.0), np.append(shift, 0.0)
    e = np.append(e, 3.0)
    normal = normal_of(alone, e, weight, shift, [60])
    assert normal._of_fit_to_all(1) is None
    error, score, spread = normal.without(1)
    assert error == pytest.approx([3.0])
    assert spread == pytest.approx([1.0 + 1e10])
    assert score == pytest.approx(-0.5 * np.log(1e10), rel=1e-6)


def test_a_stop_that_tells_of_nothing_is_predicted_as_white_noise(fitted):
    W, e, weight, shift = fitted
    W = np.vstack([W, np.zeros((2, 25))])
    error, score, spread = normal_of(W, np.append(e, [2.0, -1.0]), weight, shift, [60, 61]).without(1)
    np.testing.assert_allclose(error, [2.0, -1.0])
    np.testing.assert_allclose(spread, 1.0)
    assert score == pytest.approx(-2.5)


@pytest.mark.parametrize("ratio", [1e5, 1e7, 1e8, 1e10])
def test_a_stop_that_alone_tells_of_two_parameters_is_predicted_as_badly_as_their_priors_say(ratio):
    rng = np.random.default_rng(3)
    stop = np.repeat([0, 1], 30)
    W, e = np.zeros((60, 3)), rng.standard_normal(60)
    W[:, 0], W[30:, 1:] = rng.standard_normal(60), ratio * rng.standard_normal((30, 2))
    normal = _Normal.of(InStops.of(W, stop), e, np.ones(3), np.zeros(3))
    _, score, _ = normal.without(1)
    # The two by themselves, known by their priors alone; the third by the first stop and its prior.
    spread = W[30:, 0] / np.sqrt(1.0 + W[:30, 0] @ W[:30, 0])
    mean = W[30:, 0] * (W[:30, 0] @ e[:30]) / (1.0 + W[:30, 0] @ W[:30, 0])
    Q, R = np.linalg.qr(W[30:, 1:])
    outside = np.linalg.qr(np.hstack([Q, np.eye(30)]))[0][:, 2:30].T
    # Where the two parameters are, nothing counts beside them; outside them there is the third alone.
    S = np.eye(28) + np.outer(outside @ spread, outside @ spread)
    error = outside @ (e[30:] - mean)
    right = -0.5 * (error @ np.linalg.solve(S, error) + np.linalg.slogdet(S)[1]) - np.log(np.abs(np.diag(R))).sum()
    assert score == pytest.approx(right, abs=1e-3)
