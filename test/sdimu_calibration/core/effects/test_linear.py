"""Effects that say they are linear are: the slope of their errors is taken once for a whole test."""

import numpy as np
import pytest

from sdimu_calibration.core.compensation.reads import samples_motion
from sdimu_calibration.core.effects import imu_model, registry
from sdimu_calibration.core.effects.error_slope import error_slope, slope_is_constant
from sdimu_calibration.storage.files.config import load_imu, load_model

RNG = np.random.default_rng(5)
LINEAR = [name for name in registry.names() if registry.get(name).linear]


def motion(w, f):
    none = np.zeros_like(w)
    return samples_motion(np.arange(len(w), dtype=float), np.ones(len(w)), w, f, none, none)


def errors(model, coefficients, w, f):
    return model.errors(model.regressors(motion(w, f)), coefficients)


def test_the_baseline_is_linear():
    assert set(load_model("baseline").effects) <= set(LINEAR)


@pytest.mark.parametrize("name", LINEAR)
def test_errors_of_a_linear_effect_are_a_constant_and_multiples_of_rate_and_force(name):
    model = imu_model.build((name,), load_imu("dtg"))
    coefficients = RNG.standard_normal(len(model.names))
    one, other, none = ([RNG.standard_normal((4, 3)) for _ in "wf"] for _ in range(3))
    none = [np.zeros((4, 3))] * 2
    both = [a + 2.5 * b for a, b in zip(one, other, strict=True)]
    at = [errors(model, coefficients, *x) for x in (one, other, none, both)]
    expected = at[2] + (at[0] - at[2]) + 2.5 * (at[1] - at[2])
    np.testing.assert_allclose(at[3], expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_the_slope_beside_a_curved_effect_is_that_of_each_cycle():
    """Linear effects once, others cycle by cycle: the same as differences of all errors."""
    model = imu_model.build(("gyro_scale", "accel_misalignment", "accel_quadratic"), load_imu("dtg"))
    coefficients = 1e-3 * RNG.standard_normal(len(model.names))
    w, f = RNG.standard_normal((5, 3)), 9.8 * RNG.standard_normal((5, 3))
    found = error_slope(model, motion(w, f), slice(None), coefficients)
    assert not slope_is_constant(model, coefficients)
    for k in range(6):
        step = np.zeros((5, 6))
        step[:, k] = 1e-5
        up, down = (errors(model, coefficients, w + s * step[:, :3], f + s * step[:, 3:]) for s in (1.0, -1.0))
        np.testing.assert_allclose(found[:, :, k], (up - down) / 2e-5, atol=1e-6)
    assert slope_is_constant(model, coefficients * (np.arange(len(coefficients)) < 9))
