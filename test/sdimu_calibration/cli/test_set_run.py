"""What the page and the table of a set are called: a recording that was refused is not counted, and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.cli.set_run import page_title, table_heading
from sdimu_calibration.core.results import Calibration, SetSummary, no_history
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


def test_the_page_names_it_above_the_table():
    told = replace(RESULT, of_set=replace(RESULT.of_set, left_out=(("c.mcap", "no samples"),)))
    text = page(told, Contents("x"))
    assert text.index("Without c.mcap, which is left out: no samples.") < text.index("accel_bias_x")
