"""Noise with a memory as states of a filter: its spectrum, its mean over the rests, and nothing where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.effects import bias
from sdimu_calibration.core.effects.imu_model import build
from sdimu_calibration.core.filter.filter_pass import NAV, PassSettings, PassState, _fade
from sdimu_calibration.core.filter.noise_states import with_noise_states
from sdimu_calibration.core.filter.running_mean import into_means, share_of_rests
from sdimu_calibration.core.noise_term import FLICKER, MARKOV, RANDOM_WALK, NoiseTerm
from sdimu_calibration.core.specification import EPOCH_S

FLICKERING = (NoiseTerm("gyro", FLICKER, size=2e-8), NoiseTerm("accel", FLICKER, size=3e-5))


@pytest.fixture
def sensors(imu):
    return build(("gyro_bias", "accel_bias"), imu)


def one_sensor(sensors, states):
    """Prior variance, decay rate and drive of the noise of the first gyro."""
    own = states.wander[states.adds[0] > 0.0]
    return sensors.prior[own] ** 2, sensors.decay_rate[own], sensors.drive[own]


def test_white_noise_leaves_the_model_as_it_is(sensors):
    same, states = with_noise_states(sensors, ())
    assert same is sensors
    assert states is None


def test_flicker_has_the_density_that_defines_it_from_seconds_to_hours(sensors):
    wider, states = with_noise_states(sensors, FLICKERING)
    variance, rate, _ = one_sensor(wider, states)
    for f in np.geomspace(1.0 / (2.0 * np.pi * 5e3), 1.0 / (2.0 * np.pi * 8.0), 25):
        # Of both signs of f. At the ends a half of the next decade is missing.
        density = np.sum(variance * 2.0 / rate / (1.0 + (2.0 * np.pi * f / rate) ** 2))
        assert density == pytest.approx(2e-8**2 / (2.0 * np.pi * f), rel=0.25)


@pytest.mark.parametrize("T", [EPOCH_S, 30.0, 3600.0])
def test_the_variance_of_flicker_stays_while_it_is_not_measured(sensors, T):
    """In an epoch, and over a gap as well."""
    wider, states = with_noise_states(sensors, FLICKERING)
    variance, rate, drive = one_sensor(wider, states)
    settings = PassSettings(np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, rate, drive, True, True)
    faded, added = np.empty(len(rate)), np.empty(len(rate))
    _fade(settings, T, np.ones(len(rate)), faded, added)
    np.testing.assert_allclose(faded**2 * variance + added, variance, rtol=1e-12)


def test_a_random_walk_grows_by_its_density(sensors):
    wider, states = with_noise_states(sensors, (NoiseTerm("gyro", RANDOM_WALK, size=1e-9),))
    _, rate, drive = one_sensor(wider, states)
    assert rate.tolist() == [0.0]
    assert drive == pytest.approx([1e-18])
    assert len(states.mean) == 3


def test_another_kind_of_noise_is_refused(sensors):
    with pytest.raises(ValueError, match="markov"):
        with_noise_states(sensors, (NoiseTerm("gyro", MARKOV, 100.0, 1e-8),))


def test_the_mean_over_rests_is_that_of_the_noise_and_its_covariance_follows(sensors):
    rng = np.random.default_rng(5)
    wider, states = with_noise_states(sensors, FLICKERING)
    q, p = len(wider.prior), len(sensors.prior)
    A = rng.standard_normal((NAV + q + 3, NAV + q + 3))
    state = PassState(
        rng.standard_normal(NAV + q + 3), A @ A.T, np.eye(3), np.zeros(3), np.zeros(3), rng.standard_normal(q)
    )
    step = np.eye(NAV + q + 3)
    step[np.ix_(NAV + states.mean, NAV + states.mean)] *= 0.75
    step[np.ix_(NAV + states.mean, NAV + states.wander)] = 0.25 * states.adds
    expected, P = step @ state.x, step @ state.P @ step.T
    used = step[NAV : NAV + q, NAV : NAV + q] @ state.used
    into_means(0.25, states.averaged, NAV, state.x, state.P, state.used)
    np.testing.assert_allclose(state.x, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(state.used, used, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(state.P, P, rtol=1e-10, atol=1e-10)
    # What is reported of a bias is the constant with the mean of its noise; of nothing else anything but itself.
    reported = states.moved @ state.used
    np.testing.assert_allclose(reported[:6], state.used[:6] + state.used[states.mean], rtol=1e-12)
    assert states.moved.shape == (p, q)
    assert wider.names[:6] == bias.NAMES


def test_shares_of_the_rests_so_far_make_the_mean_over_all_of_them():
    start = np.array([0.0, 1.0, 2.0, 5.0, 6.0])
    end = np.array([1.0, 2.0, 5.0, 6.0, 8.5])
    dwell = np.array([True, True, False, True, True])
    values, mean = np.array([4.0, -1.0, 70.0, 2.5, 3.0]), 0.0
    for share, value in zip(share_of_rests(start, end, dwell), values, strict=True):
        mean = (1.0 - share) * mean + share * value
    assert mean == pytest.approx(np.average(values[dwell], weights=(end - start)[dwell]))
