"""Jitter of a driver leaves the stamps, gaps and slow drift of the clock stay; what cannot be told is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data.dejitter import dejittered
from sdimu_calibration.core.note import Topic, topic_of
from sdimu_calibration.core.recording import Recording

N, DT = 20_000, 0.01


def recording(t) -> Recording:
    return Recording(0, np.asarray(t), np.zeros((len(t), 3)), np.tile([0.0, 0.0, -9.8], (len(t), 1)))


@pytest.mark.parametrize("seed", range(5))
def test_jitter_is_taken_away_and_gaps_and_drift_stay(seed):
    rng = np.random.default_rng(seed)
    true = np.arange(1, N + 1) * DT
    true = np.delete(true, slice(5000, 5300))
    true = true + 1e-3 * np.sin(2.0 * np.pi * true / 200.0) + 1e-5 * true
    found = dejittered(recording(true + rng.uniform(-1e-3, 1e-3, len(true))))
    assert "jitter" in found.notes[0]
    assert topic_of(found.notes[0]) == Topic.JITTER
    error = found.t - true
    # A mean over 4000 samples leaves a sixtieth of the jitter (0.6 ms rms); at the ends fewer can be averaged.
    inside = slice(3000, -3000)
    assert np.sqrt(np.mean(error[inside] ** 2)) < 0.6e-3 / 10.0
    assert np.diff(found.t)[4999] > 300 * DT - 2e-3


def test_even_stamps_are_not_touched():
    r = recording(np.round(np.arange(1, N + 1) * DT, 9))
    assert dejittered(r) is r
    gap = replace(r, t=np.where(r.t > 50.0, r.t + 3.0, r.t))
    assert dejittered(gap) is gap


def test_jitter_that_hides_missing_samples_is_told_and_left():
    rng = np.random.default_rng(9)
    t = np.sort(np.arange(1, N + 1) * DT + rng.uniform(-0.6 * DT, 0.6 * DT, N))
    r = recording(t)
    found = dejittered(r)
    assert np.array_equal(found.t, r.t)
    assert "stay as they are" in found.notes[0]


def turning(t, sampled_at) -> Recording:
    """A recording of turns that begin and end every ten seconds, with noise of a hundredth of a degree a second."""
    rate = np.radians(10.0) * np.clip(5.0 * np.sin(0.2 * np.pi * sampled_at), -1.0, 1.0)
    noise = np.radians(0.01) * np.random.default_rng(3).standard_normal((len(t), 3))
    omega = np.outer(rate, [0.6, -0.48, 0.64]) + noise
    return replace(recording(t), omega_ib_b=omega)


@pytest.mark.parametrize("seed", range(3))
def test_jitter_beyond_a_quarter_is_taken_away_where_rates_follow_an_even_clock(seed):
    rng = np.random.default_rng(seed)
    true = np.delete(np.arange(1, N + 1) * DT, slice(5000, 5003))
    jitter = rng.normal(0.0, 0.075 * DT, len(true))
    assert np.abs(jitter).max() > 0.25 * DT
    found = dejittered(turning(true + jitter, true))
    assert "follow an even clock" in found.notes[0]
    error = (found.t - true)[3000:-3000]
    # A mean over 4000 samples leaves a sixtieth of the jitter; neighbours share it.
    assert np.sqrt(np.mean(error**2)) < 0.075 * DT / 10.0
    assert np.diff(found.t)[4999] == pytest.approx(4.0 * DT, abs=0.1 * DT)


def test_stamps_that_the_rates_follow_are_kept():
    t = np.arange(1, N + 1) * DT + np.random.default_rng(4).normal(0.0, 0.075 * DT, N)
    uneven = turning(t, t)
    found = dejittered(uneven)
    assert np.array_equal(found.t, t)
    assert "stay as they are" in found.notes[0]


def test_large_jitter_without_turns_is_left_alone():
    t = np.arange(1, N + 1) * DT + np.random.default_rng(5).normal(0.0, 0.075 * DT, N)
    found = dejittered(recording(t))
    assert np.array_equal(found.t, t)
    assert "stay as they are" in found.notes[0]


def test_jitter_that_comes_in_waves_is_no_delay_of_a_host():
    rng = np.random.default_rng(6)
    true = np.arange(1, N + 1) * DT
    wave = np.convolve(rng.normal(0.0, 0.2 * DT, N + 9), np.ones(10) / 10.0, mode="valid")
    found = dejittered(turning(true + np.clip(wave, -0.45 * DT, 0.45 * DT), true))
    assert np.abs(wave).max() > 0.25 * DT or "samples are taken as even" in found.notes[0]
    assert "follow an even clock" not in found.notes[0]
