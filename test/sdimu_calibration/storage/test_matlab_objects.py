"""Timetables and tables of MATLAB, of version 7 and 7.3: columns as MATLAB names them, dates to the nanosecond."""

from __future__ import annotations

import struct
from importlib import util

import numpy as np
import pandas as pd
import pytest
import yaml

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.importing.array_table import read_mat
from sdimu_calibration.storage.importing.import_map import ImportMap
from sdimu_calibration.storage.importing.importer import read_files
from sdimu_calibration.storage.importing.map_proposal import propose_maps
from sdimu_sim.core.by_hand import ByHand, by_hand_recording

# `make setup` installs both; mat-io has no wheel for Python 3.14 yet.
matio = pytest.importorskip("matio")
h5py = pytest.importorskip("h5py")
EmptyMatStruct, MatlabOpaque = matio.utils.matclass.EmptyMatStruct, matio.utils.matclass.MatlabOpaque

BEGIN_NS = 1_717_156_800_000_000_000
VERSIONS = ("v7", "v7.3")


@pytest.fixture(scope="module")
def hand():
    """Eight attitudes by hand at 25 Hz."""
    return by_hand_recording(ByHand(8, load_imu("mems_by_hand"), load_site("daejeon"), seed=3, rate_hz=25.0))[0]


def cells(*values):
    """A list of MATLAB, shape (1, n)."""
    out = np.empty((1, len(values)), dtype=object)
    for k, value in enumerate(values):
        out[0, k] = value
    return out


def words(*texts):
    return cells(*[np.array([text]) for text in texts])


def moments(ns):
    """A datetime as MATLAB stores it: milliseconds since 1970 in a double, and what that rounds off."""
    rounded = ns / 1e6
    # 64ths of a millisecond are 15625 ns, and exact in a double.
    count = np.rint(rounded * 64).astype(np.int64)
    data = (count / 64 + 1j * ((ns - count * 15_625) / 1e6)).reshape(-1, 1)
    return MatlabOpaque({"data": data, "tz": np.empty((0, 0), "U1"), "fmt": np.empty((0, 0), "U1")}, "datetime")


def duration(seconds):
    return MatlabOpaque({"millis": np.reshape(seconds, (-1, 1)) * 1e3, "fmt": "s"}, "duration")


def structure(**fields):
    out = np.empty((1, 1), dtype=[(key, object) for key in fields])
    for key, value in fields.items():
        out[0, 0][key] = value
    return out


def timetable(times, rows, units=None, dimension="Time", **variables):
    """A timetable as MATLAB stores it."""
    nothing = np.empty((0, 0), dtype=object)
    inside = structure(
        data=cells(*[np.reshape(value, (rows, -1)) for value in variables.values()]),
        dimNames=words(dimension, "Variables"),
        varNames=words(*variables),
        numRows=np.float64(rows),
        numVars=np.float64(len(variables)),
        rowTimes=times,
        CustomProps=EmptyMatStruct(np.empty((1, 1), dtype=object)),
        versionSavedFrom=np.float64(6),
        minCompatibleVersion=np.float64(2),
        useVarNamesOrig=np.bool_(False),
        useDimNamesOrig=np.bool_(False),
        dimNamesOrig=nothing,
        varNamesOrig=nothing,
        varUnits=words(*units) if units else nothing,
    )
    return MatlabOpaque({"any": inside}, "timetable")


def saved(path, version, **variables):
    matio.save_to_mat(str(path), variables, version=version)
    return path


def chart(**parts):
    return ImportMap.model_validate(
        {
            "format": "sdimu-import/1",
            "time": {"column": "TT.Time"},
            "accel": {"columns": ["TT.acc"], "unit": "m/s^2"},
            "gyro": {"columns": ["TT.gyr[1]", "TT.gyr[2]", "TT.gyr[3]"], "unit": "rad/s"},
        }
        | parts
    )


@pytest.mark.parametrize("version", VERSIONS)
def test_a_timetable_of_dates_keeps_its_nanoseconds_and_all_columns_of_a_matrix(tmp_path, version, hand):
    ns = BEGIN_NS + np.rint(hand.t * 1e9).astype(np.int64) + np.arange(len(hand.t)) % 7
    other = np.column_stack([ns % 3, ns % 5, ns % 11]).astype(np.float32)
    table = timetable(moments(ns), len(ns), acc=hand.f_ib_b, gyr=hand.omega_ib_b, other=other)
    path = saved(tmp_path / "a.mat", version, TT=table)
    found = read_files([path], chart(temperature={"column": "TT.other[2]"}))
    assert np.array_equal(found.ns, ns)
    assert np.array_equal(found.f_ib_b, hand.f_ib_b)
    assert np.array_equal(found.omega_ib_b, hand.omega_ib_b)
    assert np.array_equal(found.temperature[1], ns % 5)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("how", ["durations", "rate", "step"])
def test_durations_and_even_times_of_rows_are_seconds(tmp_path, version, how, hand):
    n = len(hand.t)
    even = {"origin": duration(0.5), "specifiedAsRate": np.bool_(how == "rate"), "sampleRate": np.float64(100.0)}
    times = {
        "durations": duration(0.5 + np.arange(n) * 0.01),
        "rate": structure(**even, stepSize=duration(np.nan)),
        "step": structure(**even, stepSize=duration(0.01)),
    }[how]
    path = saved(tmp_path / "a.mat", version, TT=timetable(times, n, acc=hand.f_ib_b, gyr=hand.omega_ib_b))
    assert np.array_equal(read_files([path], chart()).ns, 500_000_000 + np.arange(n) * 10_000_000)


def test_even_dates_begin_where_matlab_says(tmp_path, hand):
    n = len(hand.t)
    begin = moments(np.array([BEGIN_NS + 3]))
    times = structure(
        origin=begin, specifiedAsRate=np.bool_(True), sampleRate=np.float64(128.0), stepSize=duration(np.nan)
    )
    path = saved(tmp_path / "a.mat", "v7", TT=timetable(times, n, acc=hand.f_ib_b, gyr=hand.omega_ib_b))
    assert np.array_equal(read_files([path], chart()).ns, BEGIN_NS + 3 + np.arange(n) * 7_812_500)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_table_beside_numbers_and_structures_is_read(tmp_path, version, hand):
    names = ("ax", "ay", "az", "gx", "gy", "gz")
    frame = pd.DataFrame(dict(zip(names, np.hstack([hand.f_ib_b, hand.omega_ib_b]).T, strict=True)))
    path = saved(
        tmp_path / "a.mat", version, log={"T": frame, "word": "x"}, t=hand.t, on=np.array([True, False]), deep={"a": {}}
    )
    found = read_files(
        [path],
        chart(
            time={"column": "t"},
            accel={"columns": [f"log.T.{name}" for name in names[:3]], "unit": "m/s^2"},
            gyro={"columns": [f"log.T.{name}" for name in names[3:]], "unit": "rad/s"},
        ),
    )
    assert np.array_equal(found.f_ib_b, hand.f_ib_b)
    assert np.array_equal(found.omega_ib_b, hand.omega_ib_b)
    with pytest.raises(DataError, match=r"log\.word is not a list or matrix of numbers"):
        read_files([path], chart(accel={"columns": "log.word", "unit": "m/s^2"}))


@pytest.mark.parametrize("version", VERSIONS)
def test_a_map_is_proposed_with_the_units_that_the_table_states(tmp_path, version, hand):
    ns = BEGIN_NS + np.rint(hand.t * 1e9).astype(np.int64)
    table = timetable(
        moments(ns), len(ns), ("deg/s", "g", "degC"),
        AngularRate=np.degrees(hand.omega_ib_b), Acceleration=hand.f_ib_b / 9.80665, Temp=np.full(len(ns), 25.0),
    )  # fmt: skip
    path = saved(tmp_path / "a.mat", version, TT=table, note=np.arange(3.0))
    (proposal,) = propose_maps([path])
    assert "in g by the headings" in proposal.text
    assert "in deg/s by the headings" in proposal.text
    found = read_files([path], ImportMap.model_validate(yaml.safe_load(proposal.text)))
    assert np.array_equal(found.ns, ns)
    np.testing.assert_allclose(found.f_ib_b, hand.f_ib_b, rtol=1e-12)
    np.testing.assert_allclose(found.omega_ib_b, hand.omega_ib_b, rtol=1e-12)


def test_a_timetable_for_each_sensor_is_proposed_with_its_own_clock(tmp_path, hand):
    """As MATLAB Mobile logs them: Acceleration and AngularVelocity, each with X, Y, Z and a Timestamp."""
    n = len(hand.t)
    ns = BEGIN_NS + np.rint(hand.t * 1e9).astype(np.int64)
    acc, gyr = (dict(zip("XYZ", values.T, strict=True)) for values in (hand.f_ib_b, hand.omega_ib_b))
    gyr = {axis: values[:-5] for axis, values in gyr.items()}
    path = saved(
        tmp_path / "a.mat",
        "v7",
        Acceleration=timetable(moments(ns), n, dimension="Timestamp", **acc),
        AngularVelocity=timetable(moments(ns[:-5] + 1_000_000), n - 5, dimension="Timestamp", **gyr),
    )
    (proposal,) = propose_maps([path])
    found = read_files([path], ImportMap.model_validate(yaml.safe_load(proposal.text)))
    assert found.ns[-1] == ns[-6] + 1_000_000
    assert any("stamps of their own" in note for note in found.notes)
    assert np.array_equal(found.omega_ib_b[-100:], hand.omega_ib_b[-105:-5])


def test_columns_of_arrays_without_a_table_are_proposed_too(tmp_path, hand):
    np.savez(tmp_path / "a.npz", t=hand.t, acc=hand.f_ib_b, gyro=np.degrees(hand.omega_ib_b), label=np.arange(3))
    (proposal,) = propose_maps([tmp_path / "a.npz"])
    found = read_files([tmp_path / "a.npz"], ImportMap.model_validate(yaml.safe_load(proposal.text)))
    np.testing.assert_allclose(found.f_ib_b, hand.f_ib_b, rtol=1e-12)
    np.testing.assert_allclose(found.omega_ib_b, hand.omega_ib_b, rtol=1e-12)


def test_a_timetable_with_hardly_a_number_is_refused(tmp_path, hand):
    np.savez(tmp_path / "a.npz", t=hand.t, acc=hand.f_ib_b, gyro=np.full((len(hand.t), 3), np.nan))
    with pytest.raises(DataError, match=r"0 of .* hold a number in all of the columns acc"):
        propose_maps([tmp_path / "a.npz"])


def test_any_text_names_a_variable(tmp_path, hand):
    n = len(hand.t)
    table = timetable(duration(hand.t), n, **{"Acc [m/s^2]": hand.f_ib_b, "Größe 1": hand.omega_ib_b})
    path = saved(tmp_path / "a.mat", "v7", TT=table)
    accel = {"columns": ["TT.Acc [m/s^2]"], "unit": "m/s^2"}
    gyro = {"columns": [f"TT.Größe 1[{k}]" for k in (1, 2, 3)], "unit": "rad/s"}
    assert np.array_equal(read_files([path], chart(accel=accel, gyro=gyro)).f_ib_b, hand.f_ib_b)


def test_dates_are_no_numbers_and_numbers_no_dates(tmp_path, hand):
    n = len(hand.t)
    ns = BEGIN_NS + np.arange(n) * 10_000_000
    path = saved(tmp_path / "a.mat", "v7", TT=timetable(moments(ns), n, acc=hand.f_ib_b, gyr=hand.omega_ib_b))
    with pytest.raises(DataError, match=r"TT\.Time holds dates, expected numbers"):
        read_files([path], chart(accel={"columns": "TT.Time", "unit": "m/s^2"}, time={"column": "TT.acc[1]"}))
    with pytest.raises(DataError, match=r"TT\.acc\[1\] holds no dates"):
        read_files([path], chart(time={"column": "TT.acc[1]", "unit": "iso8601"}))


@pytest.mark.parametrize("version", VERSIONS)
def test_without_matio_one_line_says_what_to_install(tmp_path, version, monkeypatch, hand):
    n = len(hand.t)
    path = saved(tmp_path / "a.mat", version, TT=timetable(duration(hand.t), n, acc=hand.f_ib_b, gyr=hand.omega_ib_b))
    (tmp_path / "lib").mkdir()
    hides = "import importlib.util as u\nold = u.find_spec\nu.find_spec = lambda n: None if n == 'matio' else old(n)"
    (tmp_path / "lib" / "sitecustomize.py").write_text(hides)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "lib"))
    found = util.find_spec
    monkeypatch.setattr(
        "sdimu_calibration.storage.importing.array_table.find_spec",
        lambda name: None if name == "matio" else found(name),
    )
    with pytest.raises(DataError, match=r'pip install "sdimu_calibration\[matlab\]"; or .*(in MATLAB: t = TT|-v7)'):
        read_files([path], chart())


def test_data_in_another_file_are_not_read(tmp_path):
    secret = tmp_path / "secret.bin"
    secret.write_bytes(struct.pack("<100d", *range(100)))
    for name, make in {
        "link": lambda file: file.__setitem__("x", h5py.ExternalLink(str(tmp_path / "other.mat"), "x")),
        "storage": lambda file: file.create_dataset("x", (100, 1), "f8", external=[(str(secret), 0, 800)]),
        "soft": lambda file: file.__setitem__("x", h5py.SoftLink("/y")),
    }.items():
        path = tmp_path / f"{name}.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            make(file)
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
        with pytest.raises(DataError, match="x lies in another file or place"):
            read_mat(path)
