"""Samples in arrays and data frames open as those of a bag do; what is wrong is one line that names the column."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import sdimu_calibration as sdimu
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.arrays import raw_test
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording

START_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def samples(recording):
    """The recording of the session as a program holds it."""
    ns = START_NS + np.round(recording.t * 1e9).astype(np.int64)
    at = np.searchsorted(recording.phase.t, recording.t, side="right") - 1
    status = {"dwell": recording.phase.dwell[at], "stop": recording.phase.stop[at]}
    return {"ns": ns, "gyro": recording.omega_ib_b, "accel": recording.f_ib_b, **status}


@pytest.fixture(scope="module")
def opened(samples):
    return sdimu.open(samples, site="daejeon", imu="dtg")


def test_arrays_open_as_a_bag_of_the_same_samples_does(samples, opened, recording, tmp_path):
    phase = recording.phase
    bag = write_recording(
        tmp_path / "bag",
        BagContent(
            start_ns=START_NS,
            imu_ns=samples["ns"] - START_NS,
            omega_ib_b=recording.omega_ib_b,
            f_ib_b=recording.f_ib_b,
            status=(np.round(phase.t * 1e9).astype(np.int64), phase.dwell, phase.stop),
        ),
    )
    other = sdimu.open(bag or tmp_path / "bag", site="daejeon", imu="dtg")
    np.testing.assert_array_equal(opened.recording.t, other.recording.t)
    np.testing.assert_array_equal(opened.recording.omega_ib_b, other.recording.omega_ib_b)
    for name in ("dwell", "stop"):
        found = [
            getattr(one.recording.phase, name)[np.searchsorted(one.recording.phase.t, recording.t, side="right") - 1]
            for one in (opened, other)
        ]
        np.testing.assert_array_equal(*found)


def test_a_data_frame_of_columns_is_the_same(samples, opened):
    columns = {f"{triad}_{axis}": samples[triad][:, k] for triad in ("gyro", "accel") for k, axis in enumerate("xyz")}
    rest = {name: samples[name] for name in ("ns", "dwell", "stop")}
    frame = pd.DataFrame({**rest, **columns})
    again = sdimu.open(frame, site="daejeon", imu="dtg")
    np.testing.assert_array_equal(again.recording.f_ib_b, opened.recording.f_ib_b)
    assert again.origin.recording == "arrays"


def test_seconds_are_a_time_and_stops_count_themselves(samples):
    t = (samples["ns"] - START_NS) * 1e-9
    raw = raw_test({"t": t, **{name: samples[name] for name in ("gyro", "accel", "dwell")}})
    np.testing.assert_allclose(raw.ns, samples["ns"] - START_NS, atol=1)
    assert raw.status is not None
    resting = np.unique(raw.status.stop[raw.status.dwell])
    np.testing.assert_array_equal(resting, np.unique(samples["stop"][samples["dwell"]]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gyro": None}, "no gyro: give gyro, shape .n, 3., or gyro_x, gyro_y, gyro_z"),
        ({"ns": None}, "no time"),
        ({"ns": np.arange(4.0)}, "ns holds no integers"),
        ({"accel": np.zeros((3, 3))}, r"accel has shape \(3, 3\), expected \(4, 3\)"),
        ({"gyr_x": np.zeros(4)}, "no column is called 'gyr_x'; did you mean gyro_x"),
        ({"temperature": np.array(["warm"] * 4)}, "temperature holds no numbers"),
        ({"stop": np.zeros(4)}, "stop without dwell"),
        ({"gyro": np.zeros((4, 3), complex)}, "gyro holds complex numbers; give real ones, such as gyro.real"),
        ({"ns": None, "t": np.arange(4) * (1.0 + 0j)}, "t holds complex numbers"),
        ({"ns": None, "t": np.arange(4) * 1e18}, "t is no time in seconds"),
    ],
)
def test_what_is_wrong_is_one_line_that_names_the_column(change, words):
    good = {"ns": np.arange(4), "gyro": np.zeros((4, 3)), "accel": np.zeros((4, 3))}
    given = {name: value for name, value in {**good, **change}.items() if value is not None}
    with pytest.raises(DataError, match=words):
        raw_test(given)
