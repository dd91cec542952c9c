"""Whose noise goes with a result: what the user names, else the calibration's own, else a usual IMU's."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from sdimu_calibration.core.origin import Origin
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.result_file import noise_for


@pytest.mark.parametrize(("estimator", "name"), [("handheld", "mems_by_hand"), ("filter", "dtg"), ("", "dtg")])
def test_a_run_by_hand_without_noise_of_its_own_has_no_noise_of_a_table_gyro(estimator, name):
    older = SimpleNamespace(estimator=estimator, imu_noise=None, origin=Origin(imu="mine"))
    assert noise_for(older, None)[0] == load_imu(name)
    assert "no --imu is given" in noise_for(older, None)[1]
    assert noise_for(older, "fog_tactical") == (load_imu("fog_tactical"), "'fog_tactical' (--imu)")


def test_a_result_brings_the_noise_with_which_it_was_calibrated():
    mine = load_imu("mems_consumer").noise_alone
    result = SimpleNamespace(estimator="filter", imu_noise=mine, noise=())
    for nobody in (None, ""):
        specification, whose = noise_for(result, nobody)
        assert specification == mine
        assert "mems_consumer" in whose
    assert noise_for(result, "dtg")[0] == load_imu("dtg")


def test_an_older_result_has_the_noise_of_the_imu_that_it_names():
    older = SimpleNamespace(estimator="filter", imu_noise=None, origin=Origin(imu="mems_industrial"))
    specification, whose = noise_for(older, None)
    assert specification == load_imu("mems_industrial")
    assert "the IMU that the result names" in whose
