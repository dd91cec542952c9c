"""One physical coefficient with two names has one true value, which is what a test shows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.units import to_si
from sdimu_sim.core.true_coefficients import one_coefficient, true_coefficients
from sdimu_sim.core.truth import ImuTruth

DRAWN = {"gyro_mass_unbalance_qx": 3e-6, "gyro_mass_unbalance_dz": -2e-6, "accel_misalignment_xy": 0.02}


@pytest.mark.parametrize("frame", ["prior", "accelerometer_triad"])
@pytest.mark.parametrize(("other", "name"), [("xy", "qx"), ("zz", "dz"), ("yx", "qy")])
def test_a_g_sensitivity_that_is_a_mass_unbalance_states_the_sum_under_both_names(frame, other, name):
    sensitivity, unbalance = f"gyro_g_sensitivity_{other}", f"gyro_mass_unbalance_{name}"
    size = to_si(1.0, "deg/h/g")
    truth = ImuTruth(DRAWN, (0.0, 0.0, 0.0), 0.0, 0.0, effects=(f"{sensitivity}=1 deg/h/g",))
    whole = replace(truth, effects=(), coefficients=DRAWN | {unbalance: DRAWN.get(unbalance, 0.0) + size})
    expected = true_coefficients(whole, frame)
    found = true_coefficients(truth, frame)
    assert found == pytest.approx(expected | {sensitivity: expected[unbalance]}, rel=1e-12)


def test_a_g_sensitivity_of_the_spin_axis_has_no_other_name():
    assert one_coefficient(["gyro_g_sensitivity_xz", "gyro_g_sensitivity_zx", "gyro_bias_ramp_x"]) == []
    assert one_coefficient(["gyro_g_sensitivity_xx"]) == [("gyro_g_sensitivity_xx", "gyro_mass_unbalance_dx")]
