"""What the command line takes where the user names nothing."""

from types import SimpleNamespace

import pytest

from sdimu_calibration.cli.options import imu_of


@pytest.mark.parametrize(("estimator", "name"), [("handheld", "mems_by_hand"), ("filter", "dtg"), ("", "dtg")])
def test_a_result_of_a_run_by_hand_has_no_noise_of_a_table_gyro(estimator, name):
    chosen, whose = imu_of(SimpleNamespace(estimator=estimator), None)
    assert chosen == name
    assert "no --imu is given" in whose
    assert imu_of(SimpleNamespace(estimator=estimator), "mine.yaml") == ("mine.yaml", "'mine.yaml' (--imu)")
