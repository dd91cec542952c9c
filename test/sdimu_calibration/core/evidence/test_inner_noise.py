"""Noise that moves within stretches: the covariance of its cosines, and rows that are whitened in it."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.evidence.inner_noise import _COSINES, _root, inner_noise
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.noise_term import FLICKER, RANDOM_WALK, NoiseTerm
from sdimu_sim.core.coloured import ColouredNoise

LENGTH_S, RATE_HZ = 50.0, 10.0


def test_cosines_have_the_covariance_of_simulated_noise():
    """The simulator makes flicker its own way: from it come the variances of the cosines of a stretch."""
    size, count = 2.0, 400
    per = int(LENGTH_S * RATE_HZ)
    out = np.zeros((6, per * count))
    ColouredNoise(["gyro_noise_flicker=2 rad/s"], 1.0 / RATE_HZ, 5).add(out, np.zeros(per * count, dtype=bool))
    noise = out[:3].reshape(3 * count, per)
    phase = (np.arange(per) + 0.5) / per
    wave = np.cos(np.pi * np.arange(1, _COSINES + 1)[:, None] * phase)
    drawn = noise @ wave.T * (2.0 / per)
    root = _root([NoiseTerm("gyro", FLICKER, 0.0, size)], "gyro", LENGTH_S, LENGTH_S * count)
    said = np.diag(root @ root.T)
    # Four standard deviations of a variance of 1200 draws, and a ripple of 2 % of either sum of Markov terms.
    assert drawn.var(axis=0) == pytest.approx(said, rel=4.0 * np.sqrt(2.0 / (3 * count)) + 0.04)


def test_whitening_takes_out_what_moves_within_a_stretch_and_leaves_the_rest():
    rng = np.random.default_rng(3)
    n = 40
    t = np.arange(1.0, n + 1.0)
    both = np.concatenate([t, n + t])
    cut = Stretches(np.array([0.0, n]), np.array([n, 2.0 * n]), np.array([0, 1]), np.array([False, True]))

    def signature(effects):
        out = np.zeros((2 * n, 6 * len(effects)))
        for k in range(len(effects)):
            out[:n, 6 * k + 1] = np.cos(np.pi * (k + 1) * (t - 0.5) / n)
        return out

    terms = [NoiseTerm("gyro", RANDOM_WALK, 0.0, 3.0)]
    inner = inner_noise(both, signature, cut, terms)
    root = _root(terms, "gyro", float(n), 2.0 * n)
    V = signature([None] * _COSINES)[:, 1::6] @ root
    e = rng.standard_normal((2 * n, 3))
    white = inner.whitened(e)
    S = np.eye(2 * n) + V @ V.T
    assert white.T @ white == pytest.approx(e.T @ np.linalg.solve(S, e))
    # No row of a turn is touched, nor what has no cosine in it.
    assert white[n:] == pytest.approx(e[n:])
    constant = np.concatenate([np.ones(n), np.zeros(n)])
    assert inner.whitened(constant) == pytest.approx(constant)
