"""The prior of an effect: what the IMU's file states of it, or of a larger effect that contains it, else its grade."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core.effects.imu_model import build, has_stated_priors, prior_size, prior_sizes
from sdimu_calibration.core.effects.registry import get
from sdimu_calibration.core.specification import ImuSpecification

MASS_UNBALANCE, MATRIX = get("gyro_mass_unbalance"), get("gyro_g_sensitivity")


def imu(**prior):
    return ImuSpecification("file", 1e-4, 1e-3, prior, grade="mems")


def test_the_mass_unbalance_is_six_of_nine_elements_of_the_sensitivity_to_force_that_the_file_states():
    assert prior_size(MASS_UNBALANCE, imu(gyro_g_sensitivity=3e-3)) == 3e-3
    assert prior_size(MASS_UNBALANCE.only(("gyro_mass_unbalance_dx",)), imu(gyro_g_sensitivity=3e-3)) == 3e-3


def test_what_the_file_states_of_an_effect_itself_comes_first():
    assert prior_size(MASS_UNBALANCE, imu(gyro_g_sensitivity=3e-3, gyro_mass_unbalance=1e-5)) == 1e-5


@pytest.mark.parametrize("effect", [MASS_UNBALANCE, MATRIX])
def test_a_file_that_states_nothing_of_it_leaves_the_prior_to_its_grade(effect):
    assert prior_size(effect, imu()) == effect.prior["mems"]


SHARED = {"xx": "dx", "xy": "qx", "yy": "dy", "yx": "qy", "zz": "dz", "zy": "qz"}
"""Elements of the sensitivity to force that are mass unbalances: those of the same sensor and force."""


def test_elements_that_are_mass_unbalances_have_the_prior_that_the_file_states_of_these():
    """By hand nothing of it is in the model, and the sizes were those of the grade."""
    stated = imu(gyro_mass_unbalance=1e-5)
    for ij, term in SHARED.items():
        element, unbalance = (
            MATRIX.only((f"gyro_g_sensitivity_{ij}",)),
            MASS_UNBALANCE.only((f"gyro_mass_unbalance_{term}",)),
        )
        rng = np.random.default_rng(4)
        motion = SimpleNamespace(a=rng.standard_normal((5, 3)))
        np.testing.assert_array_equal(element.regressors(motion), unbalance.regressors(motion))
        assert element.terms[0].channel == unbalance.terms[0].channel
        assert prior_size(element, stated) == 1e-5


def test_the_elements_of_the_spin_axes_are_no_mass_unbalances_and_keep_the_prior_of_the_grade():
    sizes = dict(zip(MATRIX.labels, prior_sizes(MATRIX, imu(gyro_mass_unbalance=1e-5)), strict=True))
    own = {label for label, size in sizes.items() if size == MATRIX.prior["mems"]}
    assert own == {f"gyro_g_sensitivity_{ij}" for ij in ("xz", "yz", "zx")}
    assert prior_size(MATRIX, imu(gyro_mass_unbalance=1e-5)) == MATRIX.prior["mems"]


def test_what_the_file_states_of_the_matrix_holds_for_all_of_it():
    both = imu(gyro_mass_unbalance=1e-5, gyro_g_sensitivity=3e-3)
    assert prior_sizes(MATRIX, both) == [3e-3] * 9
    assert all(has_stated_priors(MATRIX, both))


def test_a_model_takes_the_prior_of_each_element():
    stated = imu(gyro_mass_unbalance=1e-5)
    sensors = build((MATRIX,), stated)
    assert sensors.prior.tolist() == prior_sizes(MATRIX, stated)
    assert has_stated_priors(MATRIX, stated) == [size == 1e-5 for size in sensors.prior]
