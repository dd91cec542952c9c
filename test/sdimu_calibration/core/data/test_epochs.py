"""Epochs are whole seconds of the stamps' clock, and the place where an earlier call stopped leaves no trace."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sdimu_calibration.core.data.epochs import Epochs, cut
from sdimu_calibration.core.navigation.strapdown import Cycles, Reducer


def some_cycles(seed, n=1200, jitter=0.05):
    rng = np.random.default_rng(seed)
    t = np.arange(1, n + 1) * 0.01 + jitter * 0.01 * rng.uniform(-1, 1, n)
    omega = rng.standard_normal((n, 3)) * np.where(np.arange(n) % 400 < 200, 0.01, 2.0)[:, None]
    return Reducer(0.01).add(t, omega, rng.standard_normal((n, 3)))


def test_epochs_are_seconds():
    epochs = cut(some_cycles(1), 0.01)
    assert len(epochs) == 12
    np.testing.assert_allclose(epochs.end, np.arange(1, 13), rtol=0, atol=0.005)
    np.testing.assert_array_equal(epochs.start[1:], epochs.end[:-1])


@given(st.integers(0, 1000), st.lists(st.integers(1, 60), min_size=1, max_size=12))
def test_cutting_goes_on_where_it_stopped(seed, steps):
    cycles = some_cycles(seed)
    whole = cut(cycles, 0.01)
    at, waiting, parts = 0, cycles[0:0], []
    for step in [*steps, len(cycles)]:
        waiting = Cycles.concatenate([waiting, cycles[at : at + step]])
        at += step
        part = cut(waiting, 0.01)
        if len(part):
            parts.append(part)
            waiting = waiting[int(part.last[-1]) :]
    for name in set(Epochs.__dataclass_fields__) - {"first", "last"}:
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)


def test_means_and_peak_are_those_of_the_cycles():
    cycles = some_cycles(3)
    epochs = cut(cycles, 0.01)
    for e in range(len(epochs)):
        rows = slice(epochs.first[e], epochs.last[e])
        T = cycles.dt[rows].sum()
        np.testing.assert_allclose(epochs.f_mean[e], cycles.upsilon[rows].sum(axis=0) / T, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(epochs.w_mean[e], cycles.alpha[rows].sum(axis=0) / T, rtol=1e-12, atol=1e-12)
        rate = np.linalg.norm(cycles.alpha[rows] / cycles.dt[rows, None], axis=1)
        np.testing.assert_allclose(epochs.peak_rate[e], rate.max(), rtol=1e-12)
