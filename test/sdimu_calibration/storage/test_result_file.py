"""result.json is strict JSON and comes back as it went."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.result_file import read_judged_result, read_result, write_result


def calibration() -> Calibration:
    generator = np.random.default_rng(3)
    m, p = 7, 3
    root = generator.standard_normal((p, p)) * 1e-8
    return Calibration(
        body_frame="accelerometer_triad",
        model=("gyro_bias",),
        names=("gyro_bias_x", "gyro_bias_y", "gyro_bias_z"),
        units=("rad/s",) * 3,
        display_units=("deg/h",) * 3,
        values=generator.standard_normal(p) * 1e-6,
        covariance=root @ root.T,
        fit={"log_likelihood": 12.5, "nis_mean": 1.01, "nis_dof": 300, "held_out_rms": None},
        data={"samples": 10, "lost": 0, "rejected": 1, "duration_s": 7.0, "stops": 2},
        notes=("one", "two"),
        history=History(
            t=np.arange(1.0, m + 1),
            value=generator.standard_normal((m, p)),
            sigma=generator.random((m, p)),
            attitude_sigma=generator.random((m, 3)),
            stop=np.arange(m) // 4,
            dwell=np.arange(m) % 4 != 3,
            used=np.arange(m) % 4 == 1,
            nis=np.where(np.arange(m)[:, None] % 4 == 1, 3.0, np.nan) * np.ones((m, 4)),
        ),
        imu_noise=load_imu("mems_consumer").noise_alone,
    )


def no_constant(text: str) -> float:
    raise AssertionError(f"{text} is not JSON")


def test_a_result_comes_back_to_the_last_bit(tmp_path):
    written = calibration()
    write_result(tmp_path / "result.json", written)
    again = read_result(tmp_path)
    assert np.array_equal(again.values, written.values)
    assert np.array_equal(again.covariance, written.covariance)
    for entry in fields(History):
        left, right = getattr(again.history, entry.name), getattr(written.history, entry.name)
        assert left.dtype == right.dtype
        assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f")
    assert replace(again, values=0, covariance=0, history=0) == replace(written, values=0, covariance=0, history=0)


def test_the_file_has_the_fixed_keys_and_no_nan(tmp_path):
    broken = replace(calibration(), fit={"log_likelihood": float("nan"), "held_out_rms": float("inf")})
    write_result(tmp_path / "result.json", broken)
    content = json.loads((tmp_path / "result.json").read_text(), parse_constant=no_constant)
    assert content["format"] == "sdimu-result/1"
    assert {"body_frame", "model", "coefficients", "covariance", "fit", "data"} <= content.keys()
    first = content["coefficients"][0]
    assert (first["name"], first["unit"]) == ("gyro_bias_x", "rad/s")
    assert first["sigma"] == pytest.approx(content["covariance"][0][0] ** 0.5, rel=1e-12)
    assert content["fit"] == {"log_likelihood": None, "held_out_rms": None}


def test_a_result_with_the_fixed_keys_only_can_be_read(tmp_path):
    write_result(tmp_path / "result.json", calibration())
    content = json.loads((tmp_path / "result.json").read_text())
    del content["history"], content["notes"]
    for coefficient in content["coefficients"]:
        del coefficient["display_unit"]
    (tmp_path / "result.json").write_text(json.dumps(content))
    again = read_result(tmp_path)
    assert len(again.history.t) == 0
    assert again.display_units == again.units


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"format": "sdimu-result/9"}', '{"format": "sdimu-result/1", "coefficients": [{}]}']
)
def test_what_is_no_result_is_told_in_one_line(tmp_path, text):
    (tmp_path / "result.json").write_text(text)
    with pytest.raises(DataError) as error:
        read_result(tmp_path)
    assert str(tmp_path / "result.json") in str(error.value)
    assert "\n" not in str(error.value)


def test_a_failed_write_leaves_the_old_file(tmp_path):
    write_result(tmp_path / "result.json", calibration())
    before = (tmp_path / "result.json").read_bytes()
    with pytest.raises(TypeError):
        write_result(tmp_path / "result.json", replace(calibration(), notes=(object(),)))
    assert (tmp_path / "result.json").read_bytes() == before


def test_the_noise_of_the_imu_is_kept_with_its_units_and_refused_where_it_is_none(tmp_path):
    write_result(tmp_path / "result.json", calibration())
    content = json.loads((tmp_path / "result.json").read_text())
    kept, imu = content["imu_noise"], load_imu("mems_consumer")
    assert kept["gyro_white_noise_rad_s_sqrt_hz"] == imu.gyro_white_noise
    assert kept["accel_random_walk_m_s2_sqrt_s"] == imu.accel_random_walk
    for wrong in (-1.0, None, "loud"):
        kept["gyro_white_noise_rad_s_sqrt_hz"] = wrong
        (tmp_path / "result.json").write_text(json.dumps(content))
        with pytest.raises(DataError, match=r"result\.json: not a complete"):
            read_result(tmp_path / "result.json")
    del content["imu_noise"]
    (tmp_path / "result.json").write_text(json.dumps(content))
    assert read_result(tmp_path / "result.json").imu_noise is None


def test_a_file_that_is_read_and_written_again_is_the_same(tmp_path):
    write_result(tmp_path / "result.json", calibration())
    write_result(tmp_path / "again.json", read_result(tmp_path / "result.json"))
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "result.json").read_bytes()


@pytest.mark.parametrize(
    ("key", "told"),
    [
        (("coefficients", 1, "value"), r"coefficients\.1\.value: "),
        (("covariance",), "covariance: "),
        (("data", "faults"), r"data\.faults: "),
        (("history", "nis"), r"history\.nis: "),
        (("origin", "start_ns"), r"origin\.start_ns: "),
        (("imu_noise", "gyro_quantisation_rad"), r"imu_noise\.gyro_quantisation_rad: "),
    ],
)
def test_what_is_wrong_in_a_result_is_told_with_its_key(tmp_path, key, told):
    write_result(tmp_path / "result.json", calibration())
    content = json.loads((tmp_path / "result.json").read_text())
    place = content
    for part in key[:-1]:
        place = place[part]
    place[key[-1]] = "loud"
    (tmp_path / "result.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match=rf"result\.json: not a complete sdimu-result/1 file \({told}"):
        read_result(tmp_path)


def _damaged(tmp_path, key, value):
    """Write a result with one entry replaced."""
    write_result(tmp_path / "result.json", calibration())
    content = json.loads((tmp_path / "result.json").read_text())
    place = content
    for part in key[:-1]:
        place = place[part]
    place[key[-1]] = value
    (tmp_path / "result.json").write_text(json.dumps(content))
    return tmp_path / "result.json"


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        (("coefficients", 1, "value"), True, "coefficients.1.value: "),
        (("coefficients", 1, "value"), "0.1", "coefficients.1.value: "),
        (("coefficients", 1, "unit"), "deg/h", "coefficients.1.unit: 'deg/h', expected 'rad/s'"),
        (("coefficients", 1, "unit"), "parsec", "coefficients.1.unit: 'parsec', expected"),
        (("coefficients", 1, "display_unit"), "ug", "coefficients.1.display_unit: 'ug' is no unit of what is in"),
        (("coefficients", 1, "display_unit"), "furlong", "unknown unit 'furlong'"),
        (("coefficients", 1, "name"), "gyro_bias_x", "coefficients.1.name: 'gyro_bias_x' is there twice"),
        (("covariance", 1), ["1", "2", "3"], "covariance: a list of numbers"),
        (("covariance", 1), [None, "2", "3"], "covariance: a list of numbers"),
        (("covariance", 1), [1.0], "covariance: a list of numbers"),
        (("covariance", 0, 0), -1.0, "covariance: a variance is below zero"),
        (("covariance", 0, 1), 1e3, "covariance: is not symmetric"),
        (
            ("covariance",),
            [[0.0, 1e3, 0.0], [1e3, 1.0, 0.0], [0.0, 0.0, 1.0]],
            "covariance: a covariance stands beside",
        ),
        (("covariance",), [[1.0] * 3, [1.0, 1e-3, 1.0], [1.0] * 3], "covariance: a correlation is beyond 1"),
        (
            ("covariance",),
            [[1.0, -0.9, -0.9], [-0.9, 1.0, -0.9], [-0.9, -0.9, 1.0]],
            "covariance: a variance is below zero along some direction",
        ),
        (("history", "stop"), [0.5] * 7, "history.stop: a list of numbers"),
        (("history", "stop"), [-1e308] * 7, "history.stop: a list of numbers"),
        (("history", "dwell"), [2] * 7, "history.dwell: a list of numbers"),
        (("fit", "held_out_rms"), [1, 2], "(fit.held_out_rms: a number is expected)"),
        (("fit", "held_out_rms"), "loud", "(fit.held_out_rms: a number is expected)"),
        (("fit", "nis_mean"), 10**400, "(fit.nis_mean: a number is expected that 64 bits can hold)"),
        (("fit", "held_out_rms"), True, "(fit.held_out_rms: a number is expected)"),
        (("data", "duration_s"), "600", "(data.duration_s: a number is expected)"),
    ],
)
def test_numbers_that_are_none_and_units_that_are_not_taken_are_refused(tmp_path, key, value, told):
    with pytest.raises(DataError, match=r"result\.json: not a complete sdimu-result/1 file") as error:
        read_result(_damaged(tmp_path, key, value))
    assert told in str(error.value)


@pytest.mark.parametrize(("start", "right"), [(-(10**7), True), (-(10**9), True), (-(10**18), False), (2**63, False)])
def test_a_recording_may_begin_an_interval_before_its_first_stamp_of_zero(tmp_path, start, right):
    path = _damaged(tmp_path, ("origin", "start_ns"), start)
    if right:
        assert read_result(path).origin.start_ns == start
    else:
        with pytest.raises(DataError, match="which is no stamp"):
            read_result(path)


@pytest.mark.parametrize("key", [("coefficients", 1, "value"), ("covariance", 1, 1), ("covariance", 1, 2)])
def test_a_value_that_is_no_number_is_read_but_not_used(tmp_path, key):
    path = _damaged(tmp_path, key, None)
    assert read_result(path).names[1] == "gyro_bias_y"
    with pytest.raises(DataError, match=r"result\.json: gyro_bias_y: its value or a covariance is no number"):
        read_judged_result(path)


@pytest.mark.parametrize("end", ["temperature_low_degc", "temperature_high_degc"])
def test_a_result_has_both_ends_of_its_temperatures_or_none(tmp_path, end):
    with pytest.raises(DataError, match=r"origin: temperature_low_degc and temperature_high_degc: a number") as error:
        read_result(_damaged(tmp_path, ("origin", end), 20.0))
    assert "\n" not in str(error.value)


def test_a_result_that_is_not_there_is_refused_with_what_makes_one(tmp_path):
    for place in (tmp_path / "nowhere", tmp_path):
        with pytest.raises(DataError, match=r"no such file \(expected a result.json or its folder, as sdimu calibrate"):
            read_result(place)
