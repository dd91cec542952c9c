"""Goal files: what is wrong with one is said with file and key."""

import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.goal_file import load_goals


@pytest.mark.parametrize("text", ["0.016 ppm", "0.016", "small"])
def test_a_wrong_unit_names_file_and_key(tmp_path, text):
    path = tmp_path / "goals.yaml"
    path.write_text(f"format: sdimu-goal/1\nlimits: {{gyro_bias: '{text}'}}\n")
    with pytest.raises(DataError) as refused:
        load_goals(path)
    assert str(refused.value).startswith(f"{path}: limits.gyro_bias: '{text}'")


@pytest.mark.parametrize("minutes", ["1e300", "20160", ".inf", "0"])
def test_a_test_that_would_not_end_is_refused(tmp_path, minutes):
    path = tmp_path / "goal.yaml"
    path.write_text(f"format: sdimu-goal/1\nminutes: {minutes}\nlimits: {{gyro_bias: 0.016 deg/h}}\n")
    with pytest.raises(DataError, match="minutes: "):
        load_goals(path)


def test_a_name_that_a_terminal_would_obey_is_written_out(tmp_path):
    path = tmp_path / "goal.yaml"
    path.write_text('format: sdimu-goal/1\nname: "quick\\n\\e[31mred"\nlimits: {gyro_bias: 0.016 deg/h}\n')
    name = load_goals(path).name
    assert name.isprintable()
    assert name.startswith("quick")


def test_one_sense_of_turn_is_enough_only_where_the_file_says_so(tmp_path):
    path = tmp_path / "goal.yaml"
    path.write_text("format: sdimu-goal/1\nlimits: {gyro_scale: 5 ppm}\n")
    assert load_goals(path).both_senses
    path.write_text("format: sdimu-goal/1\nboth_senses: false\nlimits: {gyro_scale: 5 ppm}\n")
    assert not load_goals(path).both_senses
