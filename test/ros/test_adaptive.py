"""A test that chooses its turns, over DDS: choices with reasons, limits that hold, a bag that gives the result anew."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sdimu_calibration.core.adaptive import Goals
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.files.goal_file import load_goals
from sdimu_calibration.storage.files.json_file import read_json
from sdimu_calibration.storage.files.result_file import read_result
from sdimu_calibration.storage.opening import open_test

from .conftest import DEADLINE_S, sdimu

pytestmark = pytest.mark.ros

GOALS = """format: sdimu-goal/1
name: coarse
minutes: 6
limits: {gyro_bias: 0.05 deg/h, accel_bias: 10 ug, accel_scale: 15 ppm}
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Goals, str]:
    folder = tmp_path_factory.mktemp("adaptive")
    goals = folder / "coarse.yaml"
    goals.write_text(GOALS, encoding="utf-8")
    process = sdimu("run", "--adaptive", goals, "--rate", 20, "--seed", 7, "--no-diagnose", "--out", folder / "run")
    try:
        out, err = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
    assert process.returncode in {0, 3}, err
    result = read_result(folder / "run" / "result.json")
    assert process.returncode == (3 if result.misfits or result.not_to_be_trusted else 0), err
    assert "were not reached" not in err
    return folder / "run", load_goals(goals), out


def test_every_choice_is_kept_and_printed_with_its_reason_and_the_last_one_ends_the_test(done):
    folder, _, out = done
    choices = read_json(folder / "choices.json", "sdimu-choices/1")["choices"]
    assert len(choices) >= 3
    for choice in choices:
        assert choice["text"] in out
    for choice in choices[:-1]:
        assert "of its limit" in choice["reason"]
    assert choices[-1]["step"] is None
    assert choices[-1]["reached"]
    # Each look is at everything that the moves before it brought.
    times = [choice["until_s"] for choice in choices]
    turned = [
        (abs(c["step"]["turn"]["angle_rad"]) / c["step"]["turn"]["rate_rad_s"] if c["step"]["turn"] else 0.0)
        + c["step"]["dwell_s"]
        for c in choices[:-1]
    ]
    np.testing.assert_allclose(np.diff(times), turned, atol=1.5)


def test_the_limits_hold_by_the_result_and_the_bag_gives_it_again_to_the_last_digit(done):
    folder, goals, _ = done
    live = read_result(folder / "result.json")
    limited, limit = goals.of(live.names, live.body_frame)
    assert (np.sqrt(np.diag(live.covariance))[limited] <= limit).all()
    test = open_test(folder / "bag", "daejeon", load_imu("dtg"))
    again = outcome(solve(test, load_model("baseline")))
    np.testing.assert_array_equal(again.values, live.values)


def test_a_test_that_ends_without_its_limits_says_so_with_its_exit_status(tmp_path):
    goals = tmp_path / "hopeless.yaml"
    limits = "limits: {gyro_bias: 1e-6 deg/h}"
    goals.write_text(f"format: sdimu-goal/1\nname: hopeless\nminutes: 1\n{limits}\n", encoding="utf-8")
    process = sdimu("run", "--adaptive", goals, "--rate", 20, "--no-diagnose", "--out", tmp_path / "run")
    try:
        _, err = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
    last = read_json(tmp_path / "run" / "choices.json", "sdimu-choices/1")["choices"][-1]
    assert process.returncode == 3
    assert "were not reached" in err
    assert last["text"] in err


def test_what_was_found_for_sure_is_in_the_result_whose_limits_hold(tmp_path):
    """Else the result has the limits of no model: its noise takes in what was found, and its sigmas are larger."""
    goals = tmp_path / "coarse.yaml"
    goals.write_text(GOALS, encoding="utf-8")
    effect = ("--effect", "accel_quadratic_z=400 ug/g^2")
    out = tmp_path / "run"
    process = sdimu("run", "--adaptive", goals, "--rate", 20, "--seed", 8, *effect, "--out", out)
    try:
        told, err = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
    assert process.returncode in {0, 3}, err
    last = read_json(out / "choices.json", "sdimu-choices/1")["choices"][-1]
    assert last["reached"], told + err
    assert last["decided"] == ["accel_quadratic_z"]
    live = read_result(out / "result.json")
    assert "accel_quadratic_z" in live.names, err
    limited, limit = load_goals(goals).of(live.names, live.body_frame)
    assert (np.sqrt(np.diag(live.covariance))[limited] <= limit).all()
    found = read_json(out / "diagnosis.json", "sdimu-diagnosis/1")
    # The diagnosis is of the model that the result has.
    assert "accel_quadratic_z" in found["fit"]["before"]["model"]
    assert "accel_quadratic_z" not in {one["label"] for one in found["candidates"]}
