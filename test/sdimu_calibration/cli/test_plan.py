"""`sdimu plan --after`: what results know counts."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.cli.plan import plan
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.known import Standing, known_of
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.files.config import find_config, load_imu, load_plan, load_site
from sdimu_calibration.storage.files.json_file import write_json
from sdimu_calibration.storage.files.model_choice import named_model
from sdimu_calibration.storage.files.plan_file import write_plan
from sdimu_calibration.storage.files.result_file import write_result
from sdimu_calibration.storage.files.standing_file import KnownEntry, read_standing
from sdimu_calibration.storage.opening import said_of, with_imu_file

OPEN = ("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y")


@pytest.fixture(scope="module")
def standing() -> Standing:
    """What kim18 leaves of asymmetry and quadratic term."""
    site = load_site("daejeon")
    test = PreparedTest(nominal_recording(load_plan("kim18"), site), load_imu("dtg"), site)
    known = known_of(solve(test, named_model("baseline", OPEN), "filter").evidence(), np.empty(0, dtype=np.int64))
    anew = np.where(["bias" in name for name in known.names], 0.1 * known.prior, 0.0)
    return Standing(replace(known, scatter=anew), OPEN, (OPEN,), "dtg", "daejeon")


@pytest.fixture
def folder(standing, tmp_path):
    write_json(tmp_path / "diagnosis.json", {"format": "sdimu-diagnosis/1", "known": KnownEntry.of(standing).plain()})
    return tmp_path


def test_what_was_written_is_read(standing, folder):
    read = read_standing(folder)
    assert (read.added, read.open, read.imu, read.site) == (OPEN, (OPEN,), "dtg", "daejeon")
    for one, other in ((read.known.J, standing.known.J), (read.known.scatter, standing.known.scatter)):
        np.testing.assert_array_equal(one, other)


def test_a_search_after_results_says_what_is_known_and_what_the_plan_adds(folder, capsys):
    plan(plan="kim18", after=[folder], tries=2, out=folder / "found.yaml")
    told = capsys.readouterr().out
    assert re.search(r"expected information beyond what is known: [\d.]+ nat by kim18 in [\d.]+ min, ", told)
    assert "gyro_scale_asymmetry_y from gyro_scale_quadratic_y" in told
    # Both classes are in the table, though the model of the command has neither.
    assert "gyro_scale_quadratic" in told
    assert load_plan(str(folder / "found.yaml")).duration_s <= load_plan("kim18").duration_s + 1e-6


def test_a_plan_keeps_to_the_minutes_or_says_what_the_shortest_takes(folder, capsys):
    plan(plan="kim18", after=[folder], minutes=20.0, tries=1, out=folder / "found.yaml")
    assert load_plan(str(folder / "found.yaml")).duration_s <= 20.0 * 60.0
    assert "the shortest takes" not in capsys.readouterr().out
    whole = load_plan("kim18")
    first = replace(whole, dwell_s=(40.0,) * 3, turns=(whole.turns[0], replace(whole.turns[0], axis="Z")))
    write_plan(folder / "crossed.yaml", first, [])
    plan(plan=str(folder / "crossed.yaml"), after=[folder], minutes=1.0, tries=1, out=folder / "short.yaml")
    said = " ".join(capsys.readouterr().out.split())
    minutes = load_plan(str(folder / "short.yaml")).duration_s / 60.0
    assert f"fits in --minutes 1: the shortest takes {minutes:.1f} min" in said


def test_minutes_that_leave_no_turn_leave_no_plan(tmp_path, capsys):
    plan(plan="kim18", minutes=1.0, tries=1, out=tmp_path / "found.yaml")
    said = " ".join(capsys.readouterr().out.split())
    assert "no plan with the attitudes of kim18 that turns the IMU fits in --minutes 1; no file written" in said
    assert not (tmp_path / "found.yaml").exists()


@pytest.mark.parametrize(("minutes", "told"), [(3.0, True), (20.0, False)])
def test_what_a_short_plan_does_not_show_is_told(tmp_path, capsys, minutes, told):
    plan(plan="kim18", minutes=minutes, tries=1, out=tmp_path / "found.yaml")
    said = " ".join(capsys.readouterr().out.split())
    assert (
        "it leaves a coefficient or more of gyro_scale, gyro_misalignment, gyro_mass_unbalance, accel_bias" in said
    ) == told
    assert load_plan(tmp_path / "found.yaml").turns


def test_the_shortest_recording_that_tells_them_apart_turns_at_another_rate(folder, capsys):
    plan(plan="kim18", after=[folder], tell=list(OPEN))
    heading, first = capsys.readouterr().out.splitlines()[:2]
    assert heading == f"Turns of the next recording that tell {' from '.join(OPEN)}, the most a minute first:"
    assert first.startswith("turn Y")
    assert "at 10 deg/s" in first


def test_results_beside_others_may_count_a_recording_twice_and_are_refused(folder):
    with pytest.raises(DataError, match="one result alone"):
        plan(plan="kim18", after=[folder, folder])


def test_results_of_another_version_are_told(folder):
    write_json(folder / "diagnosis.json", {"format": "sdimu-diagnosis/1"})
    with pytest.raises(DataError, match="run sdimu diagnose again"):
        plan(plan="kim18", after=[folder])
    write_json(folder / "diagnosis.json", {"format": "sdimu-diagnosis/1", "known": {"names": ["gyro_bias_x"]}})
    with pytest.raises(DataError, match="damaged"):
        plan(plan="kim18", after=[folder])


@pytest.mark.parametrize(("row", "column", "value"), [(0, 0, -1e308), (15, 15, 0.0), (0, 5, 1e18), (5, 5, -1e30)])
def test_information_that_is_of_no_data_is_refused(standing, folder, row, column, value):
    J = standing.known.J.copy()
    J[row, column] = value
    damaged = replace(standing, known=replace(standing.known, J=J))
    write_json(folder / "diagnosis.json", {"format": "sdimu-diagnosis/1", "known": KnownEntry.of(damaged).plain()})
    with pytest.raises(DataError, match=r"diagnosis\.json: known: damaged .*(below zero|of no data)"):
        read_standing(folder)


@pytest.mark.parametrize("prior", [0.0, -1.0])
def test_a_prior_of_nothing_is_refused(standing, folder, prior):
    damaged = replace(standing, known=replace(standing.known, prior=np.full(len(standing.known.prior), prior)))
    write_json(folder / "diagnosis.json", {"format": "sdimu-diagnosis/1", "known": KnownEntry.of(damaged).plain()})
    with pytest.raises(DataError, match="a prior is not above zero"):
        read_standing(folder)


HEAT = ("accel_bias_temperature_x", "accel_scale_temperature_x")


def test_what_only_a_change_of_temperature_tells_is_said_so(capsys):
    plan(plan="kim18", tell=list(HEAT))
    told = capsys.readouterr().out
    assert "0.0 sigma instead of 0.0" not in told
    assert told.startswith(f"no turn tells {HEAT[0]} and {HEAT[1]} apart: ")
    assert "only a change of temperature tells them" in " ".join(told.split())


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A site's and an IMU's file in one folder, and work that goes on in another."""
    for kind, name in (("site", "daejeon"), ("imu", "dtg")):
        shutil.copy(find_config(kind, name), tmp_path / f"{kind}_of_mine.yaml")
    write_recording(
        tmp_path / "bag",
        BagContent(
            start_ns=10**18, imu_ns=np.arange(1, 3) * 10**7, omega_ib_b=np.zeros((2, 3)), f_ib_b=np.zeros((2, 3))
        ),
    )
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_site_and_an_imu_of_the_users_own_are_found_again_from_the_results(elsewhere, monkeypatch, capsys):
    site, imu = "site_of_mine.yaml", "imu_of_mine.yaml"
    of_mine = PreparedTest(
        nominal_recording(load_plan("kim18"), load_site(site)),
        load_imu(imu),
        load_site(site),
        origin=said_of(elsewhere / "bag", site),
    )
    result = outcome(solve(with_imu_file(of_mine, imu), named_model("baseline", ()), "filter"))
    write_result(elsewhere / "result.json", result)
    assert result.origin.site == "site_of_mine"
    monkeypatch.chdir(elsewhere / "there")
    plan(plan="kim18", after=[elsewhere], tell=list(OPEN))
    assert capsys.readouterr().out.splitlines()[1].startswith("turn Y")


def test_names_in_config_leave_no_path_in_a_result(elsewhere):
    assert said_of(elsewhere / "bag", "daejeon").site_file == ""
