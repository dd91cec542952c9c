"""Known noise is found again, with the scatter that is claimed; what lies between rests does not enter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.noise import allan, fit_terms, rests, white_noise
from sdimu_calibration.core.noise.terms import drawn
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording

DT = 0.05
N, K = 2e-3, 4e-4
SEEDS = 40


def white_and_walk(n: int, rng: np.random.Generator) -> np.ndarray:
    """Noise made by its definition, not by the code under test: sigma N of a 1 s mean, K of a step of 1 s."""
    return N / np.sqrt(DT) * rng.standard_normal(n) + K * np.sqrt(DT) * np.cumsum(rng.standard_normal(n))


@pytest.fixture(scope="module")
def fits():
    rng = np.random.default_rng(20)
    return [fit_terms(allan([white_and_walk(16_000, rng)], DT), rng, draws=8) for _ in range(SEEDS)]


@pytest.mark.parametrize(("term", "truth"), [(1, N), (3, K)])
def test_white_noise_and_random_walk_are_found_without_bias(fits, term, truth):
    found = np.array([fit.value[term] for fit in fits])
    assert abs(found.mean() - truth) < 4.0 * found.std(ddof=1) / np.sqrt(SEEDS)


@pytest.mark.parametrize(("term", "truth"), [(1, N), (3, K)])
def test_the_scatter_over_runs_is_the_sigma_claimed(fits, term, truth):
    z = np.array([(fit.value[term] - truth) / np.sqrt(np.mean([f.sigma[term] ** 2 for f in fits])) for fit in fits])
    # Chi-square of 40 runs: one sigma of the RMS is 1 / sqrt(80) = 0.11; three of them.
    assert 1.0 - 0.34 < np.sqrt(np.mean(z**2)) < 1.0 + 0.34


def test_terms_that_are_not_there_are_not_seen(fits):
    # Quantisation and flicker are absent: three sigma, themselves known to a quarter with 8 draws, are passed by few
    # (Gaussian at 2.25 sigma: 1.2 %; at most 4 of 80 has a chance below 1 %).
    seen = np.array([fit.seen for fit in fits])
    assert seen[:, 1].all()
    assert seen[:, [0, 2]].sum() <= 4


def test_quantisation_is_found():
    rng = np.random.default_rng(4)
    step = 5e-4
    found = []
    for _ in range(10):
        angle = np.cumsum(white_and_walk(8_000, rng)) * DT
        counted = np.diff(step * np.round(angle / step), prepend=0.0) / DT
        found.append(fit_terms(allan([counted], DT), rng, draws=4).value[0])
    # The error of rounding to a step is uniform: its sigma is the step over the root of 12.
    assert abs(np.mean(found) - step / np.sqrt(12.0)) < 4.0 * np.std(found, ddof=1) / np.sqrt(10) + 0.01 * step


def test_flicker_of_the_draws_has_the_allan_deviation_of_its_definition():
    rng = np.random.default_rng(9)
    deviations = [allan([drawn(np.array([0.0, 0.0, 1.0, 0.0]), 16_000, DT, rng)], DT) for _ in range(30)]
    flat = np.sqrt(2.0 * np.log(2.0) / np.pi)
    mean = np.sqrt(np.mean([d.deviation**2 for d in deviations], axis=0))
    middle = (deviations[0].tau > 1.0) & (deviations[0].tau < 40.0)
    # 30 runs, some tens of degrees of freedom each at these times: about 3 % at the longest.
    np.testing.assert_allclose(mean[middle], flat, rtol=0.12)


def test_a_jump_between_rests_does_not_enter():
    rng = np.random.default_rng(2)
    first, second = rng.standard_normal((2, 4_000))
    apart, moved = (allan([first, second + jump], DT) for jump in (0.0, 100.0))
    np.testing.assert_allclose(apart.deviation, moved.deviation, rtol=1e-9)
    own = [allan([stretch], DT).deviation ** 2 for stretch in (first, second)]
    np.testing.assert_allclose(apart.deviation[: len(own[0])] ** 2, np.mean(own, axis=0), rtol=1e-9)


def test_a_base_that_rocks_widens_the_terms_and_is_told():
    """A sine of half a hertz over white noise and flicker: the terms that stand under it are not accused."""
    rng = np.random.default_rng(12)
    t = np.arange(40_000) * DT
    quiet = white_and_walk(len(t), rng)
    rocking = quiet + 0.2 * np.sin(2.0 * np.pi * 0.05 * t)
    calm, fit = (fit_terms(allan([x], DT), np.random.default_rng(3), draws=8) for x in (quiet, rocking))
    assert calm.misfit == 0.0
    assert fit.misfit > 0.5
    assert fit.worst_ratio > 2.0
    # The peak of a sine is at 0.371 of its period.
    assert 0.5 < fit.worst_s / (0.371 / 0.05) < 2.0
    truth = np.array([0.0, N, 0.0, K])
    assert (fit.value - 4.0 * fit.sigma < truth + 1e-12).all()


def test_a_deviation_of_nothing_at_one_averaging_time_is_fitted():
    """A reading that toggles between two codes averages to the same at every even number of samples."""
    toggling = np.resize([0.0, 1e-4], 16_000)
    with np.errstate(divide="ignore"):
        found = fit_terms(allan([toggling], DT), np.random.default_rng(3), draws=4)
    assert np.isfinite(found.value).all()


def test_a_base_that_rocks_is_one_rest():
    rng = np.random.default_rng(1)
    n = round(400.0 / DT)
    t = np.arange(1, n + 1) * DT
    sway = np.radians(0.02) * np.sin(2.0 * np.pi * t / 11.0) * (1.0 + np.sin(2.0 * np.pi * t / 50.0))
    omega = 1e-5 * rng.standard_normal((n, 3)) + np.gradient(sway, DT)[:, None]
    force = 1e-3 * rng.standard_normal((n, 3)) + np.array([0.0, 0.0, -9.8])
    found = rests(Recording(0, t, omega, force))
    assert len(found) == 1
    # The recording begins and ends in the wildest part of the sway.
    assert found[0].stop - found[0].start > 0.85 * n


def recording(rng: np.random.Generator, status: bool = False, noise: float = 1.0) -> Recording:
    """Rest 60 s, turn 20 s at 2 deg/s about the vertical (the force does not change), rest 60 s."""
    n = round(140.0 / DT)
    t = np.arange(1, n + 1) * DT
    turning = (t > 60.0) & (t <= 80.0)
    omega = noise * 1e-4 * rng.standard_normal((n, 3)) + np.array([0.01, -0.02, 0.0])
    omega[:, 2] += np.where(turning, np.radians(2.0), 0.0)
    force = noise * 1e-3 * rng.standard_normal((n, 3)) + np.array([0.0, 0.0, -9.8])
    log = PhaseLog(np.array([0.0, 60.0, 80.0]), np.array([True, False, True]), np.array([0, 0, 1]))
    return Recording(0, t, omega, force, phase=log if status else None)


@pytest.mark.parametrize("status", [False, True])
def test_rests_are_found_and_turns_are_not_even_about_the_vertical(status):
    made = recording(np.random.default_rng(1), status)
    found = [(made.t[r.start], made.t[r.stop - 1]) for r in rests(made)]
    assert len(found) == 2
    for (begin, end), (first, last) in zip(found, ((0.0, 60.0), (80.0, 140.0)), strict=True):
        assert first < begin < first + 4.0
        assert last - 4.0 < end <= last


def test_a_gap_parts_a_rest():
    made = recording(np.random.default_rng(1))
    kept = np.r_[0:400, 460 : len(made.t)]
    cut = replace(made, t=made.t[kept], omega_ib_b=made.omega_ib_b[kept], f_ib_b=made.f_ib_b[kept])
    for r in rests(cut):
        assert np.diff(cut.t[r]).max() < 1.5 * DT


def test_a_recording_in_motion_has_no_rest():
    made = recording(np.random.default_rng(1))
    shaken = replace(made, omega_ib_b=made.omega_ib_b + np.sin(0.7 * made.t)[:, None])
    with pytest.raises(DataError, match="no rest"):
        rests(shaken)


def test_a_stuck_sensor_is_named():
    made = recording(np.random.default_rng(1))
    made.f_ib_b[:, 1] = 0.5
    with pytest.raises(DataError, match="accelerometer y does not scatter"):
        white_noise(made)


def test_white_noise_is_found_with_the_error_claimed():
    z = []
    for seed in range(SEEDS):
        found = white_noise(recording(np.random.default_rng(seed)))
        for value, sigma, truth in (
            (found.gyro, found.gyro_sigma, 1e-4 * np.sqrt(DT)),
            (found.accel, found.accel_sigma, 1e-3 * np.sqrt(DT)),
        ):
            z.append((value - truth) / sigma)
    # 80 numbers: one sigma of their RMS is 0.08, of their mean 0.11; three and four of them.
    assert 0.76 < np.sqrt(np.mean(np.square(z))) < 1.24
    assert abs(np.mean(z)) < 0.44
