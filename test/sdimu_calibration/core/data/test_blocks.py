"""A long recording in pieces is the same recording, to the last bit."""

from __future__ import annotations

import mmap
from tempfile import TemporaryFile

import numpy as np
import pytest

from sdimu_calibration.core.data import blocks
from sdimu_calibration.core.data.blocks import all_finite, ascending, let_go, median_length
from sdimu_calibration.core.data.sample_screening import _bend, _bends, _changing_rate, _roughness
from sdimu_calibration.core.data.windows import cut_windows

COUNT = 2500


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    """Cut even these short arrays."""
    monkeypatch.setattr(blocks, "BLOCK", 300)


@pytest.fixture
def x() -> np.ndarray:
    return np.random.default_rng(3).standard_normal((COUNT, 3)) + np.array([0.0, 0.0, 9.8])


def test_medians_and_checks_are_those_of_the_whole_array(x):
    assert median_length(x) == float(np.median(np.linalg.norm(x, axis=1)))
    assert all_finite(x)
    for k in (0, 299, 300, COUNT - 1):
        broken = x.copy()
        broken[k, 1] = np.inf
        assert not all_finite(broken)
    ns = np.arange(COUNT)
    assert ascending(ns)
    for k in (1, 299, 300, COUNT - 1):
        assert not ascending(np.where(np.arange(COUNT) == k, ns[k - 1], ns))


def test_screening_in_blocks_is_screening_of_all(x):
    column, uneven = np.ascontiguousarray(x[:, 0]), np.zeros(COUNT, dtype=bool)
    uneven[[0, 1, 700, -2, -1]] = True
    np.testing.assert_array_equal(_bends(column)[1:-1], _bend(column))
    fourth = np.zeros(COUNT)
    y = column
    fourth[2:-2] = y[:-4] - 4.0 * y[1:-3] + 6.0 * y[2:-2] - 4.0 * y[3:-1] + y[4:]
    fourth[uneven] = np.nan
    each = [np.nanmedian(np.abs(fourth[20 * k : 20 * k + 20])) for k in range(COUNT // 20)]
    np.testing.assert_array_equal(_roughness(column, uneven, COUNT // 20), each)


def test_a_turn_begins_where_the_rate_leaves_one_side_of_its_edge(x):
    rate = 1e-5 * x[:, [0, 1, 1]]
    rate[1010:1030, 1] += np.linspace(0.0, 0.1, 20)
    moving = _changing_rate(rate.reshape(-1, 20, 3))
    assert set(np.flatnonzero(moving)) >= {50, 51}
    assert np.count_nonzero(moving) < 10


def test_windows_have_the_means_of_their_samples(x):
    t = 0.01 * np.arange(1, COUNT + 1)
    windows = cut_windows(t, x, 2.0 * x)
    rows = [slice(first, first + windows.length) for first in windows.first]
    np.testing.assert_allclose(windows.w_mean, [x[r].mean(axis=0) for r in rows], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(windows.f_mean, [2.0 * x[r].mean(axis=0) for r in rows], rtol=0.0, atol=1e-12)


def test_what_is_let_go_is_read_again(x):
    with TemporaryFile() as file:
        file.write(x.data)
        file.flush()
        mapped = np.frombuffer(mmap.mmap(file.fileno(), 0)).reshape(-1, 3)
    mapped[5] = 7.0  # a change of the numbers stays, too
    let_go(mapped, x[3:])
    np.testing.assert_array_equal(np.delete(mapped, 5, axis=0), np.delete(x, 5, axis=0))
    np.testing.assert_array_equal(mapped[5], 7.0)
