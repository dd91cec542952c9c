"""Functions of the attitude make up a smooth function wherever the test has been."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core.evidence.attitude_functions import attitude_functions
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.noise_term import ATTITUDE, RANDOM_WALK

REACH = (0.3, 0.9)


def seen():
    """Two rests with a turn of half a circle between them, then one of a quarter about another axis; 10 s each."""
    angle = np.concatenate([np.zeros(100), np.linspace(0.0, np.pi, 100), np.full(200, np.pi)])
    lift = np.concatenate([np.zeros(300), np.linspace(0.0, 0.5 * np.pi, 100)])
    f = 9.8 * np.column_stack([np.cos(angle) * np.cos(lift), np.sin(angle) * np.cos(lift), np.sin(lift)])
    t = 0.1 * np.arange(1.0, 401.0)
    return SimpleNamespace(f=f, t=t, dt=np.full(400, 0.1))


@pytest.fixture(scope="module")
def functions():
    return attitude_functions(seen(), [(0.0, 10.0), (20.0, 30.0)])


def test_their_sum_has_the_covariance_of_a_smooth_function_on_the_whole_way(functions):
    u = seen().f / 9.8
    apart = np.sum((u[:, None, :] - u[None, :, :]) ** 2, axis=2)
    phi = functions.at(u)
    # Knots may leave a thousandth of the variance at each of two places.
    smooth = np.mean([np.exp(-0.5 * apart / reach**2) for reach in REACH], axis=0)
    np.testing.assert_allclose(phi @ phi.T, smooth, atol=2e-3)
    assert len(functions) < 30


def test_a_sensor_sees_each_function_where_it_is(functions):
    effects = functions.effects()
    values = np.hstack([effect.regressors(seen()) for effect in effects])
    terms = [(t.channel, t.parameter) for effect in effects for t in effect.terms]
    assert values.shape == (400, 6 * len(functions))
    np.testing.assert_allclose(values, functions.at(seen().f / 9.8).repeat(6, axis=1), atol=1e-10)
    assert [channel for channel, _ in terms] == list(range(6)) * len(functions)


def test_behind_stretches_they_stand_for_the_attitude_alone(functions):
    n, m = 3, len(functions)
    edges = np.array([0.0, 10.0, 20.0, 30.0])
    still = np.array([False, True, False])
    cut = Stretches(edges[:-1], edges[1:], np.arange(n), still, None, functions)
    assert cut.cells == n + m
    walk, attitude = cut.mode(RANDOM_WALK, 0.0), cut.mode(ATTITUDE, 0.0)
    np.testing.assert_array_equal(walk[n:], 0.0)
    np.testing.assert_array_equal(attitude, np.vstack([np.zeros((n, m)), np.eye(m)]))
    # Half of the time of both rests; a function of the attitude is no part of a bias.
    np.testing.assert_allclose(cut.in_dwells, [0.5, 0.0, 0.5, *np.zeros(m)])
