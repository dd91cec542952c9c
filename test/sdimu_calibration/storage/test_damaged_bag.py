"""Damage in a bag is told, whatever it is; what is whole is saved; nothing is dropped in silence."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from io import BytesIO
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_info import read_info
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cut_bag import cut_bag
from sdimu_calibration.storage.bags.mcap_file import McapFile
from sdimu_calibration.storage.bags.recover import recover

N = 9000
CHUNK, STATISTICS, DATA_END, FOOTER = 6, 11, 15, 2


@pytest.fixture
def long_bag(tmp_path, small_test):
    """Bag of several chunks; its statistics and checksums are right."""
    return type(small_test)(N).write(tmp_path / "long")


def records(content):
    """Opcode, place and length of each record of a file."""
    at = 8
    while at < len(content) - 8:
        kind, length = struct.unpack_from("<BQ", content, at)
        yield kind, at, length
        at += 9 + length


def without_checksums(content):
    """Return the file as one that a writer without checksums would have left."""
    out = bytearray(content)
    for kind, at, length in records(content):
        if kind in {DATA_END, FOOTER}:
            out[at + 9 + length - 4 : at + 9 + length] = bytes(4)
        if kind == CHUNK:
            out[at + 9 + 24 : at + 9 + 28] = bytes(4)
    return out


def edited(bag, edit):
    file = next(bag.glob("*.mcap"))
    content = without_checksums(file.read_bytes())
    edit(content)
    file.write_bytes(content)
    return file


def swallow(content):
    """Let the record of the second chunk take in the two that follow."""
    chunks = [(at, length) for kind, at, length in records(bytes(content)) if kind == CHUNK]
    first, last = chunks[1], chunks[3]
    struct.pack_into("<Q", content, first[0] + 1, last[0] + last[1] - first[0])


def hide(content):
    """Make an unknown record of the second chunk."""
    content[[at for kind, at, _ in records(bytes(content)) if kind == CHUNK][1]] = 0x77


@pytest.mark.parametrize(("edit", "saved"), [(swallow, 1.0), (hide, 0.5)])
def test_messages_that_are_not_found_are_told_and_the_others_saved(long_bag, edit, saved):
    counts = read_info(long_bag).counts
    edited(long_bag, edit)
    with pytest.raises(DataError, match="damaged"):
        read_recording(long_bag)
    assert read_info(long_bag).damaged
    (salvage,) = recover(long_bag)
    assert salvage.damage
    kept = sum(salvage.counts.values()) / sum(counts.values())
    assert saved <= kept <= 1.0
    assert (kept < 1.0) == (edit is hide)
    read_recording(long_bag)


def test_the_statistics_of_a_file_are_compared(long_bag):
    def one_more(content):
        place = next(at for kind, at, _ in records(bytes(content)) if kind == STATISTICS)
        content[place + 9] ^= 1

    edited(long_bag, one_more)
    with pytest.raises(DataError, match="statistics say"):
        read_recording(long_bag)


def test_the_checksums_of_the_whole_file_are_those_of_the_format(long_bag):
    file = next(long_bag.glob("*.mcap"))
    with file.open("rb") as stream:
        assert make_reader(stream, validate_crcs=True).get_summary().statistics.message_count
    content = file.read_bytes()
    place = next(at for kind, at, _ in records(content) if kind == DATA_END)
    assert struct.unpack_from("<I", content, place + 9)[0] == zlib.crc32(content[:place])


@pytest.mark.parametrize("seed", range(12))
def test_a_changed_byte_anywhere_is_told(long_bag, seed):
    # What the file says once more in its summary is repeated, not used: it is checked all the same.
    file = next(long_bag.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    place = int(np.random.default_rng(seed).integers(len(content)))
    content[place] ^= 0x10
    file.write_bytes(content)
    with pytest.raises(DataError):
        read_recording(long_bag)


def write_raw(path, chunk_records, compression="", data=None, size=None):
    """Write an MCAP file of one chunk with right checksums."""
    stream = BytesIO()
    McapFile(stream)
    body = chunk_records if data is None else data
    name = compression.encode()
    chunk = struct.pack("<QQQII", 0, 0, len(chunk_records) if size is None else size, 0, len(name)) + name
    chunk += struct.pack("<Q", len(body)) + body
    content = stream.getvalue() + struct.pack("<BQ", CHUNK, len(chunk)) + chunk
    content += struct.pack("<BQI", DATA_END, 4, 0) + struct.pack("<BQQQI", FOOTER, 20, 0, 0, 0)
    path.write_bytes(content + b"\x89MCAP0\r\n")
    return path


def text(value):
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def record(kind, body):
    return struct.pack("<BQ", kind, len(body)) + body


def schema(number, name):
    return record(3, struct.pack("<H", number) + text(name) + text("ros2msg") + struct.pack("<I", 0))


def channel(number, schema_id, topic):
    return record(4, struct.pack("<HH", number, schema_id) + text(topic) + text("cdr") + struct.pack("<I", 0))


def message(number, data, time_ns=1):
    return record(5, struct.pack("<HIQQ", number, 0, time_ns, time_ns) + data)


def imu_file(path, *messages, time_ns=1, schema_id=1):
    head = schema(1, cdr.IMU) + channel(1, schema_id, "/imu/data_raw")
    return write_raw(path, head + b"".join(message(1, data, time_ns) for data in messages))


def one_imu():
    return cdr.encode_imu(np.array([5]), np.zeros((1, 3)), np.ones((1, 3)))[0]


@pytest.mark.parametrize("data", [b"", b"\x00", b"\x00\x01\x00\x00", one_imu()[:40], b"\x00\x00" + one_imu()[2:-3]])
def test_a_message_that_is_none_is_told(tmp_path, data):
    file = imu_file(tmp_path / "x.mcap", one_imu(), data)
    with pytest.raises(DataError, match=r"x\.mcap: /imu/data_raw: message 2 cannot be read"):
        read_recording(file)


def test_a_message_without_a_stamp_is_told_where_messages_are_sorted(tmp_path):
    file = imu_file(tmp_path / "x.mcap", one_imu(), b"\x00")
    with pytest.raises(DataError, match="/imu/data_raw: message 2 has no stamp"):
        cut_bag(file, tmp_path / "out", 0.0, 1.0)


def test_messages_of_a_channel_that_nothing_describes_are_damage(tmp_path):
    file = write_raw(tmp_path / "x.mcap", schema(1, cdr.IMU) + channel(1, 1, "/imu/data_raw") + message(2, one_imu()))
    with pytest.raises(DataError, match="nothing describes"):
        read_recording(file)
    with pytest.raises(DataError, match="nothing can be saved"):
        recover(file)


def test_a_channel_without_its_schema_is_kept_as_it_is(tmp_path):
    file = imu_file(tmp_path / "x.mcap", one_imu(), one_imu(), schema_id=7)
    file.write_bytes(file.read_bytes()[:-8])
    (salvage,) = recover(file)
    assert salvage.counts == {"/imu/data_raw": 2}
    assert read_info(file).types == {"/imu/data_raw": ""}


def test_a_time_beyond_all_stamps_is_damage(tmp_path):
    file = imu_file(tmp_path / "x.mcap", one_imu(), time_ns=1 << 63)
    with pytest.raises(DataError, match="2262"):
        read_recording(file)


ZEROS = bytes(64 << 20)


def bomb(kind):
    """Some kilobytes that unpack to gigabytes, if anyone lets them."""
    if kind == "zstd":
        return zstandard.ZstdCompressor().compress(ZEROS)
    return lz4.frame.compress(ZEROS)


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
@pytest.mark.parametrize("said", [1 << 20, 1 << 26, 1 << 36])
def test_a_chunk_unpacks_to_what_it_may_and_says(tmp_path, kind, said, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.storage.bags.unpacking.BASE_BYTES", 1 << 20)
    monkeypatch.setattr("sdimu_calibration.storage.bags.unpacking.RATIO", 8)
    file = write_raw(tmp_path / "x.mcap", b"", kind, bomb(kind), said)
    with pytest.raises(DataError, match="unpack"):
        read_recording(file)


def test_a_whole_file_that_is_packed_unpacks_to_what_it_may(tmp_path: Path):
    packed = tmp_path / "x.mcap.zstd"
    with packed.open("wb") as stream, zstandard.ZstdCompressor().stream_writer(stream) as writer:
        for _ in range(4):
            writer.write(ZEROS)
    assert packed.stat().st_size < 1 << 16
    with pytest.raises(DataError, match="unpacks to more than"):
        read_recording(packed)


def test_a_recording_without_noise_unpacks(tmp_path):
    # Nothing of a sensor compresses better than one that says the same all the time.
    n = 30_000
    write_recording(
        tmp_path / "b",
        BagContent(
            start_ns=10**18,
            imu_ns=np.arange(1, n + 1) * 10_000_000,
            omega_ib_b=np.zeros((n, 3)),
            f_ib_b=np.zeros((n, 3)),
        ),
    )
    file = next((tmp_path / "b").glob("*.mcap"))
    assert n * 356 < 60 * file.stat().st_size
    assert len(read_recording(tmp_path / "b").t) == n


def test_reading_needs_the_memory_of_the_numbers(tmp_path, small_test):
    # A status in every chunk must not keep the whole chunk.
    n = 60_000
    made = type(small_test)(n)
    write_recording(
        tmp_path / "long",
        BagContent(
            start_ns=10**18,
            imu_ns=made.ns,
            omega_ib_b=made.omega_ib_b,
            f_ib_b=made.f_ib_b,
            status=(made.slow_ns, made.dwell, made.stop),
            temperature=(made.slow_ns, made.temperature),
        ),
    )
    tracemalloc.start()
    try:
        assert len(read_recording(tmp_path / "long").t) == n
        assert tracemalloc.get_traced_memory()[1] < 250 * n + (4 << 20)
    finally:
        tracemalloc.stop()


def test_messages_without_a_common_layout_are_read_where_they_stand(tmp_path):
    # A big-endian message among little-endian ones, as some bridges write.
    big = np.frombuffer(one_imu(), np.uint8).copy()
    big[:4] = [0, 0, 0, 0]
    for place in (4, 8, 12):
        big[place : place + 4] = big[place : place + 4][::-1]
    for place in range(28, len(big), 8):
        big[place : place + 8] = big[place : place + 8][::-1]
    first = cdr.encode_imu(np.array([10**9]), np.full((1, 3), 2.0), np.ones((1, 3)))[0]
    recording = read_recording(imu_file(tmp_path / "x.mcap", first, big.tobytes()))
    assert recording.omega_ib_b[:, 0].tolist() == [0.0, 2.0]


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("mode", [CompressionMode.MESSAGE, CompressionMode.FILE])
def test_a_packed_bag_unpacks_to_what_it_may(tmp_path, plugin, mode, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.storage.bags.unpacking.BASE_BYTES", 1 << 20)
    writer = Writer(tmp_path / "b", version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/imu/data_raw", cdr.IMU, typestore=get_typestore(Stores.ROS2_JAZZY))
        for k in range(8):
            writer.write(connection, k, bytes(4 << 20))
    with pytest.raises(DataError, match="unpack"):
        read_recording(tmp_path / "b")


@pytest.mark.parametrize("kind", ["zstd", "zstd without its size", "lz4", ""])
def test_chunks_of_every_kind_read_the_same(tmp_path, kind):
    samples = cdr.encode_imu(np.arange(1, 60) * 10**7, np.full((59, 3), 2.0), np.ones((59, 3)))
    body = schema(1, cdr.IMU) + channel(1, 1, "/imu/data_raw") + b"".join(message(1, data) for data in samples)
    pack = {
        "": lambda data: data,
        "lz4": lz4.frame.compress,
        "zstd": zstandard.compress,
        "zstd without its size": zstandard.ZstdCompressor(write_content_size=False).compress,
    }[kind]
    recording = read_recording(write_raw(tmp_path / "x.mcap", body, kind[:4], pack(body)))
    assert recording.omega_ib_b.tolist() == [[2.0] * 3] * 59


def test_a_bag_of_ros_1_unpacks_to_what_it_may(tmp_path, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.storage.bags.unpacking.BASE_BYTES", 1 << 20)
    types = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer1(tmp_path / "x.bag")
    writer.set_compression(Writer1.CompressionFormat.BZ2)
    with writer:
        connection = writer.add_connection("/imu", cdr.IMU, typestore=types)
        for k in range(8):
            writer.write(connection, k, bytes(4 << 20))
    with pytest.raises(DataError, match=r"x\.bag: the bag cannot be read"):
        read_recording(tmp_path / "x.bag")


def test_joint_states_without_axes_are_left_out_and_noted(bag):
    extra = cdr.as_bytes(cdr.Layout("rate_table").count(0).count(0).count(0).count(0).rows(np.array([5, 6])))
    body = schema(1, cdr.IMU) + channel(1, 1, "/imu/data_raw") + schema(2, cdr.JOINT_STATE)
    body += channel(2, 2, "/rate_table/joint_states")
    imu = cdr.encode_imu(np.array([1, 2]) * 10**7, np.zeros((2, 3)), np.ones((2, 3)))
    body += b"".join(message(1, data) for data in imu) + b"".join(message(2, data) for data in extra)
    recording = read_recording(write_raw(bag / "x.mcap", body))
    assert recording.table is None
    assert any("joint_states" in note for note in recording.notes)
