"""Unit and power-on go from the bag through the recording into result.json, whatever is done to the bag."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.core.origin import Origin, measured
from sdimu_calibration.core.recording import Recording, TemperatureLog
from sdimu_calibration.storage.bags.bag_metadata import custom_data
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cut_bag import cut_bag
from sdimu_calibration.storage.bags.recover import recover
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_calibration.storage.opening import said_of


@pytest.fixture
def bag(tmp_path):
    n = 1000
    rng = np.random.default_rng(1)
    write_recording(
        tmp_path / "bag",
        BagContent(
            start_ns=10**18,
            imu_ns=np.arange(1, n + 1) * 10**7,
            omega_ib_b=1e-4 * rng.standard_normal((n, 3)),
            f_ib_b=rng.standard_normal((n, 3)),
        ),
        custom={"serial": "SN 17", "power_on": "3", "room": "B"},
    )
    return tmp_path / "bag"


def test_the_bag_says_of_which_unit_and_power_on_it_is(bag):
    file = str(Path("config/site/daejeon.yaml").resolve())
    assert said_of(bag, file) == Origin("SN 17", "3", recording="bag", site="daejeon", site_file=file)


def test_a_serial_of_digits_keeps_its_zeros(bag):
    path = bag / "metadata.yaml"
    path.write_text(path.read_text().replace("serial: SN 17", "serial: 007"))
    assert said_of(bag, "").serial == "007"


def test_a_part_and_a_mended_bag_say_the_same(bag, tmp_path):
    cut_bag(bag, tmp_path / "part", 2.0, 5.0)
    recover(bag)
    assert custom_data(tmp_path / "part") == custom_data(bag) == {"serial": "SN 17", "power_on": "3", "room": "B"}


def test_a_file_without_metadata_says_nothing_of_the_unit(bag):
    origin = said_of(next(bag.glob("*.mcap")), "")
    assert (origin.serial, origin.power_on, origin.recording) == ("", "", "bag_0.mcap")


def test_what_the_user_states_goes_before_what_the_bag_says():
    said = Origin("A", "1").stated("B", None)
    assert (said.serial, said.power_on) == ("B", "1")


def test_start_temperature_and_rate_come_from_the_recording():
    n = 400
    omega = np.zeros((n, 3))
    omega[100:300, 2] = 0.1
    omega[350] = 5.0  # one spike is no rate
    heat = TemperatureLog(np.arange(4.0), np.array([20.0, 22.0, 24.0, 26.0]))
    recording = Recording(77, 0.01 * np.arange(1, n + 1), omega, np.ones((n, 3)), temperature=heat)
    origin = measured(Origin("A"), recording, "dtg")
    assert (origin.start_ns, origin.imu, origin.serial) == (77, "dtg", "A")
    assert (origin.temperature_degc, origin.temperature_low_degc, origin.temperature_high_degc) == (23.0, 20.0, 26.0)
    assert origin.rate_rad_s == pytest.approx(0.1)


def test_without_a_thermometer_the_temperature_is_unknown():
    recording = Recording(77, 0.01 * np.arange(1, 401), np.zeros((400, 3)), np.ones((400, 3)))
    assert math.isnan(measured(Origin(), recording, "dtg").temperature_degc)


def test_the_origin_of_a_result_comes_back_and_older_files_have_none(tmp_path, small_result):
    origin = Origin("A", "2", 10**18 + 1, 21.5, recording="bag", imu="dtg")
    write_result(tmp_path / "result.json", replace(small_result, origin=origin))
    assert read_result(tmp_path).origin == origin
    content = json.loads((tmp_path / "result.json").read_text())
    del content["origin"]
    (tmp_path / "result.json").write_text(json.dumps(content))
    assert read_result(tmp_path).origin == Origin()
