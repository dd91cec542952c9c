"""The tests that `make test` leaves to `.ci/run` are named, exist, and run there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from mutants import CORE, MUTANTS
from sharing import APART, DOMAINS_A_RUN, LONGEST, TOGETHER, scope_of
from tiers import COLLECTED, LONG, QUICK_ROS, THOROUGH, VARIANTS, is_thorough, names

from sdimu_calibration.cli.processes import DOMAINS, STATED

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def collected(request: pytest.FixtureRequest) -> list[str]:
    """Names of all tests in the files and folders of the table, as pytest prints them: of this run, if it is whole."""
    if {Path(name).resolve() for name in request.config.args} & {ROOT, ROOT / "test"}:
        return request.config.stash[COLLECTED]
    files = sorted({row.partition("::")[0] for row in (*THOROUGH, *LONG, *VARIANTS, *QUICK_ROS)})
    command = [sys.executable, "-m", "pytest", "--collect-only", "-p", "no:xdist", "-p", "no:warnings", *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return [line for line in done.stdout.splitlines() if "::" in line]


def test_every_row_of_the_table_names_a_test(collected):
    single = [f"{file}::{name}" for rows in (LONG, VARIANTS) for file, own in rows.items() for name in own]
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
    assert '-m "thorough and ros and not slow and not bench"' in make
    assert '-m "thorough and not ros and not slow and not bench"' in make
    beside = "make -j 3 --output-sync=target thorough-nodes thorough-rest colcon docs other-blas"
    for line in ("make test", beside):
        # Alone on its line: nothing takes its failure away.
        assert f"\n{line}\n" in ci


def test_targets_that_run_side_by_side_share_no_ros_domain():
    ci, make = ((ROOT / name).read_text() for name in (".ci/run", "Makefile"))
    first = {
        name: int(number) for name, number in re.findall(r"^(\S+): export SDIMU_FIRST_DOMAIN = (\d+)$", make, re.M)
    }
    beside = {"thorough-nodes", "thorough-rest", "colcon", "other-blas"}
    assert beside | {"docs"} == set(ci.rpartition("--output-sync=target ")[2].split())
    assert set(first) == beside
    taken = [number + worker for number in first.values() for worker in range(DOMAINS_A_RUN)]
    taken.append(int(re.findall(r"ROS_DOMAIN_ID=(\d+)", make)[0]))
    assert len(set(taken)) == len(taken)
    assert not [number for number in taken if number in DOMAINS or number not in STATED]


def test_what_runs_with_one_kernel_of_linear_algebra_elsewhere_runs_with_another_in_other_blas():
    make = (ROOT / "Makefile").read_text()
    assert "\nthorough-nodes thorough-rest: export OPENBLAS_CORETYPE = Haswell\n" in make
    assert "\ntest: export OPENBLAS_CORETYPE = Haswell\n" in make
    assert "\nother-blas: export OPENBLAS_CORETYPE = Nehalem\n" in make
    assert '-m "not thorough and not slow and not bench"' in make.split("\nother-blas: setup\n")[1].partition("\n\n")[0]


def test_the_folders_that_thorough_nodes_is_given_hold_every_test_over_dds():
    marked = {path for path in ROOT.glob("test/**/test_*.py") if "pytest.mark.ros" in path.read_text(encoding="utf-8")}
    make = (ROOT / "Makefile").read_text()
    given = make.split('-m "thorough and ros and not slow and not bench"')[1].partition("\n")[0].split()
    places = [ROOT / folder for folder in given]
    assert len(marked) > 10
    assert not [path for path in marked - {Path(__file__)} if not any(path.is_relative_to(place) for place in places)]


def test_make_test_holds_style_types_and_tests():
    make = (ROOT / "Makefile").read_text()
    assert "\ntest: check-style\n\t$(MAKE) --no-print-directory -j 2 check-types test-run\n" in make
    assert '-m "not thorough and not slow and not bench"' in make.split("\ntest-run: setup\n")[1].partition("\n\n")[0]


def test_thorough_makes_both_of_its_parts():
    make = (ROOT / "Makefile").read_text().split("\nthorough: setup\n")[1].partition("\n\n")[0]
    assert make.endswith(" thorough-nodes thorough-rest")


def test_every_mutant_is_one_place_of_the_core():
    for mutant in MUTANTS:
        assert (CORE / mutant.file).read_text().count(mutant.right) == 1, mutant.file
        assert all((ROOT / name).exists() for name in mutant.tests), mutant.file


def test_every_file_that_is_shared_out_first_or_test_by_test_is_there():
    assert not [name for name in (*APART, *LONGEST, *TOGETHER, *TOGETHER.values()) if not (ROOT / name).is_file()]
    assert len(set(LONGEST)) == len(LONGEST)


def test_a_file_stays_on_one_worker_unless_its_tests_are_shared_out_one_by_one():
    assert scope_of("test/a/test_b.py::test_c[d::e]") == "test/a/test_b.py"
    assert scope_of(f"{APART[0]}::test_c[d]") == f"{APART[0]}::test_c[d]"
    assert scope_of("test/ros/test_layouts.py::test_c[d]") == scope_of("test/ros/test_whole_run.py::test_e")
    for name in APART:
        text = (ROOT / name).read_text()
        assert "scope=" not in text, name
        assert "cache" not in text, name
