"""What the page and the table of a set are called: a recording that was refused is not counted, and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.cli.next_commands import spelled
from sdimu_calibration.cli.options import FitRequest, StatedOpening
from sdimu_calibration.cli.set_run import SetRequest, page_title, table_heading, to_repeat
from sdimu_calibration.core.advice import Advice, Kind, Verb
from sdimu_calibration.core.results import Calibration, SetRecording, SetSummary, no_history
from sdimu_calibration.report.page import Contents, page

RESULT = Calibration(
    "prior",
    ("accel_bias",),
    ("accel_bias_x",),
    ("m/s^2",),
    ("ug",),
    np.array([1e-4]),
    np.array([[1e-12]]),
    {"nis_mean": 1.0},
    {},
    (),
    no_history(1),
    of_set=SetSummary((), (), (), np.array([1.0]), ()),
)


def of(used, *refused):
    """A result of some recordings; the refused ones by their names."""
    told = tuple((name, "no samples") for name in refused)
    return replace(RESULT, of_set=SetSummary((None,) * used, (), (), np.array([1.0]), (), told))


@pytest.mark.parametrize(
    ("file", "result", "title"),
    [
        (None, of(2), "Diagnosis of 2 recordings"),
        (None, of(2, "c.mcap"), "Diagnosis of 2 of 3 recordings"),
        (None, of(1), "Diagnosis of 1 recording"),
        (Path("set.yaml"), of(2), "Diagnosis of set.yaml"),
        (Path("set.yaml"), of(2, "c.mcap"), "Diagnosis of set.yaml (2 of 3 recordings)"),
    ],
)
def test_a_title_counts_what_was_used(file, result, title):
    assert page_title(SimpleNamespace(file=file), "Diagnosis", result) == title


def test_the_table_names_what_was_refused():
    assert table_heading(of(2, "c.mcap")).startswith("2 of 3 recordings together, without c.mcap,")
    assert table_heading(of(2)).startswith("2 recordings together, body frame")
    assert table_heading(of(1)).startswith("1 recording, body frame")


@pytest.mark.parametrize(
    ("bags", "file", "of_what"),
    [([Path("a"), Path("b")], None, "a b"), (None, Path("my set.yaml"), "--set 'my set.yaml'")],
)
def test_what_is_advised_repeats_all_that_was_asked(bags, file, of_what):
    opening = StatedOpening(site="daejeon", imu="dtg", gyro_unit="deg/s")
    request = FitRequest(set_file=file, model="mine.yaml", add=["accel_cubic_x"])
    advised = Advice(Kind.KEEP, ("accel_quadratic_z",), Verb.ADD, ("accel_quadratic_z",))
    command = spelled(advised, to_repeat(SetRequest(bags, opening, request), Path("out")))
    assert command == (
        f"sdimu calibrate {of_what} --site daejeon --imu dtg --model mine.yaml --gyro-unit deg/s "
        "--add accel_cubic_x --add 'accel_quadratic_z'"
    )


@pytest.mark.parametrize(("names", "said"), [(("day1", "day2"), "day1, day2<"), ("abcdef", "a, b, c, d and others<")])
def test_the_page_says_beside_its_title_which_recordings_it_is_of(names, said):
    assert f'<span class="about grow">{said}' in page(recorded(names), Contents("x"))


def test_the_page_of_one_recording_does_not_compare_it_with_itself():
    heading = "Every coefficient in every recording"
    assert heading in page(recorded(("day1", "day2")), Contents("x"))
    assert heading not in page(recorded(("day1",)), Contents("x"))


def recorded(names):
    """The result of a set of recordings of these names."""
    value = np.array([1e-4])
    parts = tuple(
        SetRecording(name, "", "", 0, np.nan, 60.0, 6000.0, 1.0, value, 0.1 * value, 0.0 * value) for name in names
    )
    return replace(RESULT, of_set=replace(RESULT.of_set, recordings=parts))


def test_the_page_names_it_above_the_table():
    told = replace(RESULT, of_set=replace(RESULT.of_set, left_out=(("c.mcap", "no samples"),)))
    text = page(told, Contents("x"))
    assert text.index("Without c.mcap, which is left out: no samples.") < text.index("accel_bias_x")
