"""Prior of noise that all recordings of a set may have alike, against integration by quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from sdimu_calibration.core.joint.unit_noise import log_prior_of_set
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel, log_odds, usual_sizes
from sdimu_calibration.storage.files.config import load_imu

USUAL = usual_sizes(load_imu("mems_industrial"))


def having(size, width, kind="flicker", tau=0.0):
    """Noise of a recording whose likelihood of the log of the size is normal: as the search states it, at the mode."""
    centre, spread = np.log(USUAL.centre["gyro", kind]), USUAL.spread["gyro", kind]
    of_posterior = (1.0 / width**2 + 1.0 / spread**2) ** -0.5
    mode = of_posterior**2 * (np.log(size) / width**2 + centre / spread**2)
    term = NoiseTerm("gyro", kind, tau=tau, size=float(np.exp(mode)))
    mass = float(USUAL.log_density(term, np.array([term.size]))[0]) + np.log(of_posterior * np.sqrt(2.0 * np.pi))
    return NoiseModel((term,), (log_odds(term) + mass,))


def of_unit_by_quadrature(sizes, widths, alike=0.2):
    centre, spread = np.log(USUAL.centre["gyro", "flicker"]), USUAL.spread["gyro", "flicker"]
    at, mode = np.log(sizes), np.log([having(*one).terms[0].size for one in zip(sizes, widths, strict=True)])

    def density(s):
        u2 = np.square(widths) + alike**2
        # Over the likelihood at the size that is stated.
        each = widths / np.sqrt(u2) * np.exp(0.5 * (mode - at) ** 2 / widths**2 - 0.5 * (s - at) ** 2 / u2)
        return np.exp(-0.5 * ((s - centre) / spread) ** 2) / (spread * np.sqrt(2.0 * np.pi)) * np.prod(each)

    return log_odds(NoiseTerm("gyro", "flicker")) + np.log(
        quad(density, centre - 12.0, centre + 12.0, points=at, limit=400)[0]
    )


def test_noise_of_the_unit_has_the_prior_of_one_size():
    usual = USUAL.centre["gyro", "flicker"]
    sizes, widths = usual * np.array([1.1, 0.8, 1.3]), np.array([0.3, 0.1, 0.8])
    own = [having(*one) for one in zip(sizes, widths, strict=True)]
    apart = np.log(0.5) + sum(noise.log_prior for noise in own)
    expected = np.logaddexp(apart, np.log(0.5) + of_unit_by_quadrature(sizes, widths))
    assert log_prior_of_set(own, USUAL) == pytest.approx(expected, abs=1e-6)
    # One size for three costs less than three sizes.
    assert expected > apart + 2.0


@pytest.mark.parametrize("off", [0.2, 5.0])
def test_the_prior_of_a_size_counts_once_whatever_the_number_of_recordings(off):
    """With the posteriors in the place of the likelihoods six recordings gave -4.3 for -2.9."""
    sizes, widths = off * USUAL.centre["gyro", "flicker"] * np.linspace(0.8, 1.2, 6), np.full(6, 0.5)
    own = [having(*one) for one in zip(sizes, widths, strict=True)]
    apart = np.log(0.5) + sum(noise.log_prior for noise in own)
    expected = np.logaddexp(apart, np.log(0.5) + of_unit_by_quadrature(sizes, widths))
    assert log_prior_of_set(own, USUAL) == pytest.approx(expected, abs=1e-6)


def test_gauss_markov_noise_of_the_unit_has_one_time_constant():
    usual = USUAL.centre["gyro", "markov"]
    near = [having(usual, 0.3, "markov", tau) for tau in (150.0, 300.0)]
    far = [having(usual, 0.3, "markov", tau) for tau in (30.0, 300.0)]
    apart = [np.log(0.5) + sum(noise.log_prior for noise in own) for own in (near, far)]
    assert log_prior_of_set(near, USUAL) > apart[0] + 1.0
    assert log_prior_of_set(far, USUAL) == pytest.approx(apart[1])


def test_time_constants_of_one_unit_have_the_mean_of_their_log_odds():
    """The sizes are known well: what is left of two priors of a size is one, and how far two may be apart."""
    usual, width = USUAL.centre["gyro", "markov"], 1e-3
    own = [having(usual, width, "markov", tau) for tau in (300.0, 600.0)]
    odds = [log_odds(noise.terms[0]) for noise in own]
    density = -0.5 * np.log(2.0 * np.pi) - np.log(USUAL.spread["gyro", "markov"])
    apart = np.log(0.5) + sum(noise.log_prior for noise in own)
    # Of the two sizes one is within .2 of the other, each with the width of its likelihood.
    near = -0.5 * np.log(2.0 * np.pi * 2.0 * 0.2**2) + 2.0 * np.log(width * np.sqrt(2.0 * np.pi))
    alike = np.log(0.5) + np.mean(odds) + density + near
    # What is left out: two sizes .2 apart know one to .14, and the prior is 1 wide, 1/2 log 1.02.
    assert log_prior_of_set(own, USUAL) == pytest.approx(np.logaddexp(apart, alike), abs=0.02)


def test_noise_of_very_different_sizes_is_that_of_each_recording():
    usual = USUAL.centre["gyro", "flicker"]
    own = [having(usual, 0.05), having(20.0 * usual, 0.05)]
    apart = np.log(0.5) + sum(noise.log_prior for noise in own)
    assert log_prior_of_set(own, USUAL) == pytest.approx(apart, abs=1e-6)


def test_noise_that_one_recording_lacks_is_not_of_the_unit():
    usual = USUAL.centre["gyro", "flicker"]
    own = [having(usual, 0.2), having(usual, 0.2), NoiseModel()]
    apart = np.log(0.5) + sum(noise.log_prior for noise in own)
    assert log_prior_of_set(own, USUAL) == pytest.approx(apart, abs=1e-12)


def test_white_noise_in_all_recordings_costs_nothing():
    assert log_prior_of_set([NoiseModel()] * 4, USUAL) == 0.0


@pytest.mark.parametrize("kind", ["attitude", "stop", "shift"])
def test_what_a_missing_effect_looks_like_is_weighed_by_each_recording(kind):
    one = NoiseModel((NoiseTerm("accel", kind, size=1e-3),), (-4.0,))
    assert log_prior_of_set([one, one], USUAL) == pytest.approx(-8.0)
