"""Files of others give the same samples whatever their form, and what is wrong in them is told by line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.importing.import_map import load_import_map
from sdimu_calibration.storage.importing.importer import read_files, write_imported

G = 9.80665
BASE = {
    "format": "sdimu-import/1",
    "time": {"column": "t", "unit": "s"},
    "accel": {"columns": ["ax", "ay", "az"], "unit": "g"},
    "gyro": {"columns": ["gx", "gy", "gz"], "unit": "deg/s"},
}


def chart(folder: Path, **changes):
    """Load a map: BASE with changes; a dict is merged, None removes."""
    content = {key: dict(value) if isinstance(value, dict) else value for key, value in BASE.items()}
    for key, value in changes.items():
        content[key] = {**content.get(key, {}), **value} if isinstance(value, dict) else value
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in content.items() if v is not None}))
    return load_import_map(path)


class Samples:
    """Numbers that no two cells share: seconds, g, deg/s."""

    def __init__(self, n: int = 40) -> None:
        generator = np.random.default_rng(5)
        self.t = np.arange(1, n + 1) * 0.01
        self.f = generator.standard_normal((n, 3))
        self.w = generator.standard_normal((n, 3)) * 10.0

    def lines(self, separator: str = ",") -> list[str]:
        table = np.column_stack([self.t, self.w, self.f])
        return [separator.join(repr(float(v)) for v in row) for row in table]

    def csv(self, path: Path, heading: str = "t,gx,gy,gz,ax,ay,az") -> Path:
        path.write_text("\n".join([heading, *self.lines()]) + "\n")
        return path

    def check(self, found) -> None:
        # A conversion of units is one multiplication: right to the last bits.
        assert np.allclose(found.f_ib_b, self.f * G, rtol=1e-15, atol=0)
        assert np.allclose(found.omega_ib_b, np.radians(self.w), rtol=1e-15, atol=0)
        assert np.array_equal(found.ns, np.rint(self.t * 1e9).astype(np.int64))


@pytest.fixture
def samples() -> Samples:
    return Samples()


def refusal(*arguments) -> str:
    with pytest.raises(DataError) as error:
        read_files(*arguments)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_csv_npz_mat_and_ascii_mat_give_the_same_samples(tmp_path, samples):
    samples.check(read_files([samples.csv(tmp_path / "a.csv")], chart(tmp_path)))
    arrays = {"t": samples.t, "acc": samples.f, "gyr": samples.w}
    np.savez(tmp_path / "a.npz", **arrays)
    savemat(tmp_path / "a.mat", arrays)
    savemat(tmp_path / "nested.mat", {"imu": arrays})
    matrices = {"accel": {"columns": "acc"}, "gyro": {"columns": "gyr"}}
    samples.check(read_files([tmp_path / "a.npz"], chart(tmp_path, **matrices)))
    samples.check(read_files([tmp_path / "a.mat"], chart(tmp_path, **matrices)))
    nested = {"time": {"column": "imu.t"}, "accel": {"columns": "imu.acc"}, "gyro": {"columns": "imu.gyr"}}
    samples.check(read_files([tmp_path / "nested.mat"], chart(tmp_path, **nested)))
    (tmp_path / "ascii.mat").write_text("\n".join(samples.lines("   ")))
    numbers = {"time": {"column": 1}, "gyro": {"columns": [2, 3, 4]}, "accel": {"columns": [5, 6, 7]}}
    samples.check(read_files([tmp_path / "ascii.mat"], chart(tmp_path, **numbers)))


def test_single_columns_of_a_matrix_can_be_named_and_a_matrix_may_lie_on_its_side(tmp_path, samples):
    np.savez(tmp_path / "a.npz", t=samples.t, acc=samples.f.T, gyr=samples.w)
    columns = {"accel": {"columns": "acc"}, "gyro": {"columns": ["gyr[1]", "gyr[2]", "gyr[3]"]}}
    samples.check(read_files([tmp_path / "a.npz"], chart(tmp_path, **columns)))


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_delimiters_and_the_decimal_comma_are_read(tmp_path, samples, separator):
    text = "\n".join(samples.lines(separator)).replace(".", ",")
    (tmp_path / "a.csv").write_text(separator.join(["t", "gx", "gy", "gz", "ax", "ay", "az"]) + "\n" + text)
    samples.check(read_files([tmp_path / "a.csv"], chart(tmp_path, decimal=",")))


def test_headings_after_a_comment_sign_and_words_before_them_are_understood(tmp_path, samples):
    path = samples.csv(tmp_path / "a.csv", heading="# my logger 3\n\n#t,gx,gy,gz,ax,ay,az")
    samples.check(read_files([path], chart(tmp_path)))


def test_raw_counts_with_bias_scale_and_sign_become_what_was_measured(tmp_path, samples):
    counts = samples.f * [100.0, 110.0, 120.0] * [1, -1, 1] + [32768, 32000, 33000]
    np.savez(tmp_path / "a.npz", t=samples.t, acc=counts, gyr=samples.w)
    accel = {"columns": "acc", "counts_per_unit": [100, 110, 120], "sign": [1, -1, 1], "bias": [32768, 32000, 33000]}
    found = read_files([tmp_path / "a.npz"], chart(tmp_path, accel=accel, gyro={"columns": "gyr"}))
    # Counts of 33000 hold a value of one g only to 33000 / 100 roundings of a double.
    assert np.allclose(found.f_ib_b, samples.f * G, rtol=0, atol=33000 / 100 * 1e-15 * G)


def test_stamps_of_a_date_keep_every_nanosecond(tmp_path, samples):
    ns = 1_403_636_579_763_555_584 + np.arange(40) * 5_000_001
    rows = [line.split(",", 1)[1] for line in samples.lines()]
    whole = tmp_path / "ns.csv"
    whole.write_text("\n".join(["t,gx,gy,gz,ax,ay,az", *(f"{t},{r}" for t, r in zip(ns, rows, strict=True))]))
    assert np.array_equal(read_files([whole], chart(tmp_path, time={"unit": "ns"})).ns, ns)
    split = tmp_path / "s.csv"
    text = [f"{t // 10**9}.{t % 10**9:09d},{r}" for t, r in zip(ns, rows, strict=True)]
    split.write_text("\n".join(["t,gx,gy,gz,ax,ay,az", *text]))
    assert np.array_equal(read_files([split], chart(tmp_path)).ns, ns)
    np.savez(tmp_path / "ns.npz", t=ns, acc=samples.f, gyr=samples.w)
    arrays = {"time": {"unit": "ns"}, "accel": {"columns": "acc"}, "gyro": {"columns": "gyr"}}
    assert np.array_equal(read_files([tmp_path / "ns.npz"], chart(tmp_path, **arrays)).ns, ns)


def test_dates_and_a_stated_start_are_read_as_utc(tmp_path, samples):
    moment = np.datetime64("2024-05-31T12:00:00", "ns")
    rows = [line.split(",", 1)[1] for line in samples.lines()]
    dates = [str(moment + np.timedelta64(10_000_000 * (k + 1), "ns")) + "Z" for k in range(40)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t,gx,gy,gz,ax,ay,az", *(f"{d},{r}" for d, r in zip(dates, rows, strict=True))]))
    dated = read_files([path], chart(tmp_path, time={"unit": "iso8601"})).ns
    assert dated[0] == moment.astype(np.int64) + 10_000_000
    started = chart(tmp_path, time={"start": "2024-05-31T14:00:00+02:00"})
    assert np.array_equal(read_files([samples.csv(tmp_path / "b.csv")], started).ns, dated)


def test_a_file_without_times_is_stamped_by_its_rate(tmp_path, samples):
    found = read_files([samples.csv(tmp_path / "a.csv")], chart(tmp_path, time={"column": None, "rate_hz": 100.0}))
    samples.check(found)


def test_gaps_jitter_and_nan_survive_the_way_into_the_bag(tmp_path, samples):
    samples.t[20:] += 3.0
    samples.t += np.random.default_rng(1).uniform(-1e-3, 1e-3, 40)
    samples.f[7, 1] = np.nan
    found = read_files([samples.csv(tmp_path / "a.csv")], chart(tmp_path))
    write_imported(tmp_path / "bag", found)
    read = read_recording(tmp_path / "bag")
    assert read.rejected == 1
    kept = np.delete(found.ns, 7)
    assert np.abs((read.start_ns + read.t * 1e9) - kept).max() < 1.0
    assert np.array_equal(read.f_ib_b, np.delete(found.f_ib_b, 7, axis=0))


@pytest.mark.parametrize(
    "wrong",
    [{20: "210"}, {20: "0.0021"}, {20: "2.1", 30: "-0"}, {0: "100"}, {39: "0.04"}, {0: "7", 20: "210", 39: "0.04"}],
)
def test_a_lone_stamp_that_lost_its_place_is_left_out_with_its_line(tmp_path, wrong):
    samples = Samples(1000)
    rows = [k if k < 39 else 999 for k in wrong]
    lines = samples.csv(tmp_path / "a.csv").read_text().splitlines()
    for row, stamp in zip(rows, wrong.values(), strict=True):
        lines[row + 1] = ",".join([stamp, *lines[row + 1].split(",")[1:]])
    (tmp_path / "a.csv").write_text("\n".join(lines))
    found = read_files([tmp_path / "a.csv"], chart(tmp_path))
    samples.t, samples.w, samples.f = (np.delete(x, rows, axis=0) for x in (samples.t, samples.w, samples.f))
    samples.check(found)
    numbered = ", ".join(str(row + 2) for row in rows)
    assert [note for note in found.notes if f"(line {numbered})" in note and "left out" in note]


@pytest.mark.parametrize(
    "order", [[*range(20), 21, 20, *range(22, 40)], [*range(10), *range(25, 40)], [0, *range(25, 40)], [20, *range(20)]]
)
def test_late_samples_and_gaps_are_no_lone_stamps(tmp_path, samples, order):
    samples.t, samples.w, samples.f = (x[order] for x in (samples.t, samples.w, samples.f))
    found = read_files([samples.csv(tmp_path / "a.csv")], chart(tmp_path))
    assert len(found.ns) == len(order) - (order[0] == 20)


def test_two_files_with_the_same_stamps_are_put_side_by_side(tmp_path, samples):
    for name, part in (("x_acc.csv", samples.f), ("x_gyro.csv", samples.w)):
        np.savetxt(tmp_path / name, np.column_stack([samples.t, part]), fmt="%.17g", delimiter=",")
    parts = {
        "time": {"column": 1},
        "accel": {"file": "*_acc.csv", "columns": [2, 3, 4]},
        "gyro": {"file": "*_gyro.csv", "columns": [2, 3, 4]},
    }
    files = [tmp_path / "x_gyro.csv", tmp_path / "x_acc.csv"]
    samples.check(read_files(files, chart(tmp_path, **parts)))
    assert "which of" in refusal(files, chart(tmp_path, **{**parts, "accel": {"columns": [2, 3, 4]}}))
    assert "fits none" in refusal(files, chart(tmp_path, **{**parts, "accel": {**parts["accel"], "file": "*.mat"}}))


def test_accelerometers_with_stamps_of_their_own_keep_their_integral(tmp_path):
    slow, fast = np.arange(1, 101) * 0.01, np.arange(1, 401) * 0.0025 + 0.001
    f = np.cumsum(np.random.default_rng(2).standard_normal((400, 3)), axis=0)
    np.savez(tmp_path / "a.npz", t=slow, ta=fast, acc=f, gyr=np.zeros((100, 3)))
    found = read_files(
        [tmp_path / "a.npz"],
        chart(tmp_path, accel={"columns": "acc", "time": "ta", "unit": "m/s^2"}, gyro={"columns": "gyr"}),
    )
    assert "stamps of their own" in found.notes[0]
    # Over whole intervals of the gyro the velocity is that of the fast samples, but for where it begins and ends:
    # within less than one fast interval of the largest force at each end.
    velocity = found.f_ib_b.sum(axis=0) * 0.01
    inside = (fast > found.ns[0] * 1e-9 - 0.01) & (fast <= found.ns[-1] * 1e-9)
    assert np.abs(velocity - f[inside].sum(axis=0) * 0.0025).max() < 2 * 0.0025 * np.abs(f).max()


def test_a_gap_of_the_accelerometer_is_not_filled(tmp_path):
    t = np.arange(1, 101) * 0.01
    keep = (t < 0.4) | (t > 0.6)
    np.savez(tmp_path / "a.npz", t=t, ta=t[keep] + 0.004, acc=np.ones((keep.sum(), 3)), gyr=np.zeros((100, 3)))
    columns = {"accel": {"columns": "acc", "time": "ta"}, "gyro": {"columns": "gyr"}}
    found = read_files([tmp_path / "a.npz"], chart(tmp_path, **columns))
    inside = (found.ns > 0.42e9) & (found.ns < 0.6e9)
    assert not inside.any()
    assert np.allclose(found.f_ib_b, G)


@pytest.mark.parametrize(("line", "column", "cell"), [(5, "gy", "x"), (12, "az", ""), (30, "t", "--")])
def test_a_cell_that_is_no_number_is_named_by_line_and_column(tmp_path, samples, line, column, cell):
    path = samples.csv(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    cells = lines[line - 1].split(",")
    cells[["t", "gx", "gy", "gz", "ax", "ay", "az"].index(column)] = cell
    lines[line - 1] = ",".join(cells)
    path.write_text("\n".join(lines))
    assert f"line {line}, column {column}: '{cell}'" in refusal([path], chart(tmp_path))


def test_a_line_that_ends_early_is_named(tmp_path, samples):
    path = samples.csv(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    lines[20] = "0.2,1,2"
    path.write_text("\n".join(lines))
    assert "line 21 has 3 columns" in refusal([path], chart(tmp_path))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"gyro": {"columns": ["wx", "gy", "gz"]}}, "no column 'wx' (there are: t, gx, gy"),
        ({"gyro": {"columns": [2, 3, 9]}}, "no column 9 (line 2 has 7)"),
        ({"time": {"start": "1960-01-01T00:00:00"}}, "line 2, column t: a time before 1970"),
        ({"time": {"start": "9999-12-31T23:59:59"}}, "line 2, column t: a time not between 1970 and 2096"),
        ({"time": {"start": "0001-01-01T00:00:00Z"}}, "line 2, column t: a time not between 1970 and 2096"),
        ({"time": {"unit": "99999999999 h"}}, "line 2, column t: "),
        ({"gyro": {"columns": ["gx", "gx", "gz"]}}, "gyro x and gyro y both name column 'gx' of "),
        ({"gyro": {"columns": ["gx", "gy", 2]}}, "gyro x and gyro z both name column '2' of "),
        ({"gyro": {"columns": ["ax", "gy", "gz"]}}, "accel x and gyro x both name column 'ax' of "),
        ({"accel": {"columns": ["t", "ay", "az"]}}, "accel x and time both name column 't' of "),
        ({"temperature": {"column": "gz"}}, "gyro z and temperature both name column 'gz' of "),
    ],
)
def test_columns_and_times_that_are_not_there_are_told(tmp_path, samples, changes, told):
    assert told in refusal([samples.csv(tmp_path / "a.csv")], chart(tmp_path, **changes))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"gyro": {"unit": "m/s^2"}}, "gyro.unit: 'm/s^2' is the wrong unit"),
        ({"accel": {"unit": "furlong"}}, "accel.unit: unknown unit 'furlong'"),
        ({"accel": {"columns": ["ax", "ay"]}}, "accel: columns: expected three"),
        ({"accel": {"counts_per_unit": 0}}, "counts_per_unit: zero"),
        ({"gyro": {"sign": 2}}, "gyro.sign"),
        ({"speed": {}}, "speed: unknown key"),
        ({"time": {"rate_hz": 100.0}}, "either column or rate_hz"),
        ({"time": {"column": True}}, "time.column: true names no column"),
        ({"delimiter": "ab"}, "delimiter: 'ab' cannot stand between columns"),
        ({"delimiter": "\n"}, "delimiter: '\\n' cannot stand between columns"),
    ],
)
def test_a_wrong_map_is_told_by_file_and_key(tmp_path, changes, told):
    with pytest.raises(DataError) as error:
        chart(tmp_path, **changes)
    assert told in str(error.value)
    assert "map.yaml" in str(error.value)


def test_files_that_are_not_what_they_are_called_are_told(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"nothing")
    assert "not a file of numpy" in refusal([tmp_path / "a.npz"], chart(tmp_path))
    (tmp_path / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n")
    assert "not a MAT file" in refusal([tmp_path / "new.mat"], chart(tmp_path))
    (tmp_path / "cut.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(200))
    assert "not a MAT file" in refusal([tmp_path / "cut.mat"], chart(tmp_path))
    (tmp_path / "words.csv").write_text("all\nwords\n")
    assert "no line of numbers" in refusal([tmp_path / "words.csv"], chart(tmp_path))
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01\x9f")
    assert "is not text" in refusal([tmp_path / "binary.csv"], chart(tmp_path))
    assert "no such file" in refusal([tmp_path / "absent.csv"], chart(tmp_path))
    assert "is a folder: name the files in it" in refusal([tmp_path], chart(tmp_path))


def test_the_example_of_the_documentation_works(tmp_path):
    page = (Path(__file__).parents[3] / "doc" / "recordings.md").read_text()
    blocks = [
        "\n".join(line[4:] for line in block.splitlines()) for block in page.split("\n\n") if block.startswith("    ")
    ]
    (map_text,) = [block for block in blocks if block.startswith("format: sdimu-import/1")]
    (csv,) = [block for block in blocks if block.startswith("t_us,")]
    (tmp_path / "map.yaml").write_text(map_text)
    (tmp_path / "a.csv").write_text(csv)
    found = read_files([tmp_path / "a.csv"], load_import_map(tmp_path / "map.yaml"))
    assert np.allclose(found.f_ib_b, np.array([[12.1, -3.0, 1001.2]]) * 1e-3 * G)
    assert np.allclose(found.omega_ib_b, np.radians([[22.0 / 131.0, 20.0 / 131.0, -33.0 / 131.0]]))
    assert found.temperature[1].tolist() == [24.5]


def test_the_map_of_the_xsens_recording_reads_it_whole(recorded):
    files = [recorded(f"xsens/xsens_{kind}.mat") for kind in ("acc", "gyro")]
    found = read_files(files, load_import_map("xsens"))
    assert found.ns.shape == (51175,)
    assert found.notes == ()
    # Errors of percents and a bias of tenths of g: in the first 50 s of rest |f| is g to 15 %, the rate below 5 deg/s.
    rest = found.ns < 40_000_000_000
    assert abs(np.linalg.norm(found.f_ib_b[rest].mean(axis=0)) / G - 1.0) < 0.15
    assert np.linalg.norm(found.omega_ib_b[rest].mean(axis=0)) < np.radians(6.0)
