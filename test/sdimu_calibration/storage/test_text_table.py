"""Tables in text as loggers and spreadsheets write them are read; what is no text is named with what to do."""

from __future__ import annotations

import gzip
import sqlite3
import time

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.importing.map_proposal import propose_maps
from sdimu_calibration.storage.importing.text_table import TextTable

ROWS = np.random.default_rng(5).normal(0.0, 9.0, (300, 4)).round(4)
HEADINGS = ["t", "a", "b", "c"]


def text(delimiter=",", cell="{:.4f}", decimal=".", headings=HEADINGS, rows=ROWS):
    lines = [delimiter.join(cell.format(value).replace(".", decimal) for value in row) for row in rows]
    return "\n".join([delimiter.join(headings), *lines]) + "\n"


def told(path) -> str:
    with pytest.raises(DataError) as error:
        TextTable(path)
    return str(error.value)


@pytest.mark.parametrize(
    "content",
    [
        text(),
        text(cell='"{:.4f}"', headings=[f'"{heading}"' for heading in HEADINGS]),
        text(" ", '"{:.4f}"'),
        text(";", decimal=","),
        text("\t", decimal=","),
        text("  ", decimal=","),
        text(";", '"{:.4f}"', ","),
        text(",", '"{:.4f}"', ","),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_quotes_decimal_commas_and_encodings_are_read(tmp_path, content, encoding):
    path = tmp_path / "a.csv"
    path.write_bytes(content.encode(encoding))
    table = TextTable(path)
    assert table.headings == HEADINGS
    np.testing.assert_array_equal(table.floats(HEADINGS), ROWS)
    np.testing.assert_array_equal(table.numbers(), ROWS)


def test_a_delimiter_in_quotes_is_a_part_of_its_cell(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text('"Time, s","say ""x""",word\n' + '"1.5",2.5,"left, up"\n' * 50)
    table = TextTable(path)
    assert table.headings == ["Time, s", 'say "x', "word"]
    assert table.floats(["Time, s", 2]).tolist() == [[1.5, 2.5]] * 50


def test_a_quote_that_is_never_closed_does_not_swallow_lines(tmp_path):
    lines = text(headings=[*HEADINGS, "word"], rows=np.column_stack([ROWS, ROWS[:, 0]])).splitlines()
    lines[100] = '1.0,2.0,3.0,4.0,"rest'
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    assert len(TextTable(path).floats(HEADINGS)) == len(ROWS)


def test_letters_beyond_a_to_z_of_another_encoding_are_read_and_told(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(text(headings=["Zeit (µs)", "a", "b", "c"]).encode("latin-1"))
    table = TextTable(path)
    assert table.headings[0] == "Zeit (µs)"
    assert any("Latin-1" in note for note in table.notes)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"#ROSBAG V2.0\n" + b"E\x00\x00\x00" * 50, "is a bag of ROS 1 (.bag): it needs no import"),
        (b"\x89MCAP0\r\n" + bytes(50), "is a bag of ROS 2 (.mcap): it needs no import"),
        (b"PK\x03\x04" + bytes(50), "save the sheet as CSV"),
        (gzip.compress(text().encode()), "is packed (gzip): unpack it"),
        (b"MATLAB 5.0 MAT-file".ljust(200), "let its name end in .mat"),
        (np.random.default_rng(1).normal(size=500).tobytes(), "is not text"),
        (b"\xff\xfe\x00\x01\x9f", "is not text"),
    ],
)
def test_a_file_that_is_no_table_is_named_with_what_to_do(tmp_path, content, words):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    assert words in told(path)


def test_a_data_base_is_named(tmp_path):
    path = tmp_path / "a.db3"
    base = sqlite3.connect(path)
    base.execute("create table topics(id integer)")
    base.close()
    assert "it needs no import: sdimu calibrate" in told(path)


def test_a_line_of_thousands_of_columns_is_refused_at_once(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("1," * 100_000)
    begin = time.monotonic()
    with pytest.raises(DataError, match="line 1 has 100001 columns, and 1000 are the most"):
        propose_maps([path])
    assert time.monotonic() - begin < 1.0


@pytest.mark.parametrize("headings", [["0", "1", "2", "3"], ["t", "1", "2", "3"], ["", "0", "1", "2"]])
def test_a_heading_that_is_a_number_names_no_column(tmp_path, headings):
    path = tmp_path / "a.csv"
    path.write_text(text(headings=headings))
    table = TextTable(path)
    assert [table.name_of(k) for k in range(4)] == ["t" if headings[0] == "t" else 1, 2, 3, 4]
    assert any("lines up to 1 are headings in numbers" in note for note in table.notes)
    np.testing.assert_array_equal(table.floats([1, 2, 3, 4]), ROWS)


def test_an_index_beside_headings_in_numbers_hides_them_from_nobody(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{k}," + ",".join(f"{value:.4f}" for value in row) for k, row in enumerate(ROWS)]
    path.write_text("\n".join([",0,1,2,3", *rows]))
    np.testing.assert_array_equal(TextTable(path).floats([2, 3, 4, 5]), ROWS)


@pytest.mark.parametrize(("left_out", "at"), [("#{}", 150), ("1,2,{}", 1)])
def test_many_lines_that_are_left_out_are_told(tmp_path, left_out, at):
    lines = text().splitlines()
    for share, said in ((0.02, False), (0.3, True)):
        extra = [left_out.format(k) for k in range(int(share * len(ROWS)))]
        path = tmp_path / "a.csv"
        path.write_text("\n".join([*lines[:at], *extra, *lines[at:]]))
        table = TextTable(path)
        assert len(table.numbers()) == len(ROWS)
        assert any(f"{len(extra)} of {len(ROWS) + len(extra)} lines are left out" in n for n in table.notes) == said


@pytest.mark.parametrize("cell", ["1_0", "0x10", "٣", ""])
def test_a_cell_that_numpy_does_not_read_is_told_with_its_line(tmp_path, cell):
    path = tmp_path / "a.csv"
    lines = text().splitlines()
    lines[3] = f"1.0,{cell},2.0,3.0"
    path.write_text("\n".join(lines), "utf-8")
    with pytest.raises(DataError, match=f"line 4, column a: '{cell}' is not a number"):
        TextTable(path).floats(HEADINGS)
