"""Effects that change one sensor alike are told as one family."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.posterior.family import family_of


@pytest.mark.parametrize(
    ("label", "family"),
    [
        ("gyro_bias_ramp_y", ("gyro_bias_drift", "gyro_y")),
        ("gyro_bias_warm_up_y", ("gyro_bias_drift", "gyro_y")),
        # Cables that the turns twist: where all turns have one sense, a ramp.
        ("gyro_bias_wrap_yx", ("gyro_bias_drift", "gyro_y")),
        ("accel_bias_wrap_zx", ("accel_bias_drift", "accel_z")),
        # A transient after each turn comes back; temperature may be measured.
        ("accel_bias_settling_x", ("accel_bias_settling", "accel_x")),
        ("gyro_bias_temperature_y", ("gyro_bias_temperature", "gyro_y")),
        ("accel_quadratic_z", ("accel_quadratic", "accel_z")),
    ],
)
def test_slow_changes_of_one_bias_are_one_family(label, family):
    (candidate,) = (c for c in split(resolve(label)) if c.parameter.name == label)
    assert family_of(candidate) == family
