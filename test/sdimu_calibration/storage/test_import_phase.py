"""A column of a file says what is a rest, and a run by hand takes those rests."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.data.stated_rests import dwells_of
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_metadata import custom_data
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.importing.import_map import ImportMap
from sdimu_calibration.storage.importing.importer import read_files, write_imported

MAP = {
    "format": "sdimu-import/1",
    "time": {"rate_hz": 100},
    "accel": {"columns": ["ax", "ay", "az"], "unit": "m/s^2"},
    "gyro": {"columns": ["gx", "gy", "gz"], "unit": "deg/s"},
    "phase": {"column": "what", "rest": "pos*"},
}


@pytest.fixture
def file(tmp_path):
    """Three rests of 2, 3 and 4 s; a turn of 1 s lies between the first two alone."""
    labels = ["pos1"] * 200 + ["turn"] * 100 + ["pos2"] * 300 + ["pos3"] * 400 + ["end"] * 50
    rng = np.random.default_rng(4)
    rows = [",".join([*(f"{x:.5f}" for x in rng.standard_normal(6)), label]) for label in labels]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["gx,gy,gz,ax,ay,az,what", *rows]) + "\n")
    return path


def test_labels_become_the_dwells_of_the_bag(file, tmp_path):
    found = read_files([file], ImportMap.model_validate(MAP))
    write_imported(tmp_path / "bag", found, custom={"power_on": "Monday"})
    recording = read_recording(tmp_path / "bag")
    dwells = np.array(dwells_of(recording.phase, float(recording.t[-1])))
    # A stamp is the end of a sample: a rest lasts from the stamp before its first to that of its last.
    first = found.ns[0] * 1e-9 - recording.t[0]
    np.testing.assert_allclose(dwells + first, [[0.01, 2.0], [3.0, 6.0], [6.0, 10.0]], atol=1e-6)
    assert custom_data(tmp_path / "bag")["power_on"] == "Monday"


def test_two_files_count_their_stops_on(file):
    status = read_files([file, file], ImportMap.model_validate(MAP)).status
    assert status is not None
    ns, dwell, stop = status
    assert np.all(np.diff(ns) > 0)
    assert stop[dwell].tolist() == [0, 1, 2, 3, 4, 5]


def test_a_column_of_numbers_says_it_by_one(file, tmp_path):
    path = tmp_path / "numbers.csv"
    text = file.read_text()
    for word, number in (("pos1", "1"), ("pos2", "1"), ("pos3", "1"), ("turn", "0"), ("end", "0")):
        text = text.replace(word, number)
    path.write_text(text)
    status = read_files([path], ImportMap.model_validate({**MAP, "phase": {"column": "what"}})).status
    assert status is not None
    assert status[1].tolist() == [True, False, True, False]


def test_a_column_that_never_says_rest_is_refused_with_its_words(file):
    with pytest.raises(DataError, match=r"says rest nowhere \(there are 'end', 'pos1', .*phase.rest"):
        read_files([file], ImportMap.model_validate({**MAP, "phase": {"column": "what"}}))
