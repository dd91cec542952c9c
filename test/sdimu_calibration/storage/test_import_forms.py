"""Forms of files that others write: numeric headings, bare numbers, counters, logs of receivers, parts of one test."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import yaml

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.importing.import_map import load_import_map
from sdimu_calibration.storage.importing.importer import APART_NS, read_files, write_imported

G = 9.80665
N = 400
T = np.arange(1, N + 1) * 0.01
COUNTS = np.random.default_rng(11).integers(-500, 500, (N, 6))
NUMBERED = {
    "format": "sdimu-import/1",
    "time": {"rate_hz": 100.0},
    "gyro": {"columns": [1, 2, 3], "unit": "deg/s"},
    "accel": {"columns": [4, 5, 6], "unit": "mg"},
}


def chart(folder: Path, **changes):
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump(NUMBERED | changes))
    return load_import_map(path)


def lines(table, delimiter=" ", form="%d"):
    return [delimiter.join(form % cell for cell in row) for row in table]


def check(found):
    assert np.allclose(found.omega_ib_b, np.radians(COUNTS[:, :3]), rtol=1e-14, atol=0)
    assert np.allclose(found.f_ib_b, COUNTS[:, 3:] * 1e-3 * G, rtol=1e-14, atol=0)


def test_numeric_headings_are_no_samples_and_are_told(tmp_path):
    path = tmp_path / "a.imu"
    headings = ["% a logger", "0.00 0.0 -90.6 0.0 0.0 0.0", "34.2 108.9 380.0 0.0 10.0 9.78", "0.1 0.1 0.1 12 12 12"]
    path.write_text("\n".join([*headings, *lines(COUNTS)]))
    found = read_files([path], chart(tmp_path))
    check(found)
    (note,) = found.notes
    assert "lines up to 4 are headings in numbers" in note
    whole = read_files([path], chart(tmp_path, skip_lines=1))
    assert len(whole.ns) == N + 3
    assert whole.notes == ()


def test_whole_numbers_above_real_ones_are_headings_too_and_a_zero_is_none(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(["1 2 3 4 5 6", *lines(COUNTS, form="%.3f")]))
    found = read_files([path], chart(tmp_path))
    check(found)
    assert found.notes
    first = lines(COUNTS, form="%.3f")
    first[0] = first[0].replace(first[0].split()[0], "0", 1)
    path.write_text("\n".join(first))
    assert len(read_files([path], chart(tmp_path)).ns) == N


@pytest.mark.parametrize("above", ["Fs,100", "Fs,100\nsensor,3,4", "100"])
def test_lines_of_another_width_above_the_headings_are_no_samples(tmp_path, above):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([above, "gx,gy,gz,ax,ay,az", *lines(COUNTS, ",")]))
    named = {"gyro": {"columns": ["gx", "gy", "gz"], "unit": "deg/s"}, "accel": {"columns": [4, 5, 6], "unit": "mg"}}
    check(read_files([path], chart(tmp_path, **named)))


@pytest.mark.parametrize("kind", ["float64", "float32", "int16"])
@pytest.mark.parametrize("big_endian", [False, True])
def test_bare_numbers_are_read_as_the_map_says(tmp_path, kind, big_endian):
    path = tmp_path / "a.bin"
    order = ">" if big_endian else "<"
    path.write_bytes(b"head" + COUNTS.astype(np.dtype(kind).newbyteorder(order)).tobytes())
    form = {"type": kind, "columns": 6, "big_endian": big_endian, "skip_bytes": 4}
    check(read_files([path], chart(tmp_path, binary=form)))
    with pytest.raises(DataError, match="no whole rows of 7"):
        read_files([path], chart(tmp_path, binary={**form, "columns": 7}))
    with pytest.raises(DataError, match="columns 1 to 6"):
        read_files([path], chart(tmp_path, binary=form, gyro={"columns": [1, 2, 7], "unit": "deg/s"}))


def test_a_binary_file_without_a_word_in_the_map_says_which(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(np.linspace(-7.0, 3.0, 600).tobytes())
    with pytest.raises(DataError, match=r"binary: \{type: float64, columns: 7\}"):
        read_files([path], chart(tmp_path))


def test_increments_are_divided_by_the_interval(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines(COUNTS)))
    increments = {
        "gyro": {"columns": [1, 2, 3], "unit": "arcsec", "counts_per_unit": 10},
        "accel": {"columns": [4, 5, 6], "unit": "ug*s", "counts_per_unit": 0.008},
    }
    found = read_files([path], chart(tmp_path, **increments))
    assert np.allclose(found.omega_ib_b, np.radians(COUNTS[:, :3] * 0.1 / 3600.0) * 100.0, rtol=1e-14, atol=0)
    assert np.allclose(found.f_ib_b, COUNTS[:, 3:] * 125e-6 * G * 100.0, rtol=1e-14, atol=0)


@pytest.mark.parametrize("wrap", [256, 65536, 100])
@pytest.mark.parametrize("by", [1, 2])
def test_a_counter_is_the_clock_and_what_it_leaves_out_is_missing(tmp_path, wrap, by):
    number = np.delete(np.arange(N), [50, 51, 52, 300])
    rows = np.column_stack([COUNTS[number], (number * by + 30) % wrap])
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines(rows)))
    found = read_files([path], chart(tmp_path, time={"counter": 7, "rate_hz": 104.0}))
    # To the nanosecond of a stamp.
    assert np.abs(found.ns - found.ns[0] - number / 104.0 * 1e9).max() <= 1.0
    assert "by it 4 samples are missing" in found.notes[0]


def test_a_counter_without_a_rate_has_that_of_the_stamps(tmp_path):
    arrival = np.repeat(np.arange(1, N // 8 + 1) * 8 * 10.0, 8)
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines(np.column_stack([COUNTS, np.arange(N) % 256, arrival]))))
    found = read_files([path], chart(tmp_path, time={"counter": 7, "column": 8, "unit": "ms"}))
    # A packet of 8 at each end of 400 samples.
    assert np.median(np.diff(found.ns)) == pytest.approx(1e7, rel=1e-3)
    with pytest.raises(DataError, match="column 8 does not count"):
        read_files([path], chart(tmp_path, time={"counter": 8, "rate_hz": 100.0}))


def test_stamps_in_bursts_are_told_with_the_rate_that_replaces_them(tmp_path):
    many = np.tile(COUNTS, (5, 1))
    arrival = np.repeat(np.arange(1, 5 * N // 8 + 1) * 80, 8)
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines(np.column_stack([many, arrival]))))
    found = read_files([path], chart(tmp_path, time={"column": 7, "unit": "ms"}))
    assert "come in bursts" in found.notes[0]
    assert "rate_hz: 100 in the map" in found.notes[0]
    write_imported(tmp_path / "bag", found)
    read = read_recording(tmp_path / "bag")
    assert np.array_equal(read.f_ib_b, found.f_ib_b)
    assert read.interval_s == pytest.approx(0.01, rel=1e-3)


def test_ticks_of_several_units_of_time_are_exact(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines(np.column_stack([COUNTS, 10**9 + np.arange(N)]))))
    found = read_files([path], chart(tmp_path, time={"column": 7, "unit": "10ms"}))
    assert np.array_equal(found.ns, (10**9 + np.arange(N)) * 10_000_000)
    with pytest.raises(DataError, match=r"time\.unit"):
        chart(tmp_path, time={"column": 7, "unit": "10furlong"})


@pytest.mark.parametrize("short", [True, False])
def test_a_log_of_a_novatel_receiver_is_a_table_with_its_own_headings(tmp_path, short):
    head = "%RAWIMUSA,2100,{s}" if short else "#RAWIMUA,COM1,0,81.5,FINESTEERING,2100,{s},00000000,bb1a,6830"
    rows = []
    for k, (gx, gy, gz, ax, ay, az) in enumerate(COUNTS.tolist()):
        s = f"{345678 + (k + 1) // 100}.{(k + 1) % 100:02d}0000000"
        rows.append(f"{head.format(s=s)};2100,{s},111607{k % 10}a,{az},{-ay},{ax},{gz},{-gy},{gx}*5aa97065")
    rows.insert(5, "%INSPVASA,2100,345678.000;2100,345678.0,51.1,-114.0,1000.0*00000000")
    path = tmp_path / "a.ascii"
    path.write_text("\n".join(rows) + "\n")
    columns = {
        "time": {"column": "gps", "unit": "s", "start": "1980-01-06T00:00:00"},
        "gyro": {"columns": ["gyro_x", "-gyro_y", "gyro_z"], "unit": "deg/s", "sign": [1, -1, 1]},
        "accel": {"columns": ["accel_x", "-accel_y", "accel_z"], "unit": "mg", "sign": [1, -1, 1]},
    }
    found = read_files([path], chart(tmp_path, **columns))
    check(found)
    assert np.array_equal(found.ns - found.ns[0], np.arange(N) * 10_000_000)
    # 2100 weeks after 1980-01-06 is 2020-04-05.
    assert np.datetime64(int(found.ns[0]), "ns") == np.datetime64("2020-04-09T00:01:18.010000000")


def test_files_whose_times_begin_again_are_put_apart_and_others_stay(tmp_path):
    files = []
    for k in range(3):
        files.append(tmp_path / f"position{k}.txt")
        files[-1].write_text("\n".join(lines(np.column_stack([COUNTS, np.arange(N) + 10_000 * k]))))
    apart = read_files(files, chart(tmp_path))
    assert np.diff(apart.ns)[[N - 1, 2 * N - 1]].tolist() == [APART_NS, APART_NS]
    assert sum("begin again" in note for note in apart.notes) == 2
    assert "position1.txt: its times begin again" in apart.notes[0]
    stamped = read_files(files, chart(tmp_path, time={"column": 7, "unit": "10ms"}))
    assert stamped.notes == ()
    assert np.diff(stamped.ns).max() == (10_000 - N + 1) * 10_000_000
    for found in (apart, stamped):
        assert np.array_equal(found.f_ib_b, np.tile(read_files(files[:1], chart(tmp_path)).f_ib_b, (3, 1)))


def element(kind: int, payload: bytes) -> bytes:
    return struct.pack("<II", kind, len(payload)) + payload.ljust(-(-len(payload) // 8) * 8, b"\0")


def test_a_timetable_of_matlab_is_told_with_what_matlab_can_do(tmp_path):
    flags = element(6, struct.pack("<II", 17, 0))
    inner = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    words = b"".join(element(1, word) for word in (b"imu", b"MCOS", b"timetable"))
    variable = element(14, flags + words + element(14, inner + element(6, struct.pack("<I", 1))))
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H2s", 0x0100, b"IM") + variable)
    columns = {"time": {"column": "imu.Time"}, "gyro": {"columns": "imu.w", "unit": "deg/s"}}
    with pytest.raises(DataError, match=r"variable imu is a MATLAB timetable.*imu\.Properties\.RowTimes"):
        read_files([path], chart(tmp_path, **columns))
