"""Recordings come back as they were written, and bad ones are told apart in one line."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.mcap_bag import McapBag

START_NS = 1_700_000_000_000_000_000
TYPES = get_typestore(Stores.ROS2_JAZZY)


def write_imu(path: Path, ns, omega=None, f=None) -> Path:
    ns = np.asarray(ns, np.int64)
    omega = np.zeros((len(ns), 3)) if omega is None else omega
    f = np.tile([0.0, 0.0, -9.8], (len(ns), 1)) if f is None else f
    messages = cdr.encode_imu(ns + START_NS, omega, f)
    with McapBag(path) as bag:
        bag.topic("/imu/data_raw", cdr.IMU)
        for raw, stamp in zip(messages, ns.tolist(), strict=True):
            bag.write("/imu/data_raw", raw, stamp + START_NS)
    return path


def refusal(path: Path, **options) -> str:
    with pytest.raises(DataError) as error:
        read_recording(path, **options)
    text = str(error.value)
    assert "\n" not in text
    return text


def test_what_is_written_is_read_back_to_the_last_bit(bag, small_test):
    r = read_recording(bag)
    assert np.array_equal(r.omega_ib_b, small_test.omega_ib_b)
    assert np.array_equal(r.f_ib_b, small_test.f_ib_b)
    assert r.start_ns == START_NS
    # Doubles of seconds resolve a nanosecond for a hundred days.
    assert np.abs(r.t - small_test.ns * 1e-9).max() < 1e-12
    assert np.array_equal(r.phase.dwell, small_test.dwell)
    assert np.array_equal(r.phase.stop, small_test.stop)
    assert np.abs(r.phase.t - small_test.slow_ns * 1e-9).max() < 1e-12
    assert np.array_equal(r.temperature.value, small_test.temperature)
    assert r.table.names == small_test.names
    assert np.array_equal(r.table.angle, small_test.angle)
    assert r.rejected == 0
    assert r.notes == ()


def test_the_bare_file_and_a_folder_without_metadata_read_the_same(bag):
    whole = read_recording(bag)
    file = next(bag.glob("*.mcap"))
    assert np.array_equal(read_recording(file).f_ib_b, whole.f_ib_b)
    (bag / "metadata.yaml").unlink()
    assert np.array_equal(read_recording(bag).f_ib_b, whole.f_ib_b)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_bags_of_other_writers_read_the_same(tmp_path, small_test, plugin):
    messages = cdr.encode_imu(small_test.ns + START_NS, small_test.omega_ib_b, small_test.f_ib_b)
    with Writer(tmp_path / "other", version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/imu/data_raw", cdr.IMU, typestore=TYPES)
        for raw, ns in zip(messages, small_test.ns.tolist(), strict=True):
            writer.write(connection, ns + START_NS, raw)
    r = read_recording(tmp_path / "other")
    assert np.array_equal(r.omega_ib_b, small_test.omega_ib_b)
    assert r.phase is None
    assert r.temperature is None


def test_qos_that_metadata_and_channel_disagree_on_loses_nothing(bag, small_test):
    metadata = bag / "metadata.yaml"
    profile = "offered_qos_profiles:\n      - {history: 1, depth: 7, reliability: 1, durability: 2}"
    metadata.write_text(metadata.read_text().replace("offered_qos_profiles: []", profile))
    assert len(read_recording(bag).t) == len(small_test.ns)


def test_frame_ids_of_changing_length_read_right(tmp_path, small_test):
    half = len(small_test.ns) // 2
    ns = small_test.ns + START_NS
    short = cdr.encode_imu(ns[:half], small_test.omega_ib_b[:half], small_test.f_ib_b[:half], frame_id="i")
    long = cdr.encode_imu(ns[half:], small_test.omega_ib_b[half:], small_test.f_ib_b[half:], frame_id="imu_link_of_x")
    with McapBag(tmp_path / "b") as bag:
        bag.topic("/imu/data_raw", cdr.IMU)
        for raw, stamp in zip([*short, *long], ns.tolist(), strict=True):
            bag.write("/imu/data_raw", raw, stamp)
    assert np.array_equal(read_recording(tmp_path / "b").omega_ib_b, small_test.omega_ib_b)


def test_big_endian_messages_read_right(tmp_path, small_test):
    with McapBag(tmp_path / "b") as bag:
        bag.topic("/imu/data_raw", cdr.IMU)
        encoded = cdr.encode_imu(small_test.ns, small_test.omega_ib_b, small_test.f_ib_b)
        for raw, ns in zip(encoded, small_test.ns, strict=True):
            message = TYPES.deserialize_cdr(raw, cdr.IMU)
            bag.write("/imu/data_raw", bytes(TYPES.serialize_cdr(message, cdr.IMU, little_endian=False)), int(ns))
    assert np.array_equal(read_recording(tmp_path / "b").f_ib_b, small_test.f_ib_b)


def test_samples_out_of_order_are_sorted_and_told(tmp_path):
    ns = np.arange(1, 101) * 10_000_000
    omega = np.repeat(ns[:, None] * 1e-9, 3, axis=1)
    shuffled = np.r_[0:50, 60:70, 50:60, 70:100]
    r = read_recording(write_imu(tmp_path / "b", ns[shuffled], omega[shuffled]))
    assert np.array_equal(r.omega_ib_b, omega)
    assert r.rejected == 0
    assert any("out of order" in note for note in r.notes)


def test_repeated_stamps_and_samples_that_are_not_finite_are_counted(tmp_path):
    ns = np.arange(1, 101) * 10_000_000
    ns[10:13] = ns[10]
    omega = np.zeros((100, 3))
    omega[50, 1] = np.nan
    f = np.full((100, 3), 9.8)
    f[60, 2] = np.inf
    r = read_recording(write_imu(tmp_path / "b", ns, omega, f))
    assert r.rejected == 4
    assert len(r.t) == 96
    assert (np.diff(r.t) > 0).all()
    assert len(r.notes) == 2


def test_time_counts_from_one_interval_before_the_first_stamp_even_with_a_gap(tmp_path):
    ns = np.r_[np.arange(1, 51), np.arange(200, 250)] * 50_000_000
    r = read_recording(write_imu(tmp_path / "b", ns))
    assert r.start_ns == START_NS
    assert r.t[0] == pytest.approx(0.05, abs=1e-12)


def test_stops_are_counted_where_the_status_does_not_say_them(tmp_path):
    ns = np.arange(1, 501) * 10_000_000
    phases = ["dwell", "dwell", "rotating", "dwell", "rotating"]
    layout = [cdr.Layout("t").count(1).byte(0).string("table").string(p).string("").count(0) for p in phases]
    with McapBag(write_imu(tmp_path / "imu", ns).with_name("b")) as bag:
        bag.topic("/rate_table/status", cdr.STATUS)
        bag.topic("/imu/data_raw", cdr.IMU)
        for second, one in enumerate(layout):
            stamp = START_NS + second * 1_000_000_000
            bag.write("/rate_table/status", cdr.as_bytes(one.rows(np.array([stamp])))[0], stamp)
        for raw, stamp in zip(cdr.encode_imu(ns + START_NS, np.zeros((500, 3)), np.ones((500, 3))), ns, strict=True):
            bag.write("/imu/data_raw", raw, int(stamp) + START_NS)
    phase = read_recording(tmp_path / "b").phase
    assert phase.dwell.tolist() == [True, True, False, True, False]
    assert phase.stop.tolist() == [0, 0, 0, 1, 1]


def test_an_absent_path_is_named(tmp_path):
    assert refusal(tmp_path / "nowhere") == f"{tmp_path / 'nowhere'}: no such file or folder"


def test_things_that_are_no_bag_are_told(tmp_path):
    (tmp_path / "folder").mkdir()
    assert "not a bag" in refusal(tmp_path / "folder")
    (tmp_path / "notes.txt").write_text("x")
    assert "not a bag" in refusal(tmp_path / "notes.txt")
    (tmp_path / "x.mcap").write_bytes(b"something else altogether")
    assert "not an MCAP file" in refusal(tmp_path / "x.mcap")
    (tmp_path / "empty.mcap").write_bytes(b"")
    assert "empty" in refusal(tmp_path / "empty.mcap")


def test_an_empty_bag_says_so(tmp_path):
    McapBag(tmp_path / "b").close()
    assert "empty" in refusal(tmp_path / "b")


@pytest.mark.parametrize("share", [0.999, 0.5, 0.05])
def test_a_cut_file_says_how_to_mend_it(bag, share):
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * share)])
    assert "run: sdimu bag recover" in refusal(bag)
    assert "run: sdimu bag recover" in refusal(file)


def test_a_flipped_bit_is_not_read_as_data(bag):
    file = next(bag.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    content[len(content) // 3] ^= 0x10
    file.write_bytes(content)
    assert "damaged" in refusal(bag)


def test_a_file_that_metadata_names_and_that_is_gone_is_named(bag):
    file = next(bag.glob("*.mcap"))
    file.unlink()
    assert str(file) in refusal(bag)


def test_a_topic_of_another_type_is_told(tmp_path):
    with McapBag(tmp_path / "b") as bag:
        bag.topic("/imu/data_raw", cdr.TEMPERATURE)
        bag.write("/imu/data_raw", cdr.encode_temperature(np.array([1]), np.array([20.0]))[0], 1)
    assert f"is {cdr.TEMPERATURE}, expected {cdr.IMU}" in refusal(tmp_path / "b")


def test_a_topic_without_messages_is_told(tmp_path):
    with McapBag(tmp_path / "b") as bag:
        bag.topic("/imu/data_raw", cdr.IMU)
    assert "no messages" in refusal(tmp_path / "b")


def test_samples_that_are_all_nan_are_told(tmp_path):
    path = write_imu(tmp_path / "b", np.arange(1, 51) * 10_000_000, np.full((50, 3), np.nan))
    assert "all 50 samples are NaN" in refusal(path)


def test_a_driver_that_never_sets_its_stamp_is_told(tmp_path):
    assert "header.stamp" in refusal(write_imu(tmp_path / "b", np.zeros(50)))


@pytest.mark.parametrize("name", ["a", "b", "c", "d"])
def test_recordings_of_another_simulator_read_whole(recorded, name):
    r = read_recording(recorded(f"blind/{name}"))
    assert r.rejected == 0
    assert r.interval_s == pytest.approx(0.05, abs=1e-9)
    assert r.phase.stop.max() == 18
    # At rest the size of the specific force is gravity: within the spread of gravity on Earth and of the scale factor.
    assert np.median(np.linalg.norm(r.f_ib_b, axis=1)) == pytest.approx(9.806, abs=0.03)


def test_the_file_is_left_as_it_was(bag):
    before = {path: path.read_bytes() for path in bag.iterdir()}
    copy = shutil.copytree(bag, bag.with_name("copy"))
    read_recording(bag)
    assert {path: path.read_bytes() for path in bag.iterdir()} == before
    assert copy.is_dir()
