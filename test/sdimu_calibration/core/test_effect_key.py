"""The canonical key: one spelling, read back as it is written, with units that cannot be left out."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.effect_key import EffectKey, parse_key, read_options, sized
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.effect_file import find_effects

KEYS = [
    EffectKey("accel_quadratic_x"),
    EffectKey("gyro_bias_warm_up", {"tau": "300 s"}),
    EffectKey("gyro_lost_data", {"turn": "2", "at": "120 s"}, "10 ms"),
    EffectKey("gyro_x: sin(2 pi t / 300 s)", {}, "0.3 deg/h"),
    EffectKey("accel_z: ax*wty"),
    EffectKey("gyro_y: exp(-t/300.0)*wx", {"name": "my_k"}, "1e-06 1"),
    EffectKey("files/my.yaml:k", {}, "3 ppm"),
    EffectKey("accel_z", {}, "20*ug*ax*(wz + wy)"),
]


@pytest.mark.parametrize("key", KEYS, ids=str)
def test_a_key_is_read_back_as_it_is_written(key):
    assert parse_key(str(key)) == key


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("gyro_bias_warm_up_x=0.3 deg/h; tau=300 s", "gyro_bias_warm_up_x(tau=300 s)=0.3 deg/h"),
        (" gyro_bias_warm_up_x ( tau = 300 s ) = 0.3 deg/h", "gyro_bias_warm_up_x(tau=300 s)=0.3 deg/h"),
        ("gyro_lost_data=10 ms; turn=7", "gyro_lost_data(turn=7)=10 ms"),
        ("gyro_x:ey^2", "gyro_x: ey^2"),
    ],
)
def test_other_spellings_become_the_canonical_one(text, canonical):
    assert str(parse_key(text)) == canonical


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot read effect ''"),
        ("gyro bias", "cannot read effect 'gyro bias'"),
        ("gyro_bias_warm_up(tau)", "cannot read its options"),
        ("gyro_bias_warm_up(tau=3 s, tau=4 s)", "each once"),
        ("gyro_q: ey^2", "no such sensor"),
    ],
)
def test_what_is_no_key_is_refused_in_one_line(text, message):
    with pytest.raises(DataError, match=message) as caught:
        parse_key(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gyro_bias_warm_up(tau=300)", r"tau: '300' has no unit \(expected something like '300 s'\)"),
        ("gyro_bias_warm_up(tau=300 m)", "wrong unit"),
        ("gyro_bias_warm_up(t0=300 s)", r"expected gyro_bias_warm_up\(tau=1 s\), not '\(t0=300 s\)'"),
        ("gyro_lost_data(turn=1, at=20)", "at: '20' has no unit"),
        ("accel_quadratic(tau=3 s)", "takes no options"),
        ("accel_quadratic_x=20 ug/g^2", "only a simulation takes a size"),
        ("gyro_x: ey^2=1 deg/h", "only a simulation takes a size"),
    ],
)
def test_the_estimator_refuses_a_number_without_its_unit_and_a_size(text, message):
    with pytest.raises(DataError, match=message):
        find_effects(text)


def test_a_count_has_no_unit():
    assert read_options(parse_key("gyro_lost_data(turn=2, at=1 min)"), {"turn": "1", "at": "s"}) == {
        "turn": 2.0,
        "at": 60.0,
    }


def test_a_size_is_written_to_the_last_digit():
    value = to_si(0.1, "deg/h") / 3.0
    key = parse_key(sized(resolve("gyro_bias_warm_up_x(tau=300 s)").key, value, "deg/h"))
    assert str(key).startswith("gyro_bias_warm_up_x(tau=300 s)=0.0333")
    number, _, unit = key.size.partition(" ")
    assert to_si(float(number), unit) == pytest.approx(value, rel=1e-15)


def test_options_that_are_left_out_are_said_to_be_lacking():
    with pytest.raises(DataError, match=r"expected gyro_bias_warm_up_y\(tau=1 s\), and no options are stated"):
        read_options(parse_key("gyro_bias_warm_up_y=0.03 deg/h"), {"tau": "s"})
