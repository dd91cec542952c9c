"""Temperature files."""

import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_sim.temperature_file import load_temperature


def test_the_profiles_that_come_along_load():
    assert load_temperature("constant").rise == 0.0
    assert load_temperature("warm-up").rise == 8.0


def test_a_wrong_unit_is_named(tmp_path):
    path = tmp_path / "hot.yaml"
    path.write_text("start: 25 deg\n")
    with pytest.raises(DataError, match=r"hot.yaml: start: .*degC"):
        load_temperature(path)
