"""The prior of an effect: what the IMU's file states of it, or of a larger effect that contains it, else its grade."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.effects.imu_model import prior_size
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


def test_a_part_says_nothing_of_the_whole():
    assert prior_size(MATRIX, imu(gyro_mass_unbalance=1e-5)) == MATRIX.prior["mems"]
