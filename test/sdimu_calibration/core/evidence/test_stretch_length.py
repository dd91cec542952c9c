"""Stretches are short enough for the noise that is in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects.effect import Timetable
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.inner_noise import InnerNoise
from sdimu_calibration.core.evidence.noise_kernels import stretches
from sdimu_calibration.core.evidence.stretch_length import held, moves_within, wander_in
from sdimu_calibration.core.evidence.wander import Wander, between_halves
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.worlds import simulated_test


class Ideal:
    """Evidence of a sensor that measures the mean of each second with white noise of one: 1200 s at rest."""

    inner = row_times = None

    def __init__(self, e: np.ndarray | None = None) -> None:
        self.e = np.zeros(7200) if e is None else e
        self.stop = np.repeat(np.arange(10), 720)
        self.times = Timetable(1200.0, tuple((k, 120.0 * k, 120.0 * k + 120.0) for k in range(10)), ())

    def conditions(self, _cut):
        return None

    def constant_signature(self, cut):
        t = np.arange(0.5, 1200.0)
        inside = (t[:, None] > cut.start) & (t[:, None] < cut.end)
        return np.kron(inside, np.eye(6))


class Tilting(Ideal):
    """The same of which each rest has a tilt that is free."""

    def constant_signature(self, cut):
        U = super().constant_signature(cut).astype(float)
        for k in range(10):
            own = np.kron((np.arange(1200) // 120 == k).astype(float)[:, None], np.eye(6)[:, 3:])
            U -= own @ np.linalg.lstsq(own, U, rcond=None)[0]
        return U


def test_a_half_moves_against_the_other_by_the_allan_variance():
    """IEEE Std 952, annex C: K^2 t / 3 for a random walk, (2 ln 2 / pi) B^2 for flicker; twice that of halves of 15 s.

    Time constants below 1/4 s are left to white noise: it takes B^2 / (15 pi), their density at zero. White
    noise of one in each second gives the difference of two means of 15 s the variance 2 / 15.
    """
    wander = Wander.of(Ideal())
    walk, flicker = NoiseTerm("gyro", "random_walk", size=0.1), NoiseTerm("accel", "flicker", size=0.5)
    assert moves_within(wander, [walk]) == pytest.approx(0.01 * 15.0 / 3.0 * 15.0, rel=1e-6)
    expected = 0.25 * (4.0 * np.log(2.0) - 1.0 / 15.0) / np.pi
    assert moves_within(wander, [flicker]) == pytest.approx(expected * 15.0 / 2.0, rel=0.02)
    # Each triad against its own white noise: the one that moves most counts.
    assert moves_within(wander, [walk, flicker]) == pytest.approx(moves_within(wander, [flicker]))
    assert moves_within(wander, []) == 0.0
    turning = replace(wander, cut=replace(wander.cut, turning=np.ones(40, dtype=bool)))
    assert moves_within(turning, [walk]) == 0.0
    assert moves_within(wander, [NoiseTerm("gyro", "stop", size=9.0)]) == pytest.approx(0.0, abs=1e-9)


def test_what_a_tilt_takes_of_the_mean_hides_no_movement():
    """The mean of an accelerometer over a stretch is a tilt; the difference of its halves is none."""

    walk = NoiseTerm("accel", "random_walk", size=0.1)
    assert moves_within(Wander.of(Tilting()), [walk]) == pytest.approx(moves_within(Wander.of(Ideal()), [walk]))


def test_rows_are_whitened_anew_where_the_noise_that_stands_moves_otherwise():
    plain, wide = Wander.of(Ideal()), NoiseTerm("gyro", "flicker", size=1.0)
    weak = replace(wide, size=0.1)
    assert moves_within(plain, [weak]) < 0.5 < moves_within(plain, [wide])
    assert held(plain, [weak])
    assert held(plain, [])
    assert not held(plain, [wide])
    whitened = replace(plain, inner=InnerNoise((), (wide,)))
    assert held(whitened, [wide])
    assert held(whitened, [replace(wide, size=1.3)])
    some = replace(wide, size=0.35)
    assert 0.5 < moves_within(plain, [some]) < 1.0
    assert not held(plain, [some])
    assert not held(replace(plain, inner=InnerNoise((), (some,))), [])
    # An effect took the place of most of it, or of all.
    assert not held(whitened, [replace(wide, size=0.6)])
    assert not held(whitened, [])


@pytest.mark.parametrize("kind", [Ideal, Tilting])
@pytest.mark.parametrize("size", [0.0, 0.1])
def test_halves_differ_by_their_white_noise_and_what_moves(kind, size):
    """Of 60 tests the mean square of twelve differences each."""
    rng = np.random.default_rng(31)
    one = kind()
    cut, moved, known = stretches(one.times), [], []
    # The signature of the halves takes most of the time, and is the same each time.
    of = one.constant_signature
    one.constant_signature = lambda halves: known[0] if known else known.append(of(halves)) or known[0]
    for _ in range(60):
        walk = np.cumsum(size * rng.standard_normal((1200, 6)), axis=0)
        one.e = (walk + rng.standard_normal((1200, 6))).ravel()
        moved.append(between_halves(one, cut)[1])
    terms = [NoiseTerm("accel", "random_walk", size=size)] if size else []
    expected = 1.0 + moves_within(Wander.of(kind()), terms)
    scatter = expected * np.sqrt(2.0 / 12.0 / 60.0)
    assert np.abs(np.mean(moved, axis=0) - expected).max() < 4.0 * scatter


def test_stretches_are_halved_where_noise_moves_within_them():
    few, many = (len(stretches(Ideal().times, share)) for share in (1.0, 0.5))
    assert (few, many) == (40, 80)
    assert len(wander_in(Ideal(), [NoiseTerm("gyro", "flicker", size=0.1)]).cut) == few
    assert len(wander_in(Ideal(), [NoiseTerm("gyro", "flicker", size=1.0)]).cut) == many


@pytest.mark.slow
def test_a_test_in_strong_flicker_is_cut_finer_and_one_in_white_noise_is_not():
    imu, model, site = load_imu("mems_industrial"), load_model("baseline"), Site(0.6, 0.0)
    counts = []
    for noise in ((), ("gyro_noise_flicker=6 deg/h", "accel_noise_flicker=70 ug")):
        test, _ = simulated_test("mems_industrial", imu, "recommended", site, 8, (), noise)
        fit = solve(test, model, learn=False)
        times = fit.evidence().times
        counts.append((len(fit.wander.cut), len(stretches(times)), len(stretches(times, 0.5))))
    (white, usual, _), (flicker, _, finer) = counts
    assert (white, flicker) == (usual, finer)
