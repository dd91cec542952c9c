"""`sdimu datasheet`: a data sheet and the certificate of one unit."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import typer

from sdimu_calibration.cli.datasheet import datasheet
from sdimu_calibration.core.fleet.datasheet import known_terms
from sdimu_calibration.core.noise import Terms
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si, to_si
from sdimu_calibration.report.fleet.tables import three
from sdimu_calibration.storage.files.limits_file import read_limits
from sdimu_calibration.storage.files.noise_terms_file import read_noise_terms, write_noise_terms
from sdimu_calibration.storage.files.result_file import read_result, write_result


def written(folder):
    return {line["term"]: line for line in json.loads((folder / "datasheet.json").read_text())["lines"]}


def test_limits_are_judged_in_the_file_on_the_page_and_in_the_terminal(batch, tmp_path, capsys):
    folder = batch(units=3, each=3)
    limits = tmp_path / "limits.yaml"
    limits.write_text(
        "format: sdimu-limits/1\nlimits:\n  gyro bias: 100 deg/h\n  gyro scale-factor error: 1 ppm\n"
        "  gyro scale-factor asymmetry: 10 ppm\n"
    )
    with pytest.raises(typer.Exit) as ending:
        datasheet([folder], limits=limits)
    assert ending.value.exit_code == 3
    lines = written(folder)
    assert lines["gyro bias"]["verdict"] == "pass"
    assert lines["gyro bias"]["limit"] == pytest.approx(to_si(100, "deg/h"))
    assert lines["gyro scale-factor error"]["verdict"] == "fail"
    assert lines["gyro scale-factor asymmetry"]["verdict"] == "not measured"
    assert lines["gyro bias repeatability"]["recordings"] == 9
    page = (folder / "datasheet.html").read_text()
    # The first lines of the page say it of every limit, the worst first.
    head = page[page.index('class="verdict') : page.index("What was measured")]
    assert "Fail: gyro scale-factor error. Not measured: gyro scale-factor asymmetry. Pass: 1 of 3 limits." in head
    verdicts = re.findall(r'<li><b class="\w+">([\w ]+)</b> ([\w -]+): ([^<]+)</li>', head)
    assert [(verdict, term) for verdict, term, _ in verdicts] == [
        ("fail", "gyro scale-factor error"),
        ("not measured", "gyro scale-factor asymmetry"),
        ("pass", "gyro bias"),
    ]
    assert [size.endswith(("ppm (limit 1)", "limit 10 ppm", "deg/h (limit 100)")) for *_, size in verdicts] == [
        True
    ] * 3
    assert "size: A4" in page
    # Headings of numbers stand flush right, as these do.
    heads = re.findall(r"<th( class=\"text\")?>([^<]+)</th>", page[page.index("What was measured") :])
    numbers = [word for text, word in heads[:9] if not text]
    assert numbers == ["value", "95 % interval", "rms", "n", "limit"]
    told = capsys.readouterr()
    assert "pass" in told.out
    assert "fail" in told.out
    # A production line sees it by the status, and reads which limits.
    first, second = told.err.splitlines()
    assert re.fullmatch(r"sdimu: limit: fail: gyro scale-factor error: [\d.]+ ppm \(limit 1\)", first)
    assert second == "sdimu: limit: not measured: gyro scale-factor asymmetry: limit 10 ppm"


def test_a_sheet_that_is_held_against_nothing_has_no_column_for_it(batch, tmp_path):
    folder = batch(units=1, each=1)
    datasheet([folder])
    page = (folder / "datasheet.html").read_text()
    assert "<th>value</th>" in page
    assert not re.search(r"<th[^>]*>(limit|verdict)</th>|Pass: the whole", page)
    limits = tmp_path / "limits.yaml"
    limits.write_text("format: sdimu-limits/1\nlimits:\n  gyro bias: 100 deg/h\n")
    datasheet([folder], limits=limits)
    assert re.search(r"Pass: the whole.*<th[^>]*>limit</th>", (folder / "datasheet.html").read_text(), re.DOTALL)


def test_the_title_names_the_serial_number_and_calls_no_folder_one(batch):
    folder = batch(units=6)
    datasheet([folder])
    assert "<h1>Data sheet: dtg, 6 units: SN0, SN1, SN2, SN3 and others</h1>" in (folder / "datasheet.html").read_text()
    datasheet([folder], serial="SN1")
    assert "<h1>Data sheet: dtg, serial SN1</h1>" in (folder / "datasheet.html").read_text()
    alone = folder / "unit2_0"
    write_result(alone / "result.json", replace(read_result(alone), origin=Origin(imu="dtg")))
    datasheet([alone], certificate=True)
    page = (alone / "datasheet.html").read_text()
    assert "<h1>Calibration certificate: dtg, unit unit2_0 (no serial stated)</h1>" in page
    assert json.loads((alone / "datasheet.json").read_text())["serial"] == ""
    # Its coefficients have the sign of print, as in the report.
    assert re.search(r"<td>\N{MINUS SIGN}[\d.]+</td>", page)
    assert not re.search(r">-\.?\d", page)


def test_the_certificate_is_of_one_unit_with_the_hashes_of_its_recordings(batch, tmp_path, capsys):
    folder = batch(units=3, each=2)
    (folder / "bag_1_0").mkdir()
    (folder / "bag_1_0" / "bag.mcap").write_bytes(b"samples")
    elsewhere = tmp_path / "elsewhere" / "bag_1_1"
    elsewhere.mkdir(parents=True)
    (elsewhere / "bag.mcap").write_bytes(b"more samples")
    datasheet([folder], certificate=True, serial="SN1", operator="A. Person", plan="kim18", out=tmp_path / "out")
    assert "bag_1_1 was not found" in capsys.readouterr().out
    datasheet(
        [folder],
        certificate=True,
        serial="SN1",
        operator="A. Person",
        plan="kim18",
        recording=[elsewhere],
        out=tmp_path / "out",
    )
    content = json.loads((tmp_path / "out" / "datasheet.json").read_text())
    assert (content["serial"], content["operator"], content["plan"]) == ("SN1", "A. Person", "kim18")
    assert {one["file"]: one["sha256"] for one in content["recordings"]} == {
        "bag_1_0/bag.mcap": hashlib.sha256(b"samples").hexdigest(),
        "bag_1_1/bag.mcap": hashlib.sha256(b"more samples").hexdigest(),
    }
    assert {one["unit"] for one in content["results"]} == {"SN1"}
    page = (tmp_path / "out" / "datasheet.html").read_text()
    assert hashlib.sha256(b"samples").hexdigest() in page
    assert "A. Person" in page
    assert "gyro_bias_x" in page


def test_noise_of_a_recording_at_rest_comes_back_and_into_the_sheet(batch):
    folder = batch(units=1)
    terms = {
        f"{triad}_{axis}": Terms(np.array([0.0, 2e-7, 3e-8, 0.0]), np.array([1e-9, 2e-9, 1e-9, 1e-10]))
        for triad in ("gyro", "accel")
        for axis in "xyz"
    }
    write_noise_terms(folder / "still_noise" / "noise.json", "still", 3600.0, terms)
    again = read_noise_terms(folder / "still_noise")
    assert all(np.array_equal(again.terms[c].value, terms[c].value) for c in terms)
    datasheet([folder])
    line = written(folder)["gyro angle random walk"]
    assert line["low"] < line["value"] == 2e-7 < line["high"]


def noise_of(path, source, serial="", seen=True):
    """A noise.json of a recording of a unit; of all terms the white noise alone, or nothing at all, is seen."""
    value = np.array([0.0, 2e-7 if seen else 0.0, 0.0, 0.0])
    one = Terms(value, np.array([1e-9, 2e-9, 1e-8, 1e-10]))
    terms = {f"{triad}_{axis}": one for triad in ("gyro", "accel") for axis in "xyz"}
    write_noise_terms(path / "noise.json", source, 60.0, terms, Origin(serial, imu="dtg", recording=source))
    return path


def test_noise_of_another_unit_is_refused_and_that_of_another_recording_told(batch, tmp_path, capsys):
    """Its angle random walk was held against the limits of this unit without a word."""
    folder = batch(units=2)
    other = noise_of(tmp_path / "other", "still", "SN7")
    with pytest.raises(DataError, match=r"noise of the unit with serial number SN7, and the results are of SN0, SN1"):
        datasheet([folder], noise=[other])
    capsys.readouterr()
    datasheet([folder], noise=[noise_of(tmp_path / "own", "still", "SN1")])
    assert "note: noise is of another recording than the results: still (serial SN1)" in capsys.readouterr().out
    datasheet([folder], noise=[noise_of(tmp_path / "nobody", "still")])
    assert "recording than the results: still (unit not stated)" in capsys.readouterr().out
    recording = read_result(folder / "unit1_0").origin.recording
    datasheet([folder], noise=[noise_of(tmp_path / "same", recording, "SN1")])
    assert "another recording" not in capsys.readouterr().out


def test_noise_of_another_unit_below_the_folder_is_set_apart(batch, capsys):
    folder = batch(units=2)
    noise_of(folder / "unit0_0", "still", "SN0")
    datasheet([folder], serial="SN1")
    assert "set apart: " in (told := capsys.readouterr().out)
    assert "noise of the unit with serial number SN0, and the results are of SN1" in told
    assert written(folder)["gyro angle random walk"]["value"] is None


def test_what_was_not_seen_is_given_as_a_bound(batch, tmp_path, capsys, monkeypatch):
    """As `sdimu noise` gives it: 0, 0 to 0.03 read as a sensor without any."""
    monkeypatch.setenv("COLUMNS", "140")
    folder = batch(units=1)
    limits = tmp_path / "limits.yaml"
    limits.write_text("limits:\n  gyro bias in-run stability: 1 deg/h\n")
    datasheet([folder], noise=[noise_of(tmp_path / "still", "still")], limits=limits)
    high = f"< {three(from_si(written(folder)['gyro bias in-run stability']['high'], 'deg/h'))}"
    (line,) = [one for one in capsys.readouterr().out.splitlines() if "gyro bias in-run stability" in one]
    assert re.search(rf"in-run stability +{high} +deg/h ", line)
    page = (folder / "datasheet.html").read_text()
    assert f"gyro bias in-run stability: &lt; {high[2:]} deg/h (limit 1)" in page
    assert f'<td class="number">&lt; {high[2:]}</td><td class="number"></td>' in page


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("limits:\n  gyro bais: 1 deg/h\n", "did you mean 'gyro bias'"),
        ("limits:\n  gyro bias: 1 ug\n", "wrong unit"),
        ("limits:\n  gyro bias: 1\n", "no unit"),
        ("limits:\n  gyro bias: -1 deg/h\n", "not above zero"),
        ("limits: {}\n", "names no term"),
        ("limit:\n  gyro bias: 1 deg/h\n", "limit"),
    ],
)
def test_limits_that_cannot_be_read_are_one_clear_error(text, words, tmp_path):
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    with pytest.raises(DataError, match=words):
        read_limits(path, known_terms())


def test_a_limit_may_be_in_any_unit_of_its_kind(tmp_path):
    path = tmp_path / "limits.yaml"
    path.write_text("limits:\n  gyro angle random walk: 60 deg/h/sqrt(Hz)\n")
    assert read_limits(path, known_terms())["gyro angle random walk"] == pytest.approx(to_si(1.0, "deg/sqrt(h)"))


def test_a_certificate_without_a_unit_is_refused_with_the_units_there_are(batch):
    folder = batch(units=3)
    with pytest.raises(DataError, match=r"SN0, SN1, SN2"):
        datasheet([folder], certificate=True)
    with pytest.raises(DataError, match="no result has this serial number"):
        datasheet([folder], serial="X")
