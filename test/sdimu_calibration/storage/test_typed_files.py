"""fleet.json, datasheet.json and prediction.json: what was written is read back, and says the same to the byte."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.fleet.datasheet import Sample, datasheet
from sdimu_calibration.core.fleet.study import study
from sdimu_calibration.core.planning.observability import Combination
from sdimu_calibration.core.planning.predict import Prediction
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.datasheet_file import Certificate, DatasheetFile, write_datasheet
from sdimu_calibration.storage.files.fleet_file import FleetFile, write_fleet
from sdimu_calibration.storage.files.fleet_folder import as_measured, candidates, gather
from sdimu_calibration.storage.files.prediction_file import PredictionFile, write_prediction
from sdimu_calibration.storage.files.result_model import read_model


@pytest.fixture
def files(batch, tmp_path):
    """A file of each kind, as its writer leaves it, with the model that reads it."""
    found = gather([batch(units=5, each=2, out=3)])
    model = found.entries[0].result.model
    write_fleet(tmp_path / "fleet.json", found, study(as_measured(found.entries), model, candidates(found.given)))
    about = Certificate("SN1", "2026-01-02", "A. Person", recordings=(("bag_0_0", "ab" * 32), ("bag_1_0", "")))
    lines = [replace(line, limit=1e-3) for line in datasheet([Sample(e.unit, e.result) for e in found.entries], [])]
    write_datasheet(tmp_path / "datasheet.json", lines, about, found.entries)
    one, none = np.full(2, 1e-6), np.zeros((0, 2))
    told = Prediction(
        body_frame="accelerometer_triad",
        duration_s=2980.0,
        model=("a",),
        names=("a_x", "a_y"),
        units=("rad/s", "1"),
        display_units=("deg/h", "ppm"),
        sigma=one,
        in_noise=2.0 * one,
        bound=np.array([np.nan, 1e-7]),
        prior=3.0 * one,
        covariance=np.diag(one),
        t=np.zeros(0),
        history=none,
        attitude=np.zeros((0, 3)),
        dwell=np.zeros(0, bool),
        unobservable=(Combination("a_x with a_y: what is of both alone", (), 1.0),),
    )
    write_prediction(tmp_path / "prediction.json", told, {"plan": "kim18", "imu": "dtg", "mount_deg": "0"})
    return {
        FleetFile: tmp_path / "fleet.json",
        DatasheetFile: tmp_path / "datasheet.json",
        PredictionFile: tmp_path / "prediction.json",
    }


@pytest.mark.parametrize("model", [FleetFile, DatasheetFile, PredictionFile])
def test_a_file_that_is_read_and_written_again_is_the_same(files, model, tmp_path):
    read_model(files[model], model).write(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == files[model].read_bytes()


def test_what_is_read_are_numbers_and_objects_of_the_core(files):
    read, plain = read_model(files[FleetFile], FleetFile), json.loads(files[FleetFile].read_text())
    assert [(one.unit, one.coefficient) for one in read.out] == [("SN3", "gyro_scale_y")]
    assert read.coefficients[0].values.tolist() == plain["coefficients"][0]["values"]
    assert read.results[0].origin.serial == "SN0"
    # What nobody measured is null in the file and no number where it is read.
    sheet = read_model(files[DatasheetFile], DatasheetFile)
    assert {line.verdict for line in sheet.lines if np.isnan(line.value)} == {"not measured"}


@pytest.mark.parametrize(
    ("model", "key"), [(FleetFile, "coefficients"), (DatasheetFile, "lines"), (PredictionFile, "covariance")]
)
def test_a_file_without_a_key_is_refused_by_its_name(files, model, key):
    path = files[model]
    path.write_text(json.dumps({k: v for k, v in json.loads(path.read_text()).items() if k != key}))
    with pytest.raises(DataError, match=rf"{path.name}: not a complete .* file \({key}: missing key\)"):
        read_model(path, model)
