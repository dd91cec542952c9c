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

from .conftest import DEADLINE_S, DWELL_S, RATE_HZ, Twins, imu_stamps, samples_of, sdimu

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


def test_a_run_loses_nothing(twins: Twins) -> None:
    stamps = imu_stamps(twins.folders[0] / "bag")
    assert len(stamps) == samples_of(DWELL_S)
    assert set(np.diff(stamps)) == {10**9 // RATE_HZ}
    assert f"{len(stamps)} samples recorded, 0 lost" in " ".join(twins.outputs[0].split())


def test_a_run_leaves_bag_result_report_and_truth(twins: Twins) -> None:
    left = {path.name for path in twins.folders[0].iterdir()}
    assert {"bag", "result.json", "report.html", "truth.yaml", "plan.yaml"} <= left
    first = twins.folders[0]
    ran, written = (load_plan(str(folder / "plan.yaml")) for folder in (first.parent, first))
    assert (written.dwell_s, written.turns) == (ran.dwell_s, ran.turns)


def test_two_runs_at_once_with_one_seed_record_the_same(twins: Twins) -> None:
    first, second = (raw_messages(folder / "bag", TYPES, "/imu/data_raw") for folder in twins.folders)
    assert first.keys() == TYPES.keys()
    for topic, type_name in TYPES.items():
        kind = message_class(type_name)
        # Decoded: the bytes with which DDS pads strings are whatever was in memory.
        pairs = zip(first[topic], second[topic], strict=True)
        differ = [k for k, (a, b) in enumerate(pairs) if deserialize_message(a, kind) != deserialize_message(b, kind)]
        assert not differ, topic


def test_live_estimates_come_once_a_second_of_data(twins: Twins) -> None:
    found = raw_messages(twins.folders[0] / "bag", TYPES, "/imu/data_raw")
    seconds = samples_of(DWELL_S) // RATE_HZ
    assert len(found["/diagnostics"]) == seconds
    # The last word, from all passes over the whole test, comes on top.
    assert len(found["/calibration/coefficients"]) == len(found["/calibration/covariance"]) == seconds + 1


def test_the_last_live_result_is_the_offline_one(twins: Twins) -> None:
    live = read_result(twins.folders[0] / "result.json")
    recording = read_recording(twins.folders[0] / "bag")
    offline = calibrate(recording, load_site("daejeon"), load_imu("dtg"), load_model("baseline"))
    np.testing.assert_array_equal(live.values, offline.values)
    np.testing.assert_array_equal(live.covariance, offline.covariance)


def test_replay_gives_the_same_result(twins: Twins, tmp_path: Path) -> None:
    process = sdimu("replay", twins.folders[0] / "bag", "--out", tmp_path / "replay", "--patience", DEADLINE_S)
    _, err = process.communicate(timeout=DEADLINE_S + 10.0)
    assert process.returncode == 0, err
    live, again = read_result(twins.folders[0] / "result.json"), read_result(tmp_path / "replay" / "result.json")
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
    _, err = process.communicate(timeout=30.0)
    assert process.returncode == 1
    assert len(err.splitlines()) == 1
    assert word in err
