"""`sdimu compensate`: a bag in, a bag out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.cli.compensate import compensate
from sdimu_calibration.core.compensation import compensate as in_core
from sdimu_calibration.core.compensation import compensator
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.storage.bags.bag_file import raw_messages
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cdr import IMU, decode_doubles
from sdimu_calibration.storage.bags.topic_choice import Topics
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.result_file import write_result


def result(*effects: str) -> Calibration:
    found = [selection.resolve(name) for name in effects]
    parameters = [p for e in found for p in e.parameters]
    values = 1e-4 * np.random.default_rng(1).standard_normal(len(parameters))
    return Calibration(
        "accelerometer_triad",
        tuple(effects),
        tuple(p.name for p in parameters),
        tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters),
        values,
        np.diag(np.full(len(values), 1e-14)),
        {},
        {"start_temperature_degc": 20.0},
        (),
        no_history(len(values)),
    )


def test_a_compensated_bag_has_every_sample_and_the_other_topics_as_they_were(bag: Path, tmp_path: Path) -> None:
    made = result("gyro_bias", "gyro_scale", "accel_bias", "accel_scale", "accel_bias_temperature", "accel_quadratic")
    write_result(tmp_path / "result.json", made)
    compensate(bag, result=tmp_path / "result.json", out=tmp_path / "new")
    raw = read_recording(bag)
    new = read_recording(tmp_path / "new", Topics(imu="/imu/data"))
    assert new.start_ns == raw.start_ns
    np.testing.assert_array_equal(new.t, raw.t)
    assert raw.phase is not None and new.phase is not None  # noqa: PT018
    np.testing.assert_array_equal(new.phase.stop, raw.phase.stop)
    assert raw.temperature is not None and new.temperature is not None  # noqa: PT018
    np.testing.assert_array_equal(new.temperature.value, raw.temperature.value)
    using = compensator(made, load_imu("dtg"), has_temperature=True)
    heat = np.interp(raw.t - 0.005, raw.temperature.t, raw.temperature.value) - 20.0
    expected = in_core(using, raw.t, 0.01, raw.omega_ib_b, raw.f_ib_b, (heat, 0 * heat))
    np.testing.assert_allclose(new.omega_ib_b, expected.omega_ib_b, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(new.f_ib_b, expected.f_ib_b, rtol=1e-12, atol=1e-12)
    _, doubles = decode_doubles(raw_messages(tmp_path / "new", {"/imu/data": IMU}, "/imu/data")["/imu/data"], 37)
    np.testing.assert_allclose(doubles[:, 28:37], expected.f_covariance.reshape(-1, 9), rtol=1e-9, atol=1e-25)


def test_a_result_that_is_none_is_one_line(bag: Path, tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}", encoding="utf-8")
    with pytest.raises(DataError, match=r"result\.json: format is None"):
        compensate(bag, result=tmp_path / "result.json", out=tmp_path / "new")


def test_a_bag_with_topics_of_other_names_is_compensated_too(tmp_path: Path, small_test) -> None:
    write_recording(
        tmp_path / "other",
        BagContent(
            start_ns=10**18,
            imu_ns=small_test.ns,
            omega_ib_b=small_test.omega_ib_b,
            f_ib_b=small_test.f_ib_b,
            temperature=(small_test.slow_ns, small_test.temperature),
        ),
        topics=Topics(imu="/xsens/imu", temperature="/xsens/warmth"),
    )
    write_result(tmp_path / "result.json", result("gyro_bias", "accel_bias"))
    compensate(tmp_path / "other", result=tmp_path / "result.json", out=tmp_path / "new")
    new = read_recording(tmp_path / "new", Topics(imu="/imu/data", temperature="/xsens/warmth"))
    assert len(new.t) == len(small_test.ns)
    assert new.temperature is not None
    np.testing.assert_array_equal(new.temperature.value, small_test.temperature)


def test_the_covariances_have_the_noise_of_the_calibration_and_of_another_imu_on_demand(bag, tmp_path, capsys):
    mems = replace(result("gyro_bias", "accel_bias"), imu_noise=load_imu("mems_consumer").noise_alone)
    write_result(tmp_path / "result.json", mems)

    def variance(name: str, **options) -> float:
        compensate(bag, result=tmp_path / "result.json", out=tmp_path / name, **options)
        _, doubles = decode_doubles(raw_messages(tmp_path / name, {"/imu/data": IMU}, "/imu/data")["/imu/data"], 37)
        return float(doubles[5, 16])

    own, other = variance("own"), variance("other", imu="dtg")
    assert "'mems_consumer', with which the result was calibrated" in capsys.readouterr().out
    ratio = load_imu("mems_consumer").gyro_white_noise / load_imu("dtg").gyro_white_noise
    assert own / other == pytest.approx(ratio**2, rel=0.05)
