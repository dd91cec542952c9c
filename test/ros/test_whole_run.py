"""`sdimu run` and `sdimu replay` from end to end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message

from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.nodes.recorder_node import message_class
from sdimu_calibration.storage.bags.bag_file import raw_messages
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.files.result_file import read_result

from .conftest import DEADLINE_S, DWELL_S, RATE_HZ, Run, imu_stamps, runs, samples_of, sdimu

pytestmark = pytest.mark.ros

TYPES = {
    "/imu/data_raw": "sensor_msgs/msg/Imu",
    "/rate_table/status": "diagnostic_msgs/msg/DiagnosticArray",
    "/rate_table/joint_states": "sensor_msgs/msg/JointState",
    "/calibration/coefficients": "sensor_msgs/msg/JointState",
    "/calibration/covariance": "std_msgs/msg/Float64MultiArray",
    "/calibration/navigation": "nav_msgs/msg/Odometry",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}


def test_a_run_loses_nothing(whole_run: Run) -> None:
    stamps = imu_stamps(whole_run.folder / "bag")
    assert len(stamps) == samples_of(DWELL_S)
    assert set(np.diff(stamps)) == {10**9 // RATE_HZ}
    assert f"{len(stamps)} samples recorded, 0 lost" in " ".join(whole_run.output.split())


def test_a_run_leaves_bag_result_report_and_truth(whole_run: Run) -> None:
    left = {path.name for path in whole_run.folder.iterdir()}
    assert {"bag", "result.json", "report.html", "truth.yaml", "plan.yaml"} <= left
    first = whole_run.folder
    ran, written = (load_plan(str(folder / "plan.yaml")) for folder in (first.parent, first))
    assert (written.dwell_s, written.turns) == (ran.dwell_s, ran.turns)


def test_two_runs_at_once_with_one_seed_record_the_same(tmp_path: Path) -> None:
    # Without a diagnosis, which costs each run a process: what it publishes is none of these topics.
    both = runs(tmp_path, 2, 20.0, "--no-diagnose")
    first, second = (raw_messages(run.folder / "bag", TYPES, "/imu/data_raw") for run in both)
    assert first.keys() == TYPES.keys()
    for topic, type_name in TYPES.items():
        kind = message_class(type_name)
        # Decoded: the bytes with which DDS pads strings are whatever was in memory.
        pairs = zip(first[topic], second[topic], strict=True)
        differ = [k for k, (a, b) in enumerate(pairs) if deserialize_message(a, kind) != deserialize_message(b, kind)]
        assert not differ, topic


def test_live_estimates_come_once_a_second_of_data(whole_run: Run) -> None:
    found = raw_messages(whole_run.folder / "bag", TYPES, "/imu/data_raw")
    seconds = samples_of(DWELL_S) // RATE_HZ
    assert len(found["/diagnostics"]) == seconds
    # The last word, from all passes over the whole test, comes on top.
    assert len(found["/calibration/coefficients"]) == len(found["/calibration/covariance"]) == seconds + 1


def test_the_last_live_result_is_the_offline_one(whole_run: Run) -> None:
    live = read_result(whole_run.folder / "result.json")
    recording = read_recording(whole_run.folder / "bag")
    offline = calibrate(recording, load_site("daejeon"), load_imu("dtg"), load_model("baseline"))
    np.testing.assert_array_equal(live.values, offline.values)
    np.testing.assert_array_equal(live.covariance, offline.covariance)


def test_replay_gives_the_same_result(whole_run: Run, tmp_path: Path) -> None:
    process = sdimu("replay", whole_run.folder / "bag", "--out", tmp_path / "replay", "--patience", DEADLINE_S)
    _, err = process.communicate(timeout=DEADLINE_S + 10.0)
    assert process.returncode == 0, err
    live, again = read_result(whole_run.folder / "result.json"), read_result(tmp_path / "replay" / "result.json")
    np.testing.assert_array_equal(live.values, again.values)
    np.testing.assert_array_equal(live.covariance, again.covariance)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("run", "--plan", "nowhere"), "nowhere"),
        (("run", "--rate", "5"), "rate"),
        (("run", "--effect", "accel_quadratic_x=20 deg"), "accel_quadratic_x"),
        (("replay", "nowhere.mcap"), "nowhere.mcap"),
    ],
)
def test_unusable_options_are_one_line_and_status_1(arguments: tuple[str, ...], word: str, tmp_path: Path) -> None:
    process = sdimu(*arguments, "--out", tmp_path / "out")
    _, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 1
    assert len(err.splitlines()) == 1
    assert word in err
