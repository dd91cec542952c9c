"""Two effects of one sensor whose estimates hang together may be parts of one cause: equations are asked for then."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.rounds import are_parts
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.verdict import Verdict


def candidates(*keys):
    return [one for key in keys for one in split(selection.resolve(key))]


@pytest.mark.parametrize(
    ("second", "correlation", "asked"),
    [
        ("accel_scale_asymmetry_z", -0.95, True),
        ("accel_scale_asymmetry_z", 0.95, True),
        ("accel_scale_asymmetry_z", -0.85, False),
        ("accel_scale_asymmetry_x", -0.95, False),
        ("accel_magnetic_zx", -0.95, True),
    ],
)
def test_they_are_effects_of_one_sensor_whose_estimates_hang_together(second, correlation, asked):
    sigma = np.array([2e-5, 3e-6])
    covariance = np.array([[1.0, correlation], [correlation, 1.0]]) * np.outer(sigma, sigma)
    assert are_parts(candidates("accel_quadratic_z", second), covariance) == asked


def test_an_effect_of_all_sensors_is_no_part_of_one():
    both = candidates("accel_quadratic_z", "accel_triad_delay")
    covariance = np.array([[1.0, 0.99], [0.99, 1.0]])
    assert len({term.channel for term in both[1].effect.terms}) == 3
    assert not are_parts(both, covariance)


def test_a_fourth_power_is_told_as_that_and_not_as_a_square_and_an_asymmetry(bench):
    """K2 of 54 ug/g^2 and an asymmetry of -30 ppm were certain here, and neither is there."""
    found = bench.diagnosis(5, ("accel_z: az^4=25 ug/g^4",), "recommended")
    assert found.verdict == Verdict.OWN_EQUATION
    (one,) = found.found_effects
    assert one.candidate.label == "accel_z: az^4"
    assert abs(one.value - 25.0 * 9.80665e-6) < 4.0 * one.sigma


def test_a_square_beside_an_asymmetry_stays_both(bench):
    found = bench.diagnosis(5, ("accel_quadratic_z=25 ug/g^2", "accel_scale_asymmetry_z=25 ppm"), "recommended")
    assert {one.candidate.family for one in found.found_effects} == {"accel_quadratic", "accel_scale_asymmetry"}
