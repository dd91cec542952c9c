"""Topics of other names are found where the type leaves no doubt, and asked for in one line where it does."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import zstandard
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_info import read_info
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.mcap_bag import McapBag
from sdimu_calibration.storage.bags.topic_choice import TopicChoice, Topics

START_NS = 1_700_000_000_000_000_000
TYPES = get_typestore(Stores.ROS2_JAZZY)
TYPES_1 = get_typestore(Stores.ROS1_NOETIC)
ELSEWHERE = Topics("/xsens/imu", "/table/state", "/table/axes", "/xsens/temp")


def write(path: Path, test, topics: Topics) -> Path:
    write_recording(
        path,
        BagContent(
            start_ns=START_NS,
            imu_ns=test.ns,
            omega_ib_b=test.omega_ib_b,
            f_ib_b=test.f_ib_b,
            status=(test.slow_ns, test.dwell, test.stop),
            joint_states=(test.ns, test.names, test.angle, test.rate),
            temperature=(test.slow_ns, test.temperature),
        ),
        topics=topics,
    )
    return path


def write_topics(path: Path, test, *names: str) -> Path:
    """Write the IMU under several names, each slower by half than the one before."""
    encoded = cdr.encode_imu(test.ns + START_NS, test.omega_ib_b, test.f_ib_b)
    with McapBag(path) as bag:
        for k, name in enumerate(names):
            bag.topic(name, cdr.IMU)
            for raw, ns in list(zip(encoded, test.ns.tolist(), strict=True))[:: 2**k]:
                bag.write(name, raw, ns + START_NS)
    return path


def refusal(path: Path, *options) -> str:
    with pytest.raises(DataError) as error:
        read_recording(path, *options)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_topics_of_other_names_are_found_by_their_types_and_told(tmp_path, small_test):
    r = read_recording(write(tmp_path / "b", small_test, ELSEWHERE))
    assert np.array_equal(r.f_ib_b, small_test.f_ib_b)
    assert np.array_equal(r.phase.stop, small_test.stop)
    assert np.array_equal(r.temperature.value, small_test.temperature)
    assert r.table.names == small_test.names
    told = " ".join(r.notes)
    assert all(name in told for name in vars(ELSEWHERE).values())


def test_the_projects_own_names_need_no_word(bag):
    assert read_recording(bag).notes == ()


def test_several_imus_are_a_question_with_counts_and_rates(tmp_path, small_test):
    path = write_topics(tmp_path / "b", small_test, "/left", "/right")
    text = refusal(path)
    assert "--imu-topic" in text
    assert "/left (500 messages, 100 Hz)" in text
    assert "/right (250 messages, 50 Hz)" in text
    assert len(read_recording(path, TopicChoice(imu="/right")).t) == 250


def test_a_topic_that_was_asked_for_must_be_there_and_of_its_type(bag):
    assert "/nowhere" in refusal(bag, TopicChoice(imu="/nowhere"))
    assert "/nowhere" in refusal(bag, TopicChoice(status="/nowhere"))
    assert f"is {cdr.TEMPERATURE}, expected {cdr.IMU}" in refusal(bag, TopicChoice(imu="/imu/temperature"))


def test_diagnostics_without_a_phase_are_no_status(tmp_path, small_test):
    ok = cdr.Layout("x").count(1).byte(0).string("disk").string("OK").string("").count(0)
    encoded = cdr.encode_imu(small_test.ns, small_test.omega_ib_b, small_test.f_ib_b)
    with McapBag(tmp_path / "b") as bag:
        bag.topic("/diagnostics", cdr.STATUS)
        bag.write("/diagnostics", cdr.as_bytes(ok.rows(small_test.slow_ns[1:2]))[0], int(small_test.slow_ns[1]))
        bag.topic("/imu", cdr.IMU)
        for raw, ns in zip(encoded, small_test.ns.tolist(), strict=True):
            bag.write("/imu", raw, ns)
    assert read_recording(tmp_path / "b").phase is None


def test_several_thermometers_are_told_and_not_used(tmp_path, small_test):
    encoded = cdr.encode_imu(small_test.ns, small_test.omega_ib_b, small_test.f_ib_b)
    warm = cdr.encode_temperature(small_test.slow_ns, small_test.temperature)
    with McapBag(tmp_path / "b") as bag:
        for name in ("/cpu", "/room"):
            bag.topic(name, cdr.TEMPERATURE)
            for raw, ns in zip(warm, small_test.slow_ns.tolist(), strict=True):
                bag.write(name, raw, ns)
        bag.topic("/imu", cdr.IMU)
        for raw, ns in zip(encoded, small_test.ns.tolist(), strict=True):
            bag.write("/imu", raw, ns)
    r = read_recording(tmp_path / "b")
    assert r.temperature is None
    assert any("/cpu" in note and "/room" in note for note in r.notes)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_compressed_bags_read_the_same(tmp_path, small_test, plugin, mode):
    encoded = cdr.encode_imu(small_test.ns + START_NS, small_test.omega_ib_b, small_test.f_ib_b)
    writer = Writer(tmp_path / "b", version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/imu/data_raw", cdr.IMU, typestore=TYPES)
        for raw, ns in zip(encoded, small_test.ns.tolist(), strict=True):
            writer.write(connection, ns + START_NS, raw)
    assert np.array_equal(read_recording(tmp_path / "b").omega_ib_b, small_test.omega_ib_b)
    content = read_info(tmp_path / "b")
    assert content.counts == {"/imu/data_raw": len(small_test.ns)}
    assert content.first_ns == START_NS + small_test.ns[0]


def test_a_packed_file_reads_alone_and_says_when_it_is_no_such_file(bag, small_test):
    plain = next(bag.glob("*.mcap"))
    packed = bag / "alone.mcap.zstd"
    packed.write_bytes(zstandard.compress(plain.read_bytes()))
    assert np.array_equal(read_recording(packed).f_ib_b, small_test.f_ib_b)
    assert read_info(packed) == read_info(plain)
    packed.write_bytes(zstandard.compress(plain.read_bytes()[:-100]))
    assert read_info(packed).damaged == [packed]
    packed.write_bytes(b"something else")
    assert "cannot be unpacked" in refusal(packed)
    with pytest.raises(DataError, match="cannot be unpacked"):
        read_info(packed)


@pytest.mark.parametrize("method", [None, Writer1.CompressionFormat.LZ4, Writer1.CompressionFormat.BZ2])
def test_a_bag_of_ros_1_reads_the_same(tmp_path, small_test, method):
    path = tmp_path / "old.bag"
    writer = Writer1(path)
    if method is not None:
        writer.set_compression(method)
    with writer:
        connection = writer.add_connection("/imu", cdr.IMU, typestore=TYPES_1)
        types = TYPES_1.types
        header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
        vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
        for k, ns in enumerate(small_test.ns.tolist()):
            time = stamp(*divmod(ns + START_NS, 1_000_000_000))
            message = types[cdr.IMU](
                header(k, time, "imu"),
                quaternion(0.0, 0.0, 0.0, 1.0),
                np.zeros(9),
                vector(*small_test.omega_ib_b[k]),
                np.zeros(9),
                vector(*small_test.f_ib_b[k]),
                np.zeros(9),
            )
            writer.write(connection, ns + START_NS, TYPES_1.serialize_ros1(message, cdr.IMU))
    r = read_recording(path)
    assert np.array_equal(r.f_ib_b, small_test.f_ib_b)
    assert np.array_equal(r.omega_ib_b, small_test.omega_ib_b)
    assert np.abs(r.start_ns + r.t * 1e9 - START_NS - small_test.ns).max() <= 256  # a double of ns since 1970
    content = read_info(path)
    assert content.types == {"/imu": cdr.IMU}
    assert content.counts == {"/imu": len(small_test.ns)}
    assert content.first_ns == START_NS + small_test.ns[0]
    path.write_bytes(path.read_bytes()[:1000])
    assert "cannot be read" in refusal(path)
    with pytest.raises(DataError, match="cannot be read"):
        read_info(path)


def test_a_bag_without_an_imu_says_so(tmp_path, bag):
    shutil.rmtree(bag)
    with McapBag(tmp_path / "b") as empty:
        empty.topic("/imu/temperature", cdr.TEMPERATURE)
        empty.write("/imu/temperature", cdr.encode_temperature(np.array([1]), np.array([20.0]))[0], 1)
    assert "no topic of that type" in refusal(tmp_path / "b")
