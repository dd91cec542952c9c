"""The tests that `make test` leaves to `.ci/run` are named, exist, and run there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from tiers import LONG, QUICK_ROS, THOROUGH, is_thorough, names

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def collected() -> list[str]:
    """Names of all tests in the files and folders of the table, as pytest prints them."""
    files = sorted({row.partition("::")[0] for row in (*THOROUGH, *LONG, *QUICK_ROS)})
    command = [sys.executable, "-m", "pytest", "--collect-only", "-p", "no:xdist", "-p", "no:warnings", *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return [line for line in done.stdout.splitlines() if "::" in line]


def test_every_row_of_the_table_names_a_test(collected):
    single = [f"{file}::{name}" for file, rows in LONG.items() for name in rows]
    table = (*THOROUGH, *LONG, *single, *QUICK_ROS)
    assert not [row for row in table if not any(names(row, test) for test in collected)]


def test_a_row_names_no_test_that_only_begins_like_it():
    assert names("test/browser", "test/browser/test_a.py::test_b")
    assert names("test_a", "test_a[x]")
    assert not names("test_a", "test_a_and_b")
    assert not names("test_a[8]", "test_a[80]")


def test_a_test_over_dds_is_thorough_unless_the_table_keeps_it():
    assert is_thorough("test/ros/test_stay.py::test_a", over_dds=True)
    assert not is_thorough("test/ros/test_gate.py::test_a", over_dds=False)
    assert not is_thorough(f"{QUICK_ROS[1]}[x]", over_dds=True)


def test_what_make_test_leaves_out_is_run_by_ci_and_decides_there():
    ci, make = ((ROOT / name).read_text() for name in (".ci/run", "Makefile"))
    assert '-m "not thorough and not slow and not bench"' in make
    assert '-m "thorough and not slow and not bench"' in make
    for target in ("test", "colcon", "docs", "thorough", "other-blas"):
        # Alone on its line: nothing takes its failure away.
        assert f"\nmake {target}\n" in ci
