"""A file without a map gets one that reads it; what the file does not say is left to the user in so many words."""

from __future__ import annotations

import csv
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.importing.import_map import ImportMap, load_import_map
from sdimu_calibration.storage.importing.importer import read_files
from sdimu_calibration.storage.importing.map_proposal import propose_maps
from sdimu_calibration.storage.importing.text_table import column_text
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate


@pytest.fixture(scope="module")
def hand():
    """Eight attitudes by hand at 100 Hz."""
    return by_hand_recording(ByHand(8, load_imu("mems_by_hand"), load_site("daejeon"), seed=3))[0]


def write(path, heading, columns, above=()):
    rows = (",".join(f"{value:.8g}" for value in row) for row in columns)
    path.write_text("\n".join([*above, *([heading] if heading else []), *rows]) + "\n")
    return path


def read_by(proposal, path):
    return read_files([path], ImportMap.model_validate(yaml.safe_load(proposal.text)))


def same(found, recording):
    np.testing.assert_allclose(found.f_ib_b, recording.f_ib_b, atol=2e-3)
    np.testing.assert_allclose(found.omega_ib_b, recording.omega_ib_b, atol=2e-4)


@pytest.mark.parametrize(
    ("heading", "accel", "gyro"),
    [
        ("t,ax,ay,az,gx,gy,gz", 1.0, 1.0),
        (
            "time [s],acc_x [g],acc_y [g],acc_z [g],gyr_x [deg/s],gyr_y [deg/s],gyr_z [deg/s]",
            STANDARD_GRAVITY,
            np.pi / 180,
        ),
        ("timestamp,AccelX,AccelY,AccelZ,GyroX,GyroY,GyroZ", STANDARD_GRAVITY / 1000.0, np.pi / 180),
        ("t,imu_acc_x,imu_acc_y,imu_acc_z,wx,wy,wz", STANDARD_GRAVITY / 16384, np.pi / 180 / 16.4),
        ("", 1.0, np.pi / 180),
    ],
)
def test_headings_units_and_counts_are_recognised(tmp_path, hand, heading, accel, gyro):
    columns = np.column_stack([hand.t, hand.f_ib_b / accel, hand.omega_ib_b / gyro])
    path = write(tmp_path / "log.csv", heading, columns)
    (proposal,) = propose_maps([path])
    found = read_by(proposal, path)
    same(found, hand)
    np.testing.assert_allclose(found.ns * 1e-9, hand.t, atol=1e-6)


def test_times_in_microseconds_and_a_rate_above_the_data_are_read(tmp_path, hand):
    columns = np.column_stack([hand.t * 1e6, hand.omega_ib_b, hand.f_ib_b])
    (by_column,) = propose_maps([write(tmp_path / "a.csv", "us,gx,gy,gz,ax,ay,az", columns)])
    assert "unit: us, 100 Hz" in by_column.text or "unit: us}" in by_column.text
    path = write(tmp_path / "b.csv", "gx,gy,gz,ax,ay,az", columns[:, 1:], ["Sample rate: 100 Hz"])
    (above,) = propose_maps([path])
    assert "time: {rate_hz: 100}" in above.text
    (unsaid,) = propose_maps([write(tmp_path / "c.csv", "gx,gy,gz,ax,ay,az", columns[:, 1:])])
    assert any("correct it" in word for word in unsaid.words)


def test_two_imus_in_a_file_get_a_map_each(tmp_path, hand):
    columns = np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b, -hand.f_ib_b, 2.0 * hand.omega_ib_b])
    heading = "t,acc1_x,acc1_y,acc1_z,gyro1_x,gyro1_y,gyro1_z,acc2_x,acc2_y,acc2_z,gyro2_x,gyro2_y,gyro2_z"
    path = write(tmp_path / "two.csv", heading, columns)
    first, second = propose_maps([path])
    assert (first.suffix, second.suffix) == ("_1", "_2")
    same(read_by(first, path), hand)
    np.testing.assert_allclose(read_by(second, path).f_ib_b, -hand.f_ib_b, atol=1e-5)


def test_a_file_without_an_imu_is_refused_with_its_headings(tmp_path):
    path = write(tmp_path / "log.csv", "a,b,c", np.arange(300.0).reshape(100, 3))
    with pytest.raises(DataError, match=r"not clear which columns .* \(a, b, c\)"):
        propose_maps([path])


def test_a_few_broken_lines_are_left_out_with_their_numbers(tmp_path, hand):
    path = write(tmp_path / "log.csv", "t,ax,ay,az,gx,gy,gz", np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b]))
    lines = path.read_text().splitlines()
    lines[500], lines[900] = lines[500][:20], "###" + lines[900].replace("1", "x")
    lines[901] = "garbled,1,2"
    path.write_text("\n".join(lines))
    (proposal,) = propose_maps([path])
    found = read_by(proposal, path)
    assert len(found.ns) == len(hand.t) - 3
    assert any("2 of" in note and "(line 501, 902)" in note for note in found.notes)


def test_without_a_clock_a_broken_line_still_counts_as_a_sample(tmp_path, hand):
    path = write(tmp_path / "log.csv", "ax,ay,az,gx,gy,gz", np.column_stack([hand.f_ib_b, hand.omega_ib_b]))
    lines = path.read_text().splitlines()
    lines[500] = "1,2,3"
    path.write_text("\n".join(lines))
    (proposal,) = propose_maps([path])
    found = read_by(proposal, path)
    assert len(found.ns) == len(hand.t)
    assert np.isnan(found.f_ib_b[499]).all()


def test_many_broken_lines_are_refused_with_the_first(tmp_path, hand):
    path = write(tmp_path / "log.csv", "t,ax,ay,az,gx,gy,gz", np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b]))
    (proposal,) = propose_maps([path])
    lines = path.read_text().splitlines()
    lines[100:200] = ["1,2"] * 100
    path.write_text("\n".join(lines))
    with pytest.raises(DataError, match="line 101 has 2 columns"):
        read_by(proposal, path)


@pytest.mark.parametrize(
    ("name", "accel", "gyro"),
    [
        ("tomi/calibration.csv", "counts_per_unit: 16384", "counts_per_unit: 131"),
        ("nilspod/ferraris_session.csv", "unit: m/s^2", "unit: deg/s"),
        ("mikoff/imu2.log", "columns: [1, 2, 3]", "unit: rad/s"),
        ("static-pair/up.txt", "columns: [5, 6, 7]", "unit: deg/s"),
    ],
)
def test_recordings_of_others_get_the_map_that_reads_them(recorded, tmp_path, name, accel, gyro):
    path = recorded(name)
    (proposal,) = propose_maps([path])
    assert accel in proposal.text
    assert gyro in proposal.text
    file = tmp_path / "map.yaml"
    file.write_text(proposal.text)
    found = read_files([path], load_import_map(file))
    assert abs(np.median(np.linalg.norm(found.f_ib_b, axis=1)) / STANDARD_GRAVITY - 1.0) < 0.1


N = 200
RNG = np.random.default_rng(7)
STATIC = np.column_stack(
    [np.arange(N) * 0.01, RNG.normal([0.1, -0.2, 9.8], 0.01, (N, 3)), RNG.normal(0.0, 0.002, (N, 3))]
)


def read_back(proposal, path, folder):
    (folder / "map.yaml").write_text(proposal.text, "utf-8")
    return read_files([path], load_import_map(folder / "map.yaml"))


@given(st.text())
@settings(max_examples=50, deadline=None)
def test_every_heading_is_written_so_that_the_map_reads_it(name):
    assert yaml.safe_load(f"[{column_text(name)}, 2]") == [name, 2]


@given(st.lists(st.text(st.characters(codec="utf-8", exclude_characters="xyzXYZ"), max_size=6), min_size=7, max_size=7))
@settings(max_examples=40, deadline=None)
def test_whatever_the_headings_are_the_map_reads_the_columns(tmp_path_factory, headings):
    folder = tmp_path_factory.mktemp("headings")
    with (folder / "a.csv").open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(headings)
        rows.writerows([[f"{value:.6f}" for value in row] for row in STATIC])
    (proposal,) = propose_maps([folder / "a.csv"])
    found = read_back(proposal, folder / "a.csv", folder)
    np.testing.assert_allclose(found.f_ib_b, STATIC[:, 1:4], atol=1e-5)


@pytest.mark.parametrize("quote", ["\\", '"', "x: [", "#", "\x1b", "µ😀"])
def test_the_characters_of_yaml_in_headings_do_no_harm(tmp_path, hand, quote):
    path = tmp_path / "log.csv"
    names = [f"{sensor}{quote}{axis}" for sensor in ("acc", "gyro") for axis in "xyz"]
    write(path, ",".join(["t", *names]), np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b]))
    (proposal,) = propose_maps([path])
    same(read_back(proposal, path, tmp_path), hand)


@pytest.mark.parametrize("headings", ["t,1,2,3,4,5,6", "0,1,2,3,4,5,6", ""])
@pytest.mark.parametrize("index", [False, True])
def test_headings_in_numbers_and_an_index_of_the_rows_mislead_nobody(tmp_path, hand, headings, index):
    columns = [hand.t, hand.f_ib_b, hand.omega_ib_b]
    path = tmp_path / "log.csv"
    rows = [",".join(f"{value:.6f}" for value in row) for row in np.column_stack(columns)]
    rows = [f"{k},{row}" for k, row in enumerate(rows)] if index else rows
    path.write_text("\n".join([*([("," if index else "") + headings] if headings else []), *rows]))
    (proposal,) = propose_maps([path])
    found = read_back(proposal, path, tmp_path)
    same(found, hand)
    np.testing.assert_allclose(found.ns * 1e-9, hand.t, atol=1e-5)


def test_an_index_of_the_rows_is_no_time(tmp_path, hand):
    columns = np.column_stack([np.arange(len(hand.t)), hand.f_ib_b, hand.omega_ib_b])
    (proposal,) = propose_maps([write(tmp_path / "a.csv", "", columns)])
    assert any("column 1 counts samples" in word and "correct it" in word for word in proposal.words)
    (named,) = propose_maps([write(tmp_path / "b.csv", "t,ax,ay,az,gx,gy,gz", columns)])
    assert any("if they count samples, write rate_hz" in word for word in named.words)


@pytest.mark.parametrize("others", ["fixed", "temperature", "second", "magnetometer", "gyros first"])
def test_columns_without_headings_are_told_by_what_turns_together(tmp_path, hand, others):
    rng = np.random.default_rng(2)
    n = len(hand.t)
    f, w = hand.f_ib_b, hand.omega_ib_b
    field = 30.0 * np.roll(f, 1, axis=1) / 9.8 + rng.normal(0.0, 0.05, (n, 3))
    beside = {
        "fixed": [np.tile([0.0, 0.0, 9.8], (n, 1)), f, np.full(n, 4000.0), w, np.full(n, 4000.0)],
        "temperature": [rng.normal(25.0, 0.01, n), f, w],
        "second": [f, 1.01 * f[:, [1, 0, 2]] + rng.normal(0.0, 0.02, (n, 3)), w],
        "magnetometer": [field, f, w],
        "gyros first": [w, rng.normal(1013.0, 0.2, n), f],
    }[others]
    path = write(tmp_path / "log.csv", "", np.column_stack([hand.t, *beside]))
    (proposal,) = propose_maps([path])
    same(read_by(proposal, path), hand)


def test_a_second_accelerometer_is_no_gyro(tmp_path, hand):
    f = hand.f_ib_b
    second = np.column_stack([hand.t, f, f + np.random.default_rng(2).normal(0.0, 0.02, f.shape)])
    for name, heading in (("a.csv", ""), ("b.csv", "t,acc_lo_x,acc_lo_y,acc_lo_z,acc_hi_x,acc_hi_y,acc_hi_z")):
        with pytest.raises(DataError, match="it is not clear which columns"):
            propose_maps([write(tmp_path / name, heading, second)])
    heading = "t,acc_lo_x,acc_lo_y,acc_lo_z,acc_hi_x,acc_hi_y,acc_hi_z,gyro_x,gyro_y,gyro_z"
    path = write(tmp_path / "c.csv", heading, np.column_stack([second, hand.omega_ib_b]))
    low, high = propose_maps([path])
    assert (low.suffix, high.suffix) == ("_lo", "_hi")
    same(read_by(low, path), hand)


def test_the_rates_of_a_single_turn_are_no_second_accelerometer(tmp_path):
    t = np.arange(1500) * 0.01
    angle = np.pi / 4.0 * (1.0 - np.cos(np.pi * np.clip((t - 6.0) / 2.0, 0.0, 1.0)))
    force = 9.8 * np.column_stack([np.sin(angle), 0.0 * t, np.cos(angle)]) + RNG.normal(0.0, 0.01, (len(t), 3))
    rate = np.column_stack([0.0 * t, np.gradient(angle, t), 0.0 * t]) + RNG.normal(0.003, 0.002, (len(t), 3))
    path = write(tmp_path / "a.csv", "", np.column_stack([t, force, rate]))
    (proposal,) = propose_maps([path])
    np.testing.assert_allclose(read_by(proposal, path).f_ib_b, force, atol=1e-5)
    assert "columns: [5, 6, 7]" in proposal.text


def test_of_two_columns_of_one_name_the_one_that_is_measured_is_taken(tmp_path, hand):
    fixed = np.tile([0.0, 0.0, 9.8], (len(hand.t), 1))
    columns = np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b, fixed])
    path = write(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz,wx,wy,wz", columns)
    (proposal,) = propose_maps([path])
    same(read_by(proposal, path), hand)
    columns[:, 7:] = hand.omega_ib_b
    with pytest.raises(DataError, match="gx, gy, gz and wx, wy, wz may be one sensor"):
        propose_maps([write(tmp_path / "b.csv", "t,ax,ay,az,gx,gy,gz,wx,wy,wz", columns)])


def test_units_in_headings_that_the_numbers_contradict_are_told(tmp_path, hand):
    heading = "time [ms],acc_x [g],acc_y [g],acc_z [g],gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s]"
    path = write(tmp_path / "a.csv", heading, np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b]))
    (proposal,) = propose_maps([path])
    for word in ("the headings say g,", "the headings say deg/s,", "its heading says ms,"):
        assert any(word in line and "check it" in line for line in proposal.words)
    same(read_by(proposal, path), hand)


@pytest.fixture(scope="module")
def table():
    """The first nine turns of kim18, quicker, at 20 Hz."""
    turns = tuple(replace(turn, rate_rad_s=np.radians(9.0)) for turn in load_plan("kim18").turns[:9])
    plan = Plan("nine turns", (12.0,) * 10, turns, np.radians(9.0))
    return generate(Scenario(plan, load_imu("dtg"), load_site("daejeon"), rate_hz=20.0, seed=5))[0]


@pytest.mark.parametrize("signs", list(product((1, -1), repeat=3)))
@pytest.mark.parametrize("source", ["hand", "table"])
def test_gyros_of_the_wrong_sense_are_told_and_turned_round_in_the_map(tmp_path, request, source, signs):
    recording = request.getfixturevalue(source)
    reversed_gyros = recording.omega_ib_b * signs
    path = write(
        tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz", np.column_stack([recording.t, recording.f_ib_b, reversed_gyros])
    )
    (proposal,) = propose_maps([path])
    same(read_by(proposal, path), recording)
    told = [word for word in proposal.words if "turns close with the opposite sign of" in word]
    assert len(told) == (signs != (1, 1, 1))


def test_the_sign_is_told_beside_any_unit_and_without_headings(tmp_path, hand):
    heading = "t,ax,ay,az,gx [deg/h],gy [deg/h],gz [deg/h]"
    in_degrees_an_hour = -hand.omega_ib_b / (np.pi / 180 / 3600)
    path = write(tmp_path / "a.csv", heading, np.column_stack([hand.t, hand.f_ib_b, in_degrees_an_hour]))
    (stated,) = propose_maps([path])
    assert "sign: [-1, -1, -1]" in stated.text
    path = write(tmp_path / "b.csv", "", np.column_stack([hand.t, hand.f_ib_b, -hand.omega_ib_b / (np.pi / 180 / 131)]))
    (unsaid,) = propose_maps([path])
    same(read_by(unsaid, path), hand)


def test_an_axis_that_is_not_turned_about_goes_with_the_others(tmp_path):
    turns = tuple(Turn(axis, np.radians(90.0), np.radians(9.0)) for axis in "YYYY")
    plan = Plan("about one axis", (12.0,) * 5, turns, np.radians(9.0))
    one = generate(Scenario(plan, load_imu("dtg"), load_site("daejeon"), rate_hz=20.0, seed=5))[0]
    columns = np.column_stack([one.t, one.f_ib_b, -one.omega_ib_b])
    (proposal,) = propose_maps([write(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz", columns)])
    assert "sign: [-1, -1, -1]" in proposal.text


def test_columns_that_never_change_or_hold_few_numbers_are_told(tmp_path, hand):
    columns = np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b])
    columns[:, 6] = 0.5
    columns[::4, 2] = np.nan
    (proposal,) = propose_maps([write(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz", columns)])
    assert any("in gz never change" in word for word in proposal.words)
    assert any(f"{len(columns[::4])} of {len(columns)} samples have no number" in word for word in proposal.words)


def cells(content, form):
    return [",".join(cell % value for cell, value in zip(form.split(), row, strict=True)) for row in content]


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        (cells(0.0 * STATIC, "%.1f " * 7), "hold zeros alone"),
        (cells(STATIC, "%.2f 0x%d 0x%d 0x%d %.2f %.2f %.2f"), "line 2, column ax: '0x0' is not a number"),
        (cells(STATIC, "%.4f " * 7)[:40] + ["1,2", "3,4"] * 5, "line 42 has 2 columns"),
        (cells(STATIC, "%.2f " + 6 * "nan%.0s "), "0 of 200 lines hold a number in all"),
        (["0.1,1,2,3,4,5,6"], "1 of 1 lines hold a number"),
    ],
)
def test_a_table_that_cannot_be_read_is_told_in_one_line(tmp_path, rows, told):
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t,ax,ay,az,gx,gy,gz", *rows]))
    with pytest.raises(DataError, match=told):
        propose_maps([path])


def test_names_of_imus_make_names_of_files(tmp_path, hand):
    names = ["../../up", "x" * 300, "imu a", "*"]
    heading = ",".join(f"{name}_{kind}_{axis}" for name in names for kind in ("acc", "gyro") for axis in "xyz")
    columns = np.column_stack([hand.t[:50]] + [hand.f_ib_b[:50], hand.omega_ib_b[:50]] * 4)
    proposals = propose_maps([write(tmp_path / "a.csv", f"t,{heading}", columns)])
    assert len({proposal.suffix for proposal in proposals}) == 4
    assert all(proposal.suffix.isidentifier() and len(proposal.suffix) < 50 for proposal in proposals)


def test_arrays_are_listed_for_the_map_that_the_user_writes(tmp_path):
    for rows in (7, 70):
        acc, t = np.zeros((rows, 3)), np.arange(float(rows))
        savemat(tmp_path / "a.mat", {"imu": {"acc": acc, "t": t}})
        np.savez(tmp_path / "a.npz", acc=acc, t=t)
        for name, listed in (("a.mat", "imu.acc ({} x 3), imu.t ({})"), ("a.npz", "acc ({} x 3), t ({})")):
            with pytest.raises(DataError) as error:
                propose_maps([tmp_path / name])
            assert listed.format(rows, rows) in str(error.value)
            assert "--map" in str(error.value)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("value", [1e200, -1e308, np.inf])
@pytest.mark.parametrize("column", [0, 1, 4])
def test_numbers_beyond_all_measure_disturb_nothing(tmp_path, hand, value, column):
    columns = np.column_stack([hand.t, hand.f_ib_b, hand.omega_ib_b])
    columns[100::50, column] = value
    (proposal,) = propose_maps([write(tmp_path / "a.csv", "", columns)])
    assert "columns: [2, 3, 4]" in proposal.text
    assert "columns: [5, 6, 7]" in proposal.text
    assert "unit: s}" in proposal.text
