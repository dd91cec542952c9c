"""The tests that `make test` leaves to `.ci/run` are named, exist, and run there."""

from __future__ import annotations

from pathlib import Path

from tiers import LONG, QUICK_ROS, THOROUGH, is_thorough

ROOT = Path(__file__).resolve().parents[1]


def test_every_row_of_the_table_names_a_test_that_is_there():
    single = [f"{file}::{name.partition('[')[0]}" for file, names in LONG.items() for name in names]
    for row in (*THOROUGH, *LONG, *single, *QUICK_ROS):
        file, _, name = row.partition("::")
        assert (ROOT / file).exists(), row
        assert f"def {name}" in (ROOT / file).read_text() if name else True, row


def test_a_test_over_dds_is_thorough_unless_the_table_keeps_it():
    assert is_thorough("test/ros/test_stay.py::test_a", over_dds=True)
    assert not is_thorough("test/ros/test_gate.py::test_a", over_dds=False)
    assert not is_thorough(f"{QUICK_ROS[1]}[x]", over_dds=True)


def test_what_make_test_leaves_out_is_run_by_ci():
    ci, make = ((ROOT / name).read_text() for name in (".ci/run", "Makefile"))
    assert '-m "not thorough and not slow and not bench"' in make
    assert '-m "thorough and not slow and not bench"' in make
    assert "\nmake test\n" in ci
    assert "\nmake thorough" in ci
