"""Rests and spans as a user writes them: on the command line, or begin and end on each line of a file."""

from __future__ import annotations

import pytest

from sdimu_calibration.cli.options import read_rests, read_spans
from sdimu_calibration.core.recording import DataError

SPANS = ((1.5, 4.0), (6.0, 9.25))


def test_rests_are_read_from_spans_and_from_files_with_and_without_headings(tmp_path):
    assert read_rests("6-9.25, 1.5-4") == SPANS
    for number, text in enumerate(
        ("1.5,4\n6,9.25\n", "begin;end\n1.5;4\n6;9.25\n", "# two rests\n6 9.25 # late\n1.5 4")
    ):
        path = tmp_path / f"rests{number}.csv"
        path.write_text(text)
        assert read_rests(str(path)) == SPANS


def test_what_is_no_rest_is_told_with_its_line(tmp_path):
    path = tmp_path / "rests.csv"
    path.write_text("1,2\n3,x\n")
    with pytest.raises(DataError, match=r"rests.csv: line 2: '3,x': expected begin and end"):
        read_rests(str(path))
    path.write_text("1,2\n5,4\n")
    with pytest.raises(DataError, match="the span 5-4 ends before it begins"):
        read_rests(str(path))
    path.write_text("\n")
    with pytest.raises(DataError, match="no rest in it"):
        read_rests(str(path))
    with pytest.raises(DataError, match="--rests nowhere"):
        read_rests("nowhere.csv")
    with pytest.raises(DataError, match="--exclude-times 3-1"):
        read_spans("3-1")
