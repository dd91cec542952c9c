"""Every format of file that a verb or node reads: how a sound one is made, how it is damaged, and who reads it."""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.io import savemat

from rate_table_sim.table_file import load_table
from sdimu_calibration.core.compensation import compensator, linear_model
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.report.table import rows
from sdimu_calibration.storage.bags import cdr
from sdimu_calibration.storage.bags.bag_info import read_info
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.cut_bag import cut_bag
from sdimu_calibration.storage.bags.mcap_file import McapFile
from sdimu_calibration.storage.bags.recover import recover
from sdimu_calibration.storage.bags.unpacking import unpacked
from sdimu_calibration.storage.export import FORMS, export
from sdimu_calibration.storage.files.config import config_folder, load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.files.diagnosis_file import read_diagnosis
from sdimu_calibration.storage.files.effect_file import load_effect
from sdimu_calibration.storage.files.journal import Journal
from sdimu_calibration.storage.files.json_file import write_json
from sdimu_calibration.storage.files.noise_file import load_noise
from sdimu_calibration.storage.files.reference_file import read_reference, read_truth
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_calibration.storage.importing.import_map import load_import_map
from sdimu_calibration.storage.importing.importer import read_files
from sdimu_calibration.storage.importing.map_proposal import propose_maps
from sdimu_calibration.storage.opening import open_recording
from sdimu_sim.temperature_file import load_temperature

from .mutators import Random, damaged_bytes, damaged_json, damaged_text

SAMPLES = 400
CHUNK, DATA_END, FOOTER = 6, 15, 2
STAMPS = ((0, 0), (-1, 0), (2**31 - 1, 999_999_999), (-(2**31), 0), (1_700_000_000, 2**32 - 1), (1_700_000_000, 5))
"""Seconds and nanoseconds of a stamp."""
NUMBERS = (float("nan"), float("inf"), -float("inf"), 1e300, -1e300, 5e-324, 0.0, 1e10)


@dataclass(frozen=True)
class Format:
    """A format of file.

    Attributes
    ----------
    name : str
        Of the file, with its suffix.
    make : callable
        Content of a sound file.
    damage : callable
    read : callable
        Uses a file as verbs do; returns what was read, or None where no file says whether that is right.
    same : callable
        Whether what was read of a damaged file is as it was, or a part of it where the reader may leave out.
    """

    name: str
    make: Callable[[Path], bytes]
    damage: Callable[[bytes, Random], bytes]
    read: Callable[[Path], Any]
    same: Callable[[Any, Any], bool] | None = None


# ---- bags -----------------------------------------------------------------------------------------------------------


def write_bag(folder: Path) -> Path:
    """Write a short test with all topics."""
    rng = np.random.default_rng(2)
    ns = np.arange(1, SAMPLES + 1) * 10_000_000
    slow = ns[::40]
    write_recording(
        folder,
        BagContent(
            start_ns=1_700_000_000_000_000_000,
            imu_ns=ns,
            omega_ib_b=rng.standard_normal((SAMPLES, 3)),
            f_ib_b=rng.standard_normal((SAMPLES, 3)),
            status=(slow, slow % 3 > 0, np.arange(len(slow))),
            joint_states=(slow, ("outer", "inner"), np.zeros((len(slow), 2)), np.zeros((len(slow), 2))),
            temperature=(slow, 20.0 + rng.standard_normal(len(slow))),
        ),
    )
    return folder


def make_bag(folder: Path) -> bytes:
    return next(write_bag(folder / "bag").glob("*.mcap")).read_bytes()


def in_folder(path: Path) -> Path:
    """Put a file into a folder that has nothing else, as bags stand."""
    folder = path.with_suffix("")
    folder.mkdir()
    return path.rename(folder / path.name)


def samples(path: Path) -> Hashable:
    read = read_recording(path)
    log = None if read.temperature is None else read.temperature.value.tobytes()
    phase = None if read.phase is None else read.phase.stop.tobytes()
    return read.start_ns, read.t.tobytes(), read.omega_ib_b.tobytes(), read.f_ib_b.tobytes(), log, phase


def read_bag(path: Path) -> Hashable:
    """Read as every verb does; a part of it, and what can be mended, must be readable or told as well."""
    path = in_folder(path)
    told(read_info, path)
    told(cut_bag, path, path.parent / "cut", 0.5, 2.0)
    found = told(samples, path)
    if isinstance(found, DataError) and not isinstance(told(recover, path), DataError):
        return "mended", rates(told(read_recording, path))
    if isinstance(found, DataError):
        raise found
    return found


def told(use: Callable[..., Any], *arguments: Any) -> Any:
    try:
        return use(*arguments)
    except DataError as error:
        return error


def rates(recording: Any) -> Any:
    """Rows of the samples of a recording; none where it is an error."""
    if isinstance(recording, DataError):
        return frozenset()
    ns = recording.start_ns + np.rint(recording.t * 1e9).astype(np.int64)
    table = np.column_stack([ns.view(np.float64), recording.omega_ib_b, recording.f_ib_b])
    return frozenset(map(bytes, table))


def same_bag(sound: Any, found: Any) -> bool:
    """A bag is read whole, or mended to samples that it had."""
    if found[0] != "mended":
        return bool(found == sound)
    start, t, omega, force = sound[0], *(np.frombuffer(part) for part in sound[1:4])
    ns = start + np.rint(t * 1e9).astype(np.int64)
    table = np.column_stack([ns.view(np.float64), omega.reshape(-1, 3), force.reshape(-1, 3)])
    return bool(found[1] <= frozenset(map(bytes, table)))


def chunks_of(content: bytes) -> list[bytes]:
    """Records of the data section of our own file, chunks unpacked."""
    at, found = 8, []
    while at < len(content) - 8:
        kind, length = struct.unpack_from("<BQ", content, at)
        if kind == CHUNK:
            size, name = struct.unpack_from("<Q", content, at + 25)[0], content[at + 41 : at + 45]
            assert name == b"zstd"
            found.append(unpacked("zstd", content[at + 53 : at + 9 + length], size))
        at += 9 + length
    return found


def repacked(records: bytes, checksum: bool) -> bytes:
    """MCAP file of one chunk that is not packed, whose checksum is right: damage from before it was written."""
    stream = io.BytesIO()
    McapFile(stream)
    head = struct.pack("<QQQII", 0, 0, len(records), zlib.crc32(records) if checksum else 0, 0)
    chunk = head + struct.pack("<Q", len(records)) + records
    end = struct.pack("<BQI", DATA_END, 4, 0) + struct.pack("<BQQQI", FOOTER, 20, 0, 0, 0)
    return stream.getvalue() + struct.pack("<BQ", CHUNK, len(chunk)) + chunk + end + b"\x89MCAP0\r\n"


def make_records(folder: Path) -> bytes:
    return b"".join(chunks_of(make_bag(folder)))


def damaged_messages(content: bytes, rng: Random) -> bytes:
    """Damage records, and give the file right checksums."""
    return repacked(damaged_bytes(content, rng), checksum=True)


def damaged_payloads(content: bytes, rng: Random) -> bytes:
    """Damage the bytes of single messages, the records around them being right."""
    out, at = bytearray(), 0
    while at < len(content):
        kind, length = struct.unpack_from("<BQ", content, at)
        body = content[at + 9 : at + 9 + length]
        if kind == 5 and rng.random() < 0.02:
            body = body[:22] + damaged_bytes(body[22:], rng)
        elif kind in {3, 4} and rng.random() < 0.1:
            body = damaged_bytes(body, rng)
        out += struct.pack("<BQ", kind, len(body)) + body
        at += 9 + length
    return repacked(bytes(out), checksum=True)


def damaged_values(content: bytes, rng: Random) -> bytes:
    """Put extreme stamps, numbers and bytes of text into messages whose lengths stay as they are."""
    out, at = bytearray(content), 0
    share = 10.0 ** rng.uniform(-3.0, -0.5)
    while at < len(content):
        kind, length = struct.unpack_from("<BQ", content, at)
        if kind == 5 and rng.random() < share:
            first = at + 31
            kind_of = int(rng.integers(3))
            if kind_of == 0:
                struct.pack_into("<iI", out, first + 4, *STAMPS[int(rng.integers(len(STAMPS)))])
            elif kind_of == 1 and length > 22 + 300:
                place = first + length - 22 - 8 * int(rng.integers(1, 38))
                struct.pack_into("<d", out, place, NUMBERS[int(rng.integers(len(NUMBERS)))])
            else:
                out[first + int(rng.integers(12, length - 22))] = int(rng.integers(256))
        at += 9 + length
    return repacked(bytes(out), checksum=True)


def read_foreign(path: Path) -> None:
    """Open a bag whose content is what it says, however strange, as far as an estimate does not begin."""
    read_bag(path)
    told(open_recording, path.with_suffix("") / path.name)


def make_sqlite(folder: Path) -> bytes:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    ns = np.arange(1, 61) * 10_000_000
    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder / "sqlite", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/imu/data_raw", cdr.IMU, typestore=types)
        for at, raw in zip(ns, cdr.encode_imu(ns, np.ones((60, 3)), np.ones((60, 3))), strict=True):
            writer.write(connection, int(at), raw)
    return next((folder / "sqlite").glob("*.db3")).read_bytes()


def read_file_bag(path: Path) -> None:
    samples(path)


def make_metadata(folder: Path) -> bytes:
    return (write_bag(folder / "meta") / "metadata.yaml").read_bytes()


def read_metadata_bag(path: Path) -> Hashable:
    """Read a sound file under damaged metadata."""
    folder = path.with_name("folder")
    write_bag(folder)
    (folder / "metadata.yaml").write_bytes(path.read_bytes())
    told(read_info, folder)
    return samples(folder)


# ---- tables ---------------------------------------------------------------------------------------------------------

MAP = {
    "format": "sdimu-import/1",
    "time": {"column": "t", "unit": "s"},
    "accel": {"columns": ["ax", "ay", "az"], "unit": "m/s^2"},
    "gyro": {"columns": ["gx", "gy", "gz"], "unit": "deg/s"},
    "temperature": {"column": "T", "unit": "K"},
}
COLUMNS = ("t", "ax", "ay", "az", "gx", "gy", "gz", "T")


def table() -> np.ndarray[Any, np.dtype[np.float64]]:
    t = 1.7e9 + np.arange(1, 121) * 0.01
    values = np.random.default_rng(3).standard_normal((120, 6))
    return np.column_stack([t, values, np.full(120, 293.0)])


def make_csv(_: Path) -> bytes:
    lines = [",".join(f"{value:.9f}" for value in row) for row in table()]
    return "\n".join([",".join(COLUMNS), *lines]).encode()


def make_npz(folder: Path) -> bytes:
    np.savez_compressed(folder / "x.npz", **dict(zip(COLUMNS, table().T, strict=True)))
    return (folder / "x.npz").read_bytes()


def make_mat(compressed: bool) -> Callable[[Path], bytes]:
    def make(folder: Path) -> bytes:
        nested = {"deep": {"word": "text", "cell": np.array([1, "a"], object)}}
        savemat(folder / "x.mat", dict(zip(COLUMNS, table().T, strict=True)) | nested, do_compression=compressed)
        return (folder / "x.mat").read_bytes()

    return make


def make_timetable(version: str) -> Callable[[Path], bytes]:
    def make(folder: Path) -> bytes:
        index = pd.DatetimeIndex(np.rint(table()[:, 0] * 1e3).astype("datetime64[ms]"), name="t")
        frame = pd.DataFrame(dict(zip(COLUMNS[1:], table()[:, 1:].T, strict=True)), index=index)
        pytest.importorskip("matio").save_to_mat(
            str(folder / "x.mat"), {"TT": frame, "T": frame.reset_index(drop=True)}, version=version
        )
        return (folder / "x.mat").read_bytes()

    return make


def read_timetable(path: Path) -> Hashable:
    """Read a timetable by a map, and propose one: each starts a process, so the second where the first succeeds."""
    found = read_table(path, "TT.")
    told(propose_maps, [path])
    return found


def read_table(path: Path, before: str = "") -> Hashable:
    chart = path.with_name("map.yaml")
    words = yaml.safe_load(re.sub(r"\b(t|T|[ag][xyz])\b(?!:)", rf"{before}\1", yaml.safe_dump(MAP)))
    chart.write_text(yaml.safe_dump(words))
    found = read_files([path], load_import_map(chart))
    return found.ns.tobytes(), found.omega_ib_b.tobytes(), found.f_ib_b.tobytes()


def read_map(path: Path) -> None:
    (path.with_name("x.csv")).write_bytes(make_csv(path))
    read_files([path.with_name("x.csv")], load_import_map(path))


# ---- what people write ----------------------------------------------------------------------------------------------


def shipped(kind: str, name: str) -> Callable[[Path], bytes]:
    return lambda _: (config_folder() / kind / f"{name}.yaml").read_bytes()


EFFECT = b"""format: sdimu-effect/1
name: mine
title: a bend
expressions:
  accel_x: k * ax**2 + c * k2 * wx
  gyro_y: k3 * tanh(t / tau) + k3 * min(T, 3)
parameters:
  k: {unit: m/s^2/g^2, display_unit: ug/g^2, prior: 10 ug/g^2}
  k2: {unit: m*s/m*m/s^2, prior: "1"}
  k3: {unit: rad/s, display_unit: deg/h, prior: 1 deg/h}
constants:
  tau: 300 s
  c: 2.0
"""
TRUTH = b"""format: sdimu-truth/1
coefficients:
  gyro_bias_x: {value: 1.0e-6, unit: rad/s}
  accel_bias_x: 0.001
coefficients_accelerometer_triad:
  gyro_bias_x: 1.0e-6
mean_bias: {gyro_bias_x: 2.0e-6}
site: {latitude_deg: 36.0, height_m: 70.0}
"""


def made(content: bytes) -> Callable[[Path], bytes]:
    return lambda _: content


def nothing(load: Callable[[Path], Any]) -> Callable[[Path], None]:
    """Read a file of which only its author knows what should stand in it."""

    def read(path: Path) -> None:
        load(path)

    return read


# ---- results --------------------------------------------------------------------------------------------------------


def calibration() -> Calibration:
    effects = [selection.resolve(name) for name in ("gyro_bias", "gyro_scale", "accel_bias", "accel_quadratic")]
    parameters = [p for e in effects for p in e.parameters]
    return Calibration(
        "accelerometer_triad",
        tuple(e.key for e in effects),
        tuple(p.name for p in parameters),
        tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters),
        1e-4 * np.arange(len(parameters)),
        np.eye(len(parameters)),
        {"nis": 1.0},
        {"duration_s": 3.0},
        ("a note",),
        no_history(len(parameters)),
        drift_means={"gyro_bias_x": 1.0},
    )


def make_result(folder: Path) -> bytes:
    write_result(folder / "result.json", calibration())
    return (folder / "result.json").read_bytes()


def use_result(path: Path) -> None:
    """Use a result as compensate, export, compare and replay do."""
    read = read_result(path)
    told(rows, read)
    told(linear_model, read)
    told(compensator, read, load_imu("dtg"))
    for form in FORMS:
        told(export, form, path.with_name("out") / FORMS[form].file_name, read, load_imu("dtg"))


def make_diagnosis(folder: Path) -> bytes:
    write_json(folder / "d.json", {"format": "sdimu-diagnosis/1", "verdict": "adequate", "candidates": [{"z": 3.0}]})
    return (folder / "d.json").read_bytes()


def make_journal(folder: Path) -> bytes:
    rng = np.random.default_rng(1)
    journal = Journal(folder / "j", "options")
    for k in range(20):
        journal.samples(np.arange(10, dtype=np.int64) + k, rng.standard_normal((10, 3)), rng.standard_normal((10, 3)))
        journal.status(k, True, k)
        journal.temperature(k, 20.0)
    journal.close()
    return (folder / "j").read_bytes()


def read_journal(path: Path) -> list[str]:
    journal = Journal(path, "options")
    records = [repr(vars(record)) for record in journal.records()]
    journal.close()
    return records


FORMATS: dict[str, Format] = {
    "bag": Format("x_0.mcap", make_bag, damaged_bytes, read_bag, same_bag),
    "bag, right checksums": Format("x_0.mcap", make_records, damaged_messages, read_foreign),
    "bag, right records": Format("x_0.mcap", make_records, damaged_payloads, read_foreign),
    "bag, right layouts": Format("x_0.mcap", make_records, damaged_values, read_foreign),
    "bag, SQLite": Format("x.db3", make_sqlite, damaged_bytes, read_file_bag),
    "metadata.yaml": Format("metadata.yaml", make_metadata, damaged_text, read_metadata_bag, lambda a, b: a == b),
    "CSV": Format("x.csv", make_csv, damaged_text, nothing(read_table)),
    "NPZ": Format("x.npz", make_npz, damaged_bytes, read_table, lambda a, b: a == b),
    "MAT": Format("x.mat", make_mat(False), damaged_bytes, nothing(read_table)),
    "MAT, packed": Format("x.mat", make_mat(True), damaged_bytes, read_table, lambda a, b: a == b),
    "MAT, timetable": Format("x.mat", make_timetable("v7"), damaged_bytes, read_timetable, lambda a, b: a == b),
    "MAT, 7.3": Format("x.mat", make_timetable("v7.3"), damaged_bytes, nothing(read_timetable)),
    "import map": Format("m.yaml", made(yaml.safe_dump(MAP).encode()), damaged_text, read_map),
    "site": Format("s.yaml", shipped("site", "daejeon"), damaged_text, nothing(load_site)),
    "IMU": Format("i.yaml", shipped("imu", "dtg"), damaged_text, nothing(load_imu)),
    "plan": Format("p.yaml", shipped("plan", "kim18_signed"), damaged_text, nothing(load_plan)),
    "model": Format("m.yaml", shipped("model", "baseline"), damaged_text, nothing(load_model)),
    "noise": Format("n.yaml", shipped("noise", "paper"), damaged_text, nothing(load_noise)),
    "table": Format("t.yaml", shipped("table", "ideal"), damaged_text, nothing(load_table)),
    "temperature": Format("t.yaml", shipped("temperature", "warm-up"), damaged_text, nothing(load_temperature)),
    "reference": Format("r.yaml", shipped("reference", "table33"), damaged_text, nothing(read_reference)),
    "effect": Format("e.yaml", made(EFFECT), damaged_text, nothing(load_effect)),
    "truth": Format("t.yaml", made(TRUTH), damaged_text, nothing(lambda p: read_truth(p, "prior", 9.80665))),
    "result.json": Format("result.json", make_result, damaged_json, use_result),
    "diagnosis.json": Format("diagnosis.json", make_diagnosis, damaged_json, nothing(read_diagnosis)),
    "journal": Format("j", make_journal, damaged_bytes, read_journal, lambda a, b: b == a[: len(b)]),
}
