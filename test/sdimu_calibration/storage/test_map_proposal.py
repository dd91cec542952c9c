"""A file without a map gets one that reads it; what the file does not say is left to the user in so many words."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.importing.import_map import ImportMap, load_import_map
from sdimu_calibration.storage.importing.importer import read_files
from sdimu_calibration.storage.importing.map_proposal import propose_maps
from sdimu_sim.core.by_hand import ByHand, by_hand_recording


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
