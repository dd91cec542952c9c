"""`sdimu noise` and ``--noise estimated``."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.cli.noise import noise
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.noise import with_measured_noise
from sdimu_calibration.core.units import from_si, to_si
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.noise_terms_file import read_noise_terms

DT = 0.02
GYRO, ACCEL = to_si(3.0, "deg/h/sqrt(Hz)"), to_si(50.0, "ug/sqrt(Hz)")


@pytest.fixture
def still(tmp_path: Path) -> Path:
    """A bag of five minutes at rest with white noise."""
    rng = np.random.default_rng(6)
    n = round(300.0 / DT)
    force = ACCEL / np.sqrt(DT) * rng.standard_normal((n, 3)) + np.array([0.0, 0.0, -9.8])
    write_recording(
        tmp_path / "still",
        BagContent(
            start_ns=10**18,
            imu_ns=np.arange(1, n + 1) * round(DT * 1e9),
            omega_ib_b=GYRO / np.sqrt(DT) * rng.standard_normal((n, 3)),
            f_ib_b=force,
        ),
    )
    return tmp_path / "still"


def test_the_file_written_is_an_imu_with_the_noise_of_the_recording(still: Path, tmp_path: Path) -> None:
    noise(still, imu="dtg", out=tmp_path / "out")
    found, base = load_imu(tmp_path / "out" / "imu.yaml"), load_imu("dtg")
    # 298 s at 1 s of three axes: 1 / sqrt(2 * 3 * 298) = 2.4 %; four of them.
    assert found.gyro_white_noise == pytest.approx(GYRO, rel=0.1)
    assert found.accel_white_noise == pytest.approx(ACCEL, rel=0.1)
    assert found.prior == base.prior
    # Of which unit, IMU and day it is, as result.json has it: a data sheet takes it for that unit alone.
    origin = read_noise_terms(tmp_path / "out").origin
    assert (origin.serial, origin.imu, origin.recording, origin.start_ns > 0) == ("", "dtg", "still", True)
    noise(still, imu="dtg", serial="SN1", out=tmp_path / "out")
    assert read_noise_terms(tmp_path / "out").origin.serial == "SN1"
    page = (tmp_path / "out" / "noise.html").read_text()
    assert "white noise" in page
    assert "plotly" in page


def test_on_a_base_that_rocks_the_file_obeys_the_limits_that_are_printed(tmp_path: Path, capsys) -> None:
    """A ring laser gyro on such a base was written with 33 deg/h/sqrt(Hz) beside limits of 6, 16 and 23."""
    rng = np.random.default_rng(8)
    n = round(300.0 / DT)
    t = np.arange(1, n + 1) * DT
    rate = GYRO / np.sqrt(DT) * rng.standard_normal((n, 3))
    rate += to_si(60.0, "deg/h") * np.sin(2.0 * np.pi * np.outer(t, [0.25, 0.3, 0.35]))
    force = ACCEL / np.sqrt(DT) * rng.standard_normal((n, 3)) + np.array([0.0, 0.0, -9.8])
    stamps = np.arange(1, n + 1) * round(DT * 1e9)
    write_recording(tmp_path / "rocks", BagContent(start_ns=10**18, imu_ns=stamps, omega_ib_b=rate, f_ib_b=force))
    noise(tmp_path / "rocks", imu="dtg", out=tmp_path / "out")
    told = capsys.readouterr().out
    limits = [float(line.split("<")[1].split()[0]) for line in told.splitlines() if re.match(" gyro_. +white", line)]
    found = from_si(load_imu(tmp_path / "out" / "imu.yaml").gyro_white_noise, "deg/h/sqrt(Hz)")
    assert found <= 1.05 * np.sqrt(np.mean(np.square(limits)))
    assert "what was taken for rest is none: the base rocks or vibrates (gyro_x, gyro_y, gyro_z)" in told
    assert "is an upper limit" in (tmp_path / "out" / "imu.yaml").read_text()


def test_pulses_and_wandering_bias_go_into_the_file(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    n = round(2000.0 / DT)
    pulse, walk = to_si(1.0, "arcsec"), to_si(20.0, "deg/h/sqrt(h)")
    rate = GYRO / np.sqrt(DT) * rng.standard_normal((n, 3))
    rate += to_si(10.0, "deg/h") + walk * np.sqrt(DT) * np.cumsum(rng.standard_normal((n, 3)), axis=0)
    counted = np.diff(pulse * np.round(np.cumsum(rate * DT, axis=0) / pulse), axis=0, prepend=0.0) / DT
    force = ACCEL / np.sqrt(DT) * rng.standard_normal((n, 3)) + np.array([0.0, 0.0, -9.8])
    write_recording(
        tmp_path / "still",
        BagContent(start_ns=10**18, imu_ns=np.arange(1, n + 1) * round(DT * 1e9), omega_ib_b=counted, f_ib_b=force),
    )
    noise(tmp_path / "still", out=tmp_path / "out")
    found = load_imu(tmp_path / "out" / "imu.yaml")
    assert found.gyro_quantisation == pytest.approx(pulse / np.sqrt(12.0), rel=0.1)
    assert found.gyro_random_walk == pytest.approx(walk, rel=0.4)
    assert found.accel_quantisation == 0.0


def test_estimated_noise_replaces_that_of_the_specification_and_says_so(still: Path) -> None:
    recording = read_recording(still)
    imu, note = with_measured_noise(load_imu("dtg"), recording)
    assert imu.gyro_white_noise == pytest.approx(GYRO, rel=0.1)
    assert "0.1 as specified" in note


def test_grade_and_priors_are_taken_from_an_imu_file_alone(still: Path, tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text("format: sdimu-imu/1\nname: no noise\n")
    with pytest.raises(DataError, match=r"other\.yaml: noise: missing key"):
        noise(still, imu=str(tmp_path / "other.yaml"), out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
