"""Priors that the data contradict, also where the data know less than the prior."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.filter.solution import held_back


def estimated(data, sigma, prior):
    """Prior information, estimate and covariance of scalars that data of a sigma say, each with its prior."""
    weight, known = prior**-2.0, sigma**-2.0
    return weight, data * known / (known + weight), np.diag(1.0 / (known + weight))


@pytest.mark.parametrize("sigma", [0.001, 0.3, 0.4])
def test_a_prior_is_contradicted_by_the_distance_of_data_that_know_less_or_more_than_it(sigma):
    prior = np.full(2, 0.1)
    limit = 3.0 * np.hypot(sigma, prior[0])
    weight, estimate, covariance = estimated(np.array([0.95 * limit, 1.05 * limit]), np.full(2, sigma), prior)
    held, _ = held_back(weight, estimate, covariance)
    # Of data a hundred times as good as the prior nothing is held back, wherever they are.
    assert held.tolist() == [False, sigma > 0.01]


def test_without_its_prior_a_coefficient_is_what_the_data_say():
    data, sigma = np.array([2.0, -0.3]), np.array([0.35, 0.02])
    assert held_back(*estimated(data, sigma, np.full(2, 0.1)))[1] == pytest.approx(data)


def test_the_less_the_data_know_the_more_it_takes_up_to_the_estimate_itself():
    """What they say by themselves lies a thousand times beyond the prior, where no fit of one rest is linear."""
    known, data = 0.1**-2.0, []
    for share, least in ((0.0501, 0.67), (0.0499, 0.67), (0.01, 1.5), (1e-3, 3.0), (1e-6, 3.0)):
        beyond = 0.1 * least * np.array([0.97, 1.03])
        held, said = held_back(np.full(2, known), beyond, np.diag(np.full(2, (1.0 - share) / known)))
        assert held.tolist() == [False, True], share
        data.append(said[1])
    assert data[1] == pytest.approx(data[0], rel=0.01)
    assert data[-1] == pytest.approx(0.309)


def test_what_the_data_do_not_show_contradicts_nothing():
    weight = np.full(1, 4.0)
    held, data = held_back(weight, np.zeros(1), np.diag(1.0 / weight))
    assert not held.any()
    assert np.isfinite(data).all()


def test_noise_with_a_memory_contradicts_no_prior():
    """The data of a weak coefficient are further off than white noise says; far beyond its prior it is so in any."""
    weight, estimate, covariance = estimated(np.array([2.0, 0.6]), np.array([0.35, 0.01]), np.full(2, 0.1))
    assert held_back(weight, estimate, covariance)[0].tolist() == [True, True]
    assert held_back(weight, estimate, covariance, scatter=4.0)[0].tolist() == [False, True]
