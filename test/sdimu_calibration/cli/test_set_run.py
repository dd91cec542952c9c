"""What the page and the table of a set are called: a recording that was refused is not counted, and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.cli.set_run import page_title, table_heading
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
    return replace(RESULT, of_set=SimpleNamespace(recordings=(None,) * used, left_out=told))


@pytest.mark.parametrize(
    ("file", "refused", "title"),
    [
        (None, (), "Diagnosis of 2 recordings"),
        (None, ("c.mcap",), "Diagnosis of 2 of 3 recordings"),
        (Path("set.yaml"), (), "Diagnosis of set.yaml"),
        (Path("set.yaml"), ("c.mcap",), "Diagnosis of set.yaml (2 of 3 recordings)"),
    ],
)
def test_a_title_counts_what_was_used(file, refused, title):
    assert page_title(SimpleNamespace(file=file), "Diagnosis", of(2, *refused)) == title


def test_the_table_names_what_was_refused():
    assert table_heading(of(2, "c.mcap")).startswith("2 of 3 recordings together, without c.mcap,")
    assert table_heading(of(2)).startswith("2 recordings together, body frame")


@pytest.mark.parametrize(("names", "said"), [(("day1", "day2"), "day1, day2<"), ("abcdef", "a, b, c, d and others<")])
def test_the_page_says_beside_its_title_which_recordings_it_is_of(names, said):
    value = np.array([1e-4])
    parts = tuple(
        SetRecording(name, "", "", 0, np.nan, 60.0, 6000.0, 1.0, value, 0.1 * value, 0.0 * value) for name in names
    )
    told = replace(RESULT, of_set=replace(RESULT.of_set, recordings=parts))
    assert f'<span class="about grow">{said}' in page(told, Contents("x"))


def test_the_page_names_it_above_the_table():
    told = replace(RESULT, of_set=replace(RESULT.of_set, left_out=(("c.mcap", "no samples"),)))
    text = page(told, Contents("x"))
    assert text.index("Without c.mcap, which is left out: no samples.") < text.index("accel_bias_x")
