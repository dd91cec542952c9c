"""Bags we write are bags for everyone."""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_folder import file_states
from sdimu_calibration.storage.bags.mcap_bag import McapBag

TYPES = get_typestore(Stores.ROS2_JAZZY)
START_NS = 1_700_000_000_000_000_000
TOPICS = {"/imu/data_raw", "/rate_table/status", "/rate_table/joint_states", "/imu/temperature"}


def test_rosbags_reads_every_message_of_the_folder_with_its_numbers(bag, small_test):
    with Reader(bag) as reader:
        messages = [(c, t, TYPES.deserialize_cdr(raw, c.msgtype)) for c, t, raw in reader.messages()]
        assert reader.message_count == len(messages)
    assert {c.topic for c, _, _ in messages} == TOPICS
    imu = [m for c, _, m in messages if c.topic == "/imu/data_raw"]
    rate = [[m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z] for m in imu]
    force = [[m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z] for m in imu]
    assert np.array_equal(rate, small_test.omega_ib_b)
    assert np.array_equal(force, small_test.f_ib_b)
    assert all(m.orientation_covariance[0] == -1 for m in imu)
    joints = [m for c, _, m in messages if c.topic == "/rate_table/joint_states"]
    assert tuple(joints[0].name) == small_test.names
    assert np.array_equal([m.position for m in joints], small_test.angle)
    assert np.array_equal([m.velocity for m in joints], small_test.rate)
    status = [m for c, _, m in messages if c.topic == "/rate_table/status"]
    said = [{entry.key: entry.value for entry in m.status[0].values} for m in status]
    assert [s["phase"] == "dwell" for s in said] == small_test.dwell.tolist()
    assert [m.status[0].message for m in status] == [s["phase"] for s in said]
    assert [int(s["stop"]) for s in said] == small_test.stop.tolist()


def test_mcap_reads_it_by_its_index_and_finds_stamps_in_order(bag):
    with next(bag.glob("*.mcap")).open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
        assert reader.get_header().profile == "ros2"
    assert summary.statistics.message_count == len(times)
    assert times == sorted(times)
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (times[0], times[-1])


def test_mcap_ros2_support_decodes_it_with_the_schemas_in_the_file(bag, small_test):
    found = list(read_ros2_messages(next(bag.glob("*.mcap"))))
    counts = Counter(m.channel.topic for m in found)
    assert set(counts) == TOPICS
    assert counts["/imu/data_raw"] == len(small_test.ns)
    temperatures = [m.ros_msg.temperature for m in found if m.channel.topic == "/imu/temperature"]
    assert temperatures == small_test.temperature.tolist()


def test_ros_deserializes_our_bytes_and_we_decode_its_own(bag, small_test):
    serialization = pytest.importorskip("rclpy.serialization")
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import Imu, JointState, Temperature

    types = {c.__name__: c for c in (DiagnosticArray, Imu, JointState, Temperature)}
    again: dict[str, list[bytes]] = {}
    with Reader(bag) as reader:
        for connection, _, raw in reader.messages():
            name = connection.msgtype.rpartition("/")[2]
            message = serialization.deserialize_message(raw, types[name])
            # ROS leaves whatever was in memory between fields, and pads the end: its bytes are not ours.
            data = serialization.serialize_message(message)
            assert serialization.deserialize_message(data, types[name]) == message
            again.setdefault(name, []).append(data)
    assert again.keys() == types.keys()
    assert np.array_equal(cdr.decode_imu(again["Imu"])[1], small_test.omega_ib_b)
    assert np.array_equal(cdr.decode_doubles(again["Temperature"], 2)[1][:, 0], small_test.temperature)
    ns, angle = cdr.decode_joint_positions(again["JointState"], small_test.names, small_test.angle[0])
    assert np.array_equal(angle, small_test.angle)
    assert np.array_equal(ns - START_NS, small_test.ns)


def test_qos_in_the_metadata_is_that_of_the_channels(bag):
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    said = {
        entry["topic_metadata"]["name"]: entry["topic_metadata"]["offered_qos_profiles"]
        for entry in information["topics_with_message_count"]
    }
    with next(bag.glob("*.mcap")).open("rb") as stream:
        channels = make_reader(stream).get_summary().channels.values()
        assert {c.topic: yaml.safe_load(c.metadata["offered_qos_profiles"]) for c in channels} == said


def test_a_topic_without_messages_is_still_announced(tmp_path):
    with McapBag(tmp_path / "b") as bag:
        bag.topic("/imu/data_raw", "sensor_msgs/msg/Imu")
    with Reader(tmp_path / "b") as reader:
        assert [c.topic for c in reader.connections] == ["/imu/data_raw"]


def test_a_bag_is_not_overwritten_unless_told_to(bag):
    with pytest.raises(DataError, match="already there"):
        McapBag(bag)
    McapBag(bag, replace=True).close()


def test_a_folder_of_other_things_is_never_replaced(tmp_path):
    (tmp_path / "thesis.tex").write_text("years")
    with pytest.raises(DataError, match="not a bag"):
        McapBag(tmp_path, replace=True)
    assert (tmp_path / "thesis.tex").exists()


def test_an_unknown_type_names_the_package_to_install(tmp_path: Path):
    with McapBag(tmp_path / "b") as bag, pytest.raises(DataError, match="no_such_msgs"):
        bag.topic("/x", "no_such_msgs/msg/Thing")


def test_a_stamp_before_1970_is_kept_and_filed_at_the_beginning(tmp_path: Path):
    ns = np.array([-3, -1, 2]) * 500_000_000
    encoded = cdr.encode_imu(ns, np.arange(9.0).reshape(3, 3), np.ones((3, 3)))
    with McapBag(tmp_path / "b") as bag:
        bag.topic("/imu", cdr.IMU)
        bag.write("/imu", encoded[0], int(ns[0]))
        bag.write_merged({"/imu": (ns[1:], encoded[1:])})
    with Reader(tmp_path / "b") as reader:
        found = [(t, raw) for _, t, raw in reader.messages()]
    assert [t for t, _ in found] == [0, 0, 1_000_000_000]
    assert cdr.decode_imu([raw for _, raw in found])[0].tolist() == ns.tolist()


def test_a_file_that_was_written_into_with_its_times_kept_is_another(tmp_path):
    """A copy that keeps times: the same size, the same number on the disk, the same time of the last change."""
    file = tmp_path / "bag.mcap"
    file.write_bytes(b"one recording")
    kept, before = file.stat(), file_states(file)
    assert file_states(file) == before
    time.sleep(0.02)
    file.write_bytes(b"an other one.")
    os.utime(file, ns=(kept.st_atime_ns, kept.st_mtime_ns))
    assert file_states(file) != before
