"""White noise is told right beside noise with a memory that makes neighbouring seconds differ more."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.white_noise import without_memory
from sdimu_calibration.core.evidence.consistency import NO_NOISE, Consistency, Noise
from sdimu_calibration.core.noise_term import FLICKER, MARKOV, RANDOM_WALK, SHIFT, STOP, NoiseTerm
from sdimu_calibration.storage.files.config import load_imu

IMU = load_imu("mems_consumer")
N = IMU.gyro_white_noise
RATE = 20
SECONDS = 40_000
"""Length of the series (s): the ratio of two standard deviations is known to 0.7 %."""


def consistency(noise: Noise) -> Consistency:
    return Consistency(1.0, 0.5, 1.0, 0.5, noise, NO_NOISE, ())


def markov(tau: float, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Sampled exactly."""
    decay = np.exp(-1.0 / (RATE * tau))
    out = np.empty(RATE * SECONDS)
    x = sigma * rng.standard_normal()
    kick = sigma * np.sqrt(1.0 - decay**2) * rng.standard_normal(len(out))
    for i, k in enumerate(kick.tolist()):
        x = decay * x + k
        out[i] = x
    return out


def wander(kind: str, size: float, rng: np.random.Generator) -> np.ndarray:
    if kind == MARKOV:
        return markov(5.0, size, rng)
    if kind == RANDOM_WALK:
        return np.asarray(np.cumsum(size * rng.standard_normal(RATE * SECONDS) / np.sqrt(RATE)))
    # Density B^2/(2 pi f), shaped in the spectrum; slower than 4 s all of it, as the learned noise has it.
    f = np.fft.rfftfreq(RATE * SECONDS, 1.0 / RATE)
    spectrum = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    shape = np.zeros(len(f))
    shape[1:] = np.sqrt(1.0 / (2.0 * np.pi * f[1:]))
    return np.asarray(np.fft.irfft(spectrum * shape * size * np.sqrt(RATE * RATE * SECONDS / 4.0)))


@pytest.mark.parametrize(
    ("kind", "share", "allowed"), [(MARKOV, 2.0, 0.03), (RANDOM_WALK, 1.0, 0.03), (FLICKER, 1.0, 0.1)]
)
def test_the_ratio_of_the_white_noise_is_one(kind, share, allowed):
    """Flicker is learned as Markov terms of 2 s and more, so a part of what is faster stays with the white noise."""
    rng = np.random.default_rng(3)
    size = share * N
    series = N * np.sqrt(RATE) * rng.standard_normal(RATE * SECONDS) + wander(kind, size, rng)
    difference = np.diff(series.reshape(SECONDS, RATE).mean(axis=1)) / (N * np.sqrt(2.0))
    ratio = float(np.sqrt(np.mean(difference**2)))
    assert ratio > 1.05
    term = NoiseTerm("gyro", kind, 5.0 if kind == MARKOV else 0.0, size, 0.9 * size, 1.1 * size)
    measured = consistency(Noise(ratio, 0.01, ratio, 3.0, np.empty(0, dtype=np.int64)))
    found = without_memory(measured, [term], IMU)
    assert found.gyro.ratio == pytest.approx(1.0, abs=allowed)
    assert found.gyro.spread == found.gyro.ratio
    assert found.gyro.sigma > 0.01
    assert found.accel is NO_NOISE


def test_what_does_not_change_within_a_dwell_takes_nothing():
    measured = consistency(Noise(1.3, 0.01, 1.3, 3.0, np.empty(0, dtype=np.int64)))
    drawn = NoiseTerm("gyro", STOP, 0.0, N, 0.9 * N, 1.1 * N)
    assert without_memory(measured, [drawn], IMU) == measured
    other = NoiseTerm("accel", MARKOV, 5.0, 1.0, 0.9, 1.1)
    assert without_memory(measured, [other], IMU).gyro == measured.gyro


def test_a_draw_that_a_wander_resembles_hides_no_cause():
    assert NoiseTerm("gyro", SHIFT).is_drawn
    assert NoiseTerm("gyro", SHIFT, alike=(STOP,)).is_drawn
    assert not NoiseTerm("gyro", SHIFT, alike=(RANDOM_WALK,)).is_drawn
    assert not NoiseTerm("gyro", MARKOV).is_drawn
