"""Hidden effects: every name is readable, and the formulas are the physics they claim."""

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY as G
from sdimu_sim.core.hidden import CONSTANTS, SENSORS, VARIABLES, effect_example, effect_names, parse_effects

DEGPH = np.pi / 180 / 3600
UG = 1e-6 * G
VALUES = {name: 0.1 + 0.037 * k for k, name in enumerate(VARIABLES)}
AX, AY, AZ = (VALUES[f"a{i}"] for i in "xyz")
WX, WY, WZ = (VALUES[f"w{i}"] for i in "xyz")

CLAIMS = [
    ("accel_quadratic_x=20 ug/g^2", "accel_x", 20 * UG * AX**2),
    ("accel_cubic_y=20 ug/g^3", "accel_y", 20 * UG * AY**3),
    ("accel_odd_quadratic_z=20 ug/g^2", "accel_z", 20 * UG * AZ * abs(AZ)),
    ("accel_scale_asymmetry_y=20 ppm", "accel_y", 20e-6 * G * abs(AY)),
    ("accel_cross_coupling_yx=40 ug/g^2", "accel_y", 40 * UG * AY * AX),
    ("accel_cross_square_zx=40 ug/g^2", "accel_z", 40 * UG * AX**2),
    ("accel_cross_product_x=40 ug/g^2", "accel_x", 40 * UG * AY * AZ),
    ("gyro_g_sensitivity_xz=0.06 deg/h/g", "gyro_x", 0.06 * DEGPH * AZ),
    ("gyro_g_squared_xx=0.1 deg/h/g^2", "gyro_x", 0.1 * DEGPH * AX**2),
    ("gyro_g_product_xyz=0.8 deg/h/g^2", "gyro_x", 0.8 * DEGPH * AY * AZ),
    ("gyro_scale_asymmetry_y=20 ppm", "gyro_y", 20e-6 * abs(WY)),
    # 20 ppm at 2 deg/s is 10 ppm per deg/s.
    ("gyro_scale_quadratic_y=10 ppm*s/deg", "gyro_y", 20e-6 * WY * WY / np.radians(2)),
    ("gyro_scale_cubic_z=5 ppm*s^2/deg^2", "gyro_z", 20e-6 * WZ * (WZ / np.radians(2)) ** 2),
    ("gyro_misalignment_asymmetry_xy=1 arcsec", "gyro_x", np.radians(1 / 3600) * abs(WY)),
    ("gyro_acceleration_sensitivity_xy=2 ms", "gyro_x", 2e-3 * VALUES["alphay"]),
    ("gyro_bias_temperature_x=0.1 deg/h/degC", "gyro_x", 0.1 * DEGPH * VALUES["dT"]),
    ("accel_bias_temperature_rate_x=7 ug*min/degC", "accel_x", 7 * UG * 60 * VALUES["dTdt"]),
    ("gyro_bias_warm_up_z=0.3 deg/h; tau=20 min", "gyro_z", 0.3 * DEGPH * np.exp(-VALUES["t"] / 1200)),
    (
        "gyro_bias_settling_z=0.3 deg/h; tau=20 s",
        "gyro_z",
        0.3 * DEGPH * (1.0 - VALUES["moving"]) * np.exp(-VALUES["since"] / 20.0),
    ),
    ("gyro_bias_ramp_z=0.3 deg/h/h", "gyro_z", 0.3 * DEGPH * VALUES["t"] / 3600),
    ("accel_bias_step_x=5 ug; t0=1000 s", "accel_x", 0.0),
    ("accel_bias_step_x=5 ug; t0=0.5 s", "accel_x", 5 * UG),
    ("accel_scale_temperature_z=2 ppm/degC", "accel_z", 2e-6 * VALUES["dT"] * G * AZ),
    ("gyro_bias_in_motion_x=0.1 deg/h", "gyro_x", 0.1 * DEGPH * VALUES["moving"]),
    ("gyro_magnetic_xz=0.1 deg/h/G", "gyro_x", 0.1 * DEGPH * VALUES["Bz"] / 1e-4),
    ("gyro_dead_band_x=0.05 deg/h", "gyro_x", -0.05 * DEGPH),
    ("gyro_dead_band_x=1e6 deg/h", "gyro_x", -WX),
    ("accel_size_xy=10 mm", "accel_x", 0.01 * VALUES["Lxy"]),
    ("accel_z=20*ug*ax*wz", "accel_z", 20 * UG * AX * WZ),
]


@pytest.mark.parametrize(("text", "sensor", "expected"), CLAIMS)
def test_effects_are_the_physics_they_are_named_for(text, sensor, expected):
    (term,) = parse_effects([text]).terms
    assert SENSORS[term.sensor] == sensor
    value = term.expression.evaluate(CONSTANTS | VALUES | term.parameters)
    assert float(value) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", effect_names())
def test_every_name_reads_its_own_example(name):
    hidden = parse_effects([effect_example(name)])
    assert len(hidden.terms) + len(hidden.lost) + any(hidden.delay_s) == 1


def test_delays_add_up_by_sensor():
    hidden = parse_effects(["accel_delay=0.5 ms", "accel_delay_y=1 ms", "gyro_delay_z=2 ms"])
    assert hidden.delay_s == pytest.approx((0, 0, 2e-3, 0.5e-3, 1.5e-3, 0.5e-3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("accel_quadratc_x=20 ug/g^2", "did you mean accel_quadratic_x"),
        ("accel_quadratic_x=20 ug", "accel_quadratic_x: .*wrong unit.*ug/g"),
        ("accel_quadratic_x=20", "accel_quadratic_x: "),
        ("accel_quadratic_x", "expected NAME=VALUE"),
        ("gyro_bias_warm_up_x=1 deg/h", "tau=1 s"),
        ("gyro_bias_warm_up_x=1 deg/h; tau=-5 s", "tau must be positive"),
        ("gyro_bias_warm_up_x=1 deg/h; tau=5 s; t0=1 s", "cannot read"),
        ("gyro_delay=-1 ms", "delay the other triad"),
        ("gyro_lost_data=10 ms", "turn=1"),
        ("gyro_lost_data=10 ms; turn=0", "turns count from 1"),
        ("gyro_x=wq", "unknown variable 'wq'"),
        ("zzz=1", "unknown effect 'zzz'"),
    ],
)
def test_a_wrong_effect_gives_one_line_with_its_name(text, message):
    with pytest.raises(DataError, match=message) as caught:
        parse_effects([text])
    assert "\n" not in str(caught.value)
