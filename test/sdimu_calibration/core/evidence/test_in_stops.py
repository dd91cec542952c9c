"""Columns of few directions in each stop: the products of the dense matrix, in the number of directions."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.inner_noise import InnerNoise, _Part

ROWS, DIRECTIONS = (50, 70, 5, 200), (3, 60, 5, 0)
STOP = np.repeat([2, 3, 5, 8], ROWS)


@pytest.fixture(scope="module")
def dense():
    """Columns of very different units with some directions in each stop, and none in the last one."""
    rng = np.random.default_rng(4)
    parts = [rng.standard_normal((n, m)) @ rng.standard_normal((m, 90)) for n, m in zip(ROWS, DIRECTIONS, strict=True)]
    return np.vstack(parts) * np.logspace(-4, 6, 90)


@pytest.fixture(scope="module")
def sparse(dense):
    return InStops.of(dense, STOP)


def test_each_stop_has_its_directions_and_the_columns_come_back(dense, sparse):
    assert [Q.shape[1] for Q in sparse.directions] == list(DIRECTIONS)
    assert sparse.stops.tolist() == [2, 3, 5, 8]
    np.testing.assert_allclose(sparse.spread(sparse.parts), dense, atol=1e-9 * np.abs(dense).max(axis=0).min())
    for Q in sparse.directions:
        np.testing.assert_allclose(Q.T @ Q, np.eye(Q.shape[1]), atol=1e-12)


def test_products_are_those_of_the_dense_matrix(dense, sparse):
    rng, unit = np.random.default_rng(9), 1.0 / np.linalg.norm(dense, axis=0)
    W, weights = rng.standard_normal((len(dense), 4)), rng.standard_normal((90, 7)) * unit[:, None]
    np.testing.assert_allclose(sparse.square * np.outer(unit, unit), (dense * unit).T @ (dense * unit), atol=1e-10)
    np.testing.assert_allclose(sparse.across(W) * unit, W.T @ dense * unit, atol=1e-10)
    np.testing.assert_allclose(sparse.times(weights), dense @ weights, atol=1e-10)
    np.testing.assert_allclose(sparse.combined(weights).times(np.eye(7)), dense @ weights, atol=1e-10)
    some = np.arange(90) % 3 == 0
    np.testing.assert_allclose(sparse.only(some).across(W) * unit[some], W.T @ dense[:, some] * unit[some], atol=1e-10)


def test_columns_beside_others_bring_the_directions_that_are_new(dense, sparse):
    rng = np.random.default_rng(11)
    known, fresh = dense[:, :1] * 3.0, np.zeros((len(dense), 1))
    fresh[STOP == 8, 0] = rng.standard_normal(200)
    wider = sparse.beside(np.hstack([known, fresh]))
    assert [Q.shape[1] for Q in wider.directions] == [3, 60, 5, 1]
    every = np.hstack([dense, known, fresh])
    unit = 1.0 / np.linalg.norm(every, axis=0)
    np.testing.assert_allclose(wider.square * np.outer(unit, unit), (every * unit).T @ (every * unit), atol=1e-10)


@pytest.mark.parametrize("weak", [1e-7, 3e-9, 1e-9, 3e-10, 1e-11, 1e-13])
def test_directions_of_any_weakness_stay_orthonormal(weak):
    rng = np.random.default_rng(5)
    strong = rng.standard_normal((300, 60)) @ rng.standard_normal((60, 200))
    columns = strong + weak * rng.standard_normal((300, 40)) @ rng.standard_normal((40, 200))
    found = InStops.of(columns, np.zeros(300, dtype=np.int64))
    Q = found.directions[0]
    np.testing.assert_allclose(Q.T @ Q, np.eye(Q.shape[1]), atol=1e-12)
    length = np.linalg.norm(columns, axis=0)
    assert np.abs((found.spread(found.parts) - columns) / length).max() < 2e-8
    square = columns.T @ columns
    np.testing.assert_allclose(found.square, square, atol=1e-14 * np.abs(square).max())


def test_none_is_a_matrix_of_no_columns():
    none = InStops.none(STOP)
    assert none.square.shape == (0, 0)
    assert none.across(np.ones((len(STOP), 2))).shape == (2, 0)
    assert none.beside(np.ones((len(STOP), 1))).square == pytest.approx(len(STOP))


def test_whitening_is_that_of_the_dense_matrix(dense, sparse):
    rng = np.random.default_rng(2)
    parts = []
    for rows in (slice(0, 30), slice(30, 50), slice(60, 100)):
        Q = np.linalg.qr(rng.standard_normal((rows.stop - rows.start, 4)))[0]
        parts.append(_Part(rows, Q, np.array([0.9, 0.5, 0.2, 0.0])))
    inner, unit = InnerNoise(tuple(parts)), 1.0 / np.linalg.norm(dense, axis=0)
    white = sparse.whitened(inner)
    np.testing.assert_allclose(white.spread(white.parts) * unit, inner.whitened(dense) * unit, atol=1e-10)
    for Q in white.directions:
        np.testing.assert_allclose(Q.T @ Q, np.eye(Q.shape[1]), atol=1e-12)


def test_a_rest_that_two_stops_share_is_whitened_as_one(dense, sparse):
    Q = np.linalg.qr(np.random.default_rng(2).standard_normal((10, 2)))[0]
    inner, unit = InnerNoise((_Part(slice(45, 55), Q, np.array([0.9, 0.5])),)), 1.0 / np.linalg.norm(dense, axis=0)
    white = sparse.whitened(inner)
    np.testing.assert_allclose(white.spread(white.parts) * unit, inner.whitened(dense) * unit, atol=1e-9)


def test_a_column_that_is_not_finite_is_refused(dense):
    columns = dense.copy()
    columns[3, 1] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        InStops.of(columns, STOP)


def test_no_rows_have_no_directions():
    empty = InStops.of(np.zeros((0, 3)), np.zeros(0, dtype=np.int64))
    assert empty.square.shape == (3, 3)
    assert empty.whitened(InnerNoise(())).parts.shape == (0, 3)
