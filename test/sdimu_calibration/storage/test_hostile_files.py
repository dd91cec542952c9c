"""Files that are damaged, or made to harm: one line that says so, little memory, and no name that is obeyed."""

from __future__ import annotations

import json
import struct
import tracemalloc
import zlib

import numpy as np
import pytest
import yaml
from scipy.io import savemat

from sdimu_calibration.cli.console import plain
from sdimu_calibration.core.plain_text import LONGEST_LINE, one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.core.units import UnitError, parse_quantity, parse_unit
from sdimu_calibration.storage.bags import unpacking
from sdimu_calibration.storage.export import FORMS, export
from sdimu_calibration.storage.files.config import load_imu, load_site, read_mapping
from sdimu_calibration.storage.files.effect_schema import read_effect_file
from sdimu_calibration.storage.files.journal import Journal
from sdimu_calibration.storage.files.reference_file import read_truth
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_calibration.storage.importing.array_table import read_mat, read_npz
from sdimu_calibration.storage.recording_set import BagSource, load_set
from sdimu_sim.core.expression import parse_expression as parse_simulated

ESCAPE = "\x1b]0;owned\x07\r\n\x9b2J\u202e"


def refusal(read, *arguments):
    with pytest.raises((DataError, UnitError)) as caught:
        read(*arguments)
    text = str(caught.value)
    assert text.isprintable()
    assert len(text) <= LONGEST_LINE
    return text


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def bomb(depth):
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, depth)]
    return "\n".join([*lines, f"latitude_deg: *a{depth - 1}"])


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("latitude_deg: !!int x", "YAML"),
        ("latitude_deg: 2024-99-99", "YAML"),
        ("latitude_deg: !!float x", "YAML"),
        ("latitude_deg: !!binary x", "YAML"),
        ("? [1, 2]\n: 3", "YAML"),
        (bomb(9), "aliases"),
        ("latitude_deg: " + "[" * 10_000, "YAML"),
        ("latitude_deg: " + "[" * 30 + "]" * 30, "latitude_deg"),
        ("latitude_deg: [" + "1, " * 2_000 + "1]", "latitude_deg"),
        ("latitude_deg: " + "9" * 400, "latitude_deg"),
        ("latitude_deg: " + "9" * 5000, "YAML"),
        ("latitude_deg: '" + "9" * 20_000 + "'", "latitude_deg"),
        ("a" * 900 + ": 1", "unknown key"),
        ("x: " + "y" * (2 << 20), "longer than"),
        ('"a\\e[31m\\n\\u202e": 1', "unknown key"),
    ],
    ids=lambda text: text[:24],
)
def test_a_configuration_that_is_none_is_one_line(tmp_path, text, word):
    tracemalloc.start()
    try:
        assert word in refusal(load_site, written(tmp_path / "site.yaml", text))
        assert tracemalloc.get_traced_memory()[1] < 64 << 20
    finally:
        tracemalloc.stop()


def test_keys_written_twice_are_found_among_many(tmp_path):
    lines = [f"k{i}: 1" for i in range(3_000)]
    assert len(read_mapping(written(tmp_path / "x.yaml", "\n".join(lines)))) == 3_000
    assert "'k7' is there twice" in refusal(read_mapping, written(tmp_path / "y.yaml", "\n".join([*lines, "k7: 2"])))


@pytest.mark.parametrize("mean", ["0x10 deg", "[1, 2]", "7"])
def test_a_mean_bias_that_is_no_list_of_numbers_is_one_line(tmp_path, mean):
    truth = f"format: sdimu-truth/1\ncoefficients: {{gyro_bias_x: 0.0}}\nmean_bias: {mean}"
    assert "mean_bias" in refusal(read_truth, written(tmp_path / "t.yaml", truth), "prior")


@pytest.mark.parametrize("coefficients", ["{gyro_bias_x: .nan}", "{gyro_bias_x: .inf}", "{}", "{hello: 1.0}", "{5: 5}"])
def test_a_truth_that_tells_nothing_is_one_line(tmp_path, coefficients):
    path = written(tmp_path / "t.yaml", f"format: sdimu-truth/1\ncoefficients: {coefficients}")
    told = refusal(read_truth, path, "prior")
    assert "gyro_bias_x" in told
    assert "is no size" in told or "names no coefficient that is known" in told


def test_a_nul_in_the_path_of_a_bag_is_one_line(tmp_path):
    path = written(tmp_path / "set.yaml", 'format: sdimu-set/1\nrecordings: [{bag: "a\\0b"}]')
    assert "recordings.0.bag: a path has no NUL" in refusal(load_set, path, BagSource(tmp_path))


EFFECT = {
    "format": "sdimu-effect/1",
    "name": "mine",
    "expressions": {"accel_x": "k * ax"},
    "parameters": {"k": {"unit": "m/s^2/g", "prior": "10 ug/g"}},
}


@pytest.mark.parametrize(
    "formula",
    [
        "k * ax * ((2**9)**9)**9",
        "k * fx**(1/0)",
        "k * fx**(0/0)",
        "k * fx**1e9",
        "k * " + "9" * 400,
        "k * ax * 1e301",
        "k * fx**" + "9" * 400,
    ],
    ids=lambda text: text[:16],
)
def test_a_formula_without_a_finite_value_is_one_line(tmp_path, formula):
    text = yaml.safe_dump(EFFECT | {"expressions": {"accel_x": formula}})
    assert "accel_x" in refusal(read_effect_file, written(tmp_path / "e.yaml", text))


@pytest.mark.parametrize("formula", ["k" + "*t" * 800, "k*t" + "+k*t" * 450])
def test_a_formula_that_would_fill_the_stack_is_one_line(tmp_path, formula):
    """Both are shorter than the longest formula, and each operation stands in the next one."""
    assert len(formula) < 2000
    text = yaml.safe_dump(EFFECT | {"expressions": {"accel_x": formula}})
    assert "joins more than 100 terms" in refusal(read_effect_file, written(tmp_path / "e.yaml", text))
    assert "joins more than" in refusal(parse_simulated, formula, ("k", "t"))


def test_units_and_numbers_beyond_all_measure_are_one_line(tmp_path):
    assert "power" in refusal(parse_unit, "deg^" + "9" * 9)
    assert "power" in refusal(parse_unit, "deg^" + "9" * 6000)
    for size in ("9" * 400, "1e300", "-1e21", "1e27 ppm"):
        assert "larger than any quantity (at most 1e+20 in SI" in refusal(parse_quantity, size, "1")
    assert parse_quantity("1e26 ppm", "1") == pytest.approx(1e20)
    truth = "format: sdimu-truth/1\ncoefficients: {gyro_bias_x: " + "9" * 400 + "}"
    assert "gyro_bias_x" in refusal(read_truth, written(tmp_path / "t.yaml", truth), "prior")


def result(**changes):
    made = {
        "body_frame": "prior",
        "model": ("gyro_bias",),
        "names": ("gyro_bias_x", "gyro_bias_y", "gyro_bias_z"),
        "units": ("rad/s",) * 3,
        "display_units": ("deg/h",) * 3,
    } | changes
    return Calibration(
        **made, values=np.zeros(3), covariance=np.eye(3), fit={}, data={}, notes=(), history=no_history(3)
    )


@pytest.mark.parametrize(
    "edit",
    [
        {"coefficients": 3},
        {"coefficients": [3]},
        {"covariance": [[int("9" * 400)] * 3] * 3},
        {"data": None},
        {"history": {"t": 5}},
        {"drift_means": [1]},
        {"noise": [7]},
        {"model": [ESCAPE]},
        {"body_frame": ESCAPE},
        {"notes": 5},
        {"model": 5},
        {"history": [1]},
        {"data": {"faults": [{"kind": "x", "nothing": 1}]}},
    ],
    ids=lambda edit: next(iter(edit)),
)
def test_a_result_that_is_none_is_one_line(tmp_path, edit):
    write_result(tmp_path / "result.json", result())
    content = json.loads((tmp_path / "result.json").read_text())
    written(tmp_path / "result.json", json.dumps(content | edit))
    assert "result.json" in refusal(read_result, tmp_path)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"format": ' + "9" * 6000 + "}", "{,"], ids=lambda text: text[:9])
def test_json_that_is_none_is_one_line(tmp_path, text):
    assert "not a JSON file" in refusal(read_result, written(tmp_path / "result.json", text))


@pytest.mark.parametrize("place", ["names", "units", "display_units"])
def test_names_that_a_terminal_would_obey_are_refused(tmp_path, place):
    write_result(tmp_path / "result.json", result(**{place: ("a", "b", ESCAPE)}))
    assert "no name or unit" in refusal(read_result, tmp_path)


def test_notes_of_a_result_are_shown_as_text(tmp_path):
    write_result(tmp_path / "result.json", result())
    content = json.loads((tmp_path / "result.json").read_text())
    written(tmp_path / "result.json", json.dumps(content | {"notes": [f"a{ESCAPE}b"], "warnings": [ESCAPE]}))
    read = read_result(tmp_path)
    assert all(text.isprintable() for text in (*read.notes, *read.warnings))
    assert read.notes[0].startswith("a\\x1b")


def test_no_name_ends_the_comment_of_a_c_header_or_breaks_a_table(tmp_path):
    name = "k */ int x; /* \"', #"
    made = result(body_frame="prior */ #error", names=("gyro_bias_x", "gyro_bias_y", name))
    linear = Calibration(**vars(result()))
    texts = {}
    for form in FORMS:
        from sdimu_calibration.core.compensation import linear_model
        from sdimu_calibration.storage.export.shared import Source

        model = linear_model(linear)
        model = type(model)(**(vars(model) | {"body_frame": made.body_frame, "left": (name,)}))
        source = Source(made, model, load_imu("dtg"), 100.0, tuple(FORMS[form].cannot_hold(model)))
        texts[form] = "".join(FORMS[form].write(source).values())
    header = texts["c-header"]
    # The first comment ends where the constants begin.
    assert header.index("*/") > header.index("sdimu_compensate for every sample")
    assert yaml.safe_load(texts["yaml"])["coefficients"][name]["unit"] == "rad/s"
    assert yaml.safe_load(texts["yaml"])["body_frame"] == made.body_frame
    assert len(texts["csv"].splitlines()) == 4
    assert export("csv", tmp_path / "c.csv", linear, load_imu("dtg")).files


def test_what_is_printed_is_never_obeyed(capsys):
    console = plain(width=60)
    console.print(f"[/nothing] {ESCAPE} :smile:", soft_wrap=True)
    said = capsys.readouterr().out
    assert "[/nothing]" in said
    assert ":smile:" in said
    assert all(line.isprintable() for line in said.splitlines())
    assert "\x1b" not in said
    forced = plain(width=60, force_terminal=True, color_system="standard")
    forced.print("12 \x1b[2J", style="bold")
    assert "\x1b[2J" not in (out := capsys.readouterr().out)
    assert "\x1b[1m" in out or "\x1b[1" in out


def test_an_error_is_one_line_that_keeps_what_to_do():
    text = str(DataError("a.yaml: " + "x\n" * 10_000 + "run: sdimu bag recover a"))
    assert len(text) == LONGEST_LINE
    assert text.startswith("a.yaml: x x")
    assert text.endswith("run: sdimu bag recover a")
    assert one_line("caf\u00e9 \udc80") == "caf\u00e9 \\udc80"


def zip_bomb(path):
    import zipfile

    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed, packed.open("t.npy", "w", force_zip64=True) as f:
        np.lib.format.write_array_header_1_0(f, {"descr": "<f8", "fortran_order": False, "shape": (32 << 20,)})
        for _ in range(32):
            f.write(bytes(8 << 20))
    return path


def test_an_npz_unpacks_to_what_it_may(tmp_path):
    path = zip_bomb(tmp_path / "a.npz")
    assert path.stat().st_size < 1 << 20
    tracemalloc.start()
    try:
        assert "unpacks to" in refusal(read_npz, path)
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


def mat_bomb(path):
    """Write a MAT file of version 5 with one compressed matrix of zeros."""
    count = 16 << 20
    head = struct.pack("<IIIIIIiiII", 6, 8, 6, 0, 5, 8, 1, count // 8, 1, 1) + b"t\0\0\0\0\0\0\0"
    head += struct.pack("<II", 9, count)
    packer = zlib.compressobj()
    body = packer.compress(struct.pack("<II", 14, len(head) + count) + head)
    body += b"".join(packer.compress(bytes(1 << 20)) for _ in range(count >> 20)) + packer.flush()
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(body)) + body)
    return path


def test_a_mat_file_gets_the_memory_that_it_may(tmp_path, monkeypatch):
    path = mat_bomb(tmp_path / "a.mat")
    assert len(read_mat(path)._array("t")) == 2 << 20
    monkeypatch.setattr(unpacking, "BASE_BYTES", 4 << 20)
    assert "not a MAT file that can be read" in refusal(read_mat, path)


def test_the_names_of_a_mat_file_may_be_any(tmp_path):
    savemat(tmp_path / "a.mat", {"file": np.arange(3.0), "s": {"deep": {"x": np.arange(4)}}, "word": "text"})
    table = read_mat(tmp_path / "a.mat")
    assert table.numbers("file").tolist() == [0.0, 1.0, 2.0]
    assert table.numbers("s.deep.x").tolist() == [0, 1, 2, 3]
    assert "not a list or matrix of numbers" in refusal(table.numbers, "word")


def test_a_damaged_record_ends_a_journal_and_a_changed_one_is_not_believed(tmp_path):
    path = tmp_path / "j"
    journal = Journal(path, "x")
    for k in range(5):
        journal.status(k, True, k)
    journal.close()
    content = path.read_bytes()
    begin = len(content) - 5 * 33
    for place in range(begin, len(content)):
        changed = bytearray(content)
        changed[place] ^= 0x04
        path.write_bytes(changed)
        again = Journal(path, "x")
        records = list(again.records())
        again.close()
        assert [record.ns for record in records] == list(range((place - begin) // 33))
        assert again.cut_bytes == len(content) - begin - 33 * len(records)
