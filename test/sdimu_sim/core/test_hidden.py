"""Hidden effects: every name is readable, and the formulas are the physics they claim."""

import numpy as np
import pytest

from sdimu_calibration.core.effects.imu_model import told_apart
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY as G
from sdimu_calibration.core.units import to_si
from sdimu_sim.core import hidden as hidden_module
from sdimu_sim.core.equation import CONSTANTS
from sdimu_sim.core.hidden import (
    SENSORS,
    VARIABLES,
    Row,
    canonical,
    effect_example,
    effect_names,
    parse_effects,
    size_unit,
)
from sdimu_sim.core.scenario import with_hidden
from sdimu_sim.core.truth import ImuTruth

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
    ("gyro_x: ey^2=0.3 deg/h", "gyro_x", 0.3 * DEGPH * VALUES["ey"] ** 2),
    ("accel_y: ax wtz=3 ug*s/deg/g", "accel_y", 3 * UG * AX * VALUES["wtz"] / np.radians(1)),
    # The temperature of the calibrator's equations counts from the start.
    ("gyro_z: T=2 deg/h/degC", "gyro_z", 2 * DEGPH * VALUES["dT"]),
    (
        "accel_x: sin(2 pi t / 300 s + 30 deg)=5 ug",
        "accel_x",
        5 * UG * np.sin(2 * np.pi * VALUES["t"] / 300 + np.radians(30)),
    ),
    ("gyro_x: wx*exp(-t/300.0)=1e-06 1; name=my_k", "gyro_x", 1e-6 * WX * np.exp(-VALUES["t"] / 300)),
    (
        "gyro_bias_random_walk_y2(span=1000 s)=2 deg/h",
        "gyro_y",
        2 * DEGPH * np.sin(1.5 * np.pi * VALUES["t"] / 1000) / (1.5 * np.pi),
    ),
    ("gyro_mass_unbalance_ramp_qy=2 deg/h/g/h", "gyro_y", 2 * DEGPH / 3600 * VALUES["t"] * AX),
]


@pytest.mark.parametrize(("text", "sensor", "expected"), CLAIMS)
def test_effects_are_the_physics_they_are_named_for(text, sensor, expected):
    (term,) = parse_effects([text]).terms
    assert SENSORS[term.sensor] == sensor
    value = term.expression.evaluate(CONSTANTS | VALUES | term.parameters)
    assert float(value) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", effect_names())
def test_every_name_reads_its_own_example(name):
    example = effect_example(name)
    hidden = parse_effects([example])
    found = dict(hidden.sizes) | dict(hidden.coefficients)
    assert found == {name: pytest.approx(to_si(10.0 if "lost" in name else 1.0, size_unit(name)))}
    parts = (hidden.terms, hidden.lost, any(hidden.delay_s), any(hidden.site), hidden.lever_arm_m, hidden.coefficients)
    assert sum(map(bool, parts)) == 1
    assert canonical(example) == example


def test_the_former_spelling_is_read_and_the_canonical_one_is_written():
    former, key = "gyro_bias_warm_up_z=0.3 deg/h; tau=20 min", "gyro_bias_warm_up_z(tau=20 min)=0.3 deg/h"
    assert canonical(former) == key
    (old,), (new,) = (parse_effects([text]).terms for text in (former, key))
    assert (old.name, old.sensor, old.parameters) == (new.name, new.sensor, new.parameters)
    truth = with_hidden(ImuTruth(effects=(former, "accel_z=20*ug*ax*wz")))
    assert truth.effects == (key, "accel_z=20*ug*ax*wz")


def test_two_variants_of_one_effect_have_the_names_that_their_estimates_have():
    keys = ("gyro_bias_step_x(t0=100 s)=1 deg/h", "gyro_bias_step_x(t0=300 s)=2 deg/h")
    assert parse_effects(keys).sizes == {
        "gyro_bias_step_x": pytest.approx(DEGPH),
        "gyro_bias_step_x(t0=300 s)": pytest.approx(2 * DEGPH),
    }
    effects = told_apart([resolve(key.rpartition("=")[0]) for key in keys])
    assert set(parse_effects(keys).sizes) == {e.parameters[0].name for e in effects}


def test_a_coefficient_of_the_baseline_and_the_lever_arm_are_set_to_their_size():
    drawn = ImuTruth(
        coefficients={"gyro_scale_x": 1e-4, "gyro_scale_y": 3e-4},
        lever_arm_m=(0.1, 0.2, 0.3),
        effects=("gyro_scale_x=20 ppm", "lever_arm_y=5 mm"),
    )
    truth = with_hidden(drawn)
    assert truth.coefficients == {"gyro_scale_x": pytest.approx(20e-6), "gyro_scale_y": 3e-4}
    assert truth.lever_arm_m == (0.1, pytest.approx(0.005), 0.3)
    assert with_hidden(truth) == truth


def test_delays_add_up_by_sensor():
    hidden = parse_effects(["accel_delay=0.5 ms", "accel_delay_y=1 ms", "gyro_delay_z=2 ms"])
    assert hidden.delay_s == pytest.approx((0, 0, 2e-3, 0.5e-3, 1.5e-3, 0.5e-3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("accel_quadratc_x=20 ug/g^2", "did you mean accel_quadratic_x"),
        ("accel_quadratic_x=20 ug", "accel_quadratic_x: .*wrong unit.*ug/g"),
        ("accel_quadratic_x=20", "accel_quadratic_x: "),
        ("accel_quadratic_x", "has no size .*accel_quadratic_x=1 ug/g"),
        ("gyro_scale_asymmetry_x=20", "'20' has no unit .*20 ppm"),
        ("gyro_misalignment_xy=20", "'20' has no unit .*20 arcmin"),
        ("gyro_bias_warm_up_x(tau=300)=1 deg/h", "tau: '300' has no unit .*300 s"),
        ("gyro_bias_warm_up_x=1 deg/h", "tau=1 s"),
        ("gyro_bias_random_walk_x2(span=-5 s)=1 deg/h", "span must be positive"),
        ("gyro_x: ey^2", "has no size .*gyro_x: ey.2=1 deg/h"),
        ("accel_x: ax wty", "accel_x: ax wty=1 ug/g.s"),
        ("gyro_x: ey^2=0.3", "'0.3' has no unit .*0.3 deg/h"),
        ("gyro_x: ey^2=0.3 ug", "wrong unit"),
        ("accel_x: ax wty=3 ug", "wrong unit"),
        ("gyro_w: ey^2=1 deg/h", "no such sensor"),
        ("gyro_scale_x(tau=3 s)=1 ppm", "it takes no options"),
        ("gyro_bias_warm_up_x=1 deg/h; tau=-5 s", "tau must be positive"),
        ("gyro_bias_warm_up_x=1 deg/h; tau=5 s; t0=1 s", "expected gyro_bias_warm_up_x.tau=1 s"),
        ("gyro_delay=-1 ms", "delay the other triad"),
        ("gyro_lost_data=10 ms", "turn=1"),
        ("gyro_lost_data=10 ms; turn=0", "turns count from 1"),
        ("gyro_x=wq", "unknown variable 'wq'"),
        ("zzz=1", "unknown effect 'zzz'"),
        ("accel_quadratic=25 ug/g^2", "several coefficients.*accel_quadratic_x, accel_quadratic_y, accel_quadratic_z"),
    ],
)
def test_a_wrong_effect_gives_one_line_with_its_name(text, message):
    with pytest.raises(DataError, match=message) as caught:
        parse_effects([text])
    assert "\n" not in str(caught.value)


def test_a_plug_in_brings_the_simulated_half_of_its_effect(monkeypatch):
    class Point:
        name, value = "swing", "some.package:rows"

        @staticmethod
        def load():
            return lambda: (Row("gyro_swing_{i}", "deg/h", "k*sin(t/period)", {"period": "s"}),)

    monkeypatch.setattr(hidden_module, "entry_points", lambda group: [Point] if group == "sdimu_sim.effects" else [])
    monkeypatch.setattr(hidden_module, "_TABLE", dict(hidden_module._TABLE))
    monkeypatch.setattr(hidden_module, "_LOADED", set())
    (term,) = parse_effects(["gyro_swing_y(period=50 s)=2 deg/h"]).terms
    assert SENSORS[term.sensor] == "gyro_y"
    value = term.expression.evaluate(CONSTANTS | VALUES | term.parameters)
    assert float(value) == pytest.approx(2 * DEGPH * np.sin(VALUES["t"] / 50), rel=1e-12)
