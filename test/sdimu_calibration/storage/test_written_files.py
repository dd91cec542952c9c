"""fleet.json, datasheet.json and prediction.json: keys in their order, numbers as JSON, null for what is none."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.fleet.datasheet import Sample, datasheet
from sdimu_calibration.core.fleet.study import study
from sdimu_calibration.core.planning.observability import Combination
from sdimu_calibration.core.planning.predict import Prediction
from sdimu_calibration.storage.files.datasheet_file import Certificate, write_datasheet
from sdimu_calibration.storage.files.fleet_file import write_fleet
from sdimu_calibration.storage.files.fleet_folder import as_measured, candidates, gather
from sdimu_calibration.storage.files.prediction_file import write_prediction


@pytest.fixture
def files(batch, tmp_path):
    """Content of a file of each kind, as its writer leaves it."""
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
    return {kind: json.loads((tmp_path / f"{kind}.json").read_text()) for kind in ("fleet", "datasheet", "prediction")}


COEFFICIENT = (
    "name unit display_unit mean mean_low mean_high spread spread_low spread_high within within_low within_high q dof "
    "p_value control_low control_high values sigmas deviates"
)


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        ("fleet", "format imu model body_frame results apart units coefficients out trends common_effects"),
        ("datasheet", "format serial date operator plan version recordings results lines"),
        ("prediction", "format plan imu mount_deg body_frame duration_s coefficients unobservable covariance"),
    ],
)
def test_keys_stand_in_their_order(files, kind, keys):
    assert list(files[kind]) == keys.split()
    assert files[kind]["format"] == f"sdimu-{kind}/1"


def test_a_fleet_says_coefficients_who_is_out_and_where_results_are_from(files):
    fleet = files["fleet"]
    assert [(one["unit"], one["coefficient"]) for one in fleet["out"]] == [("SN3", "gyro_scale_y")]
    assert [list(one) for one in fleet["coefficients"]] == [COEFFICIENT.split()] * len(fleet["coefficients"])
    assert len(fleet["coefficients"][0]["values"]) == len(fleet["units"])
    # Paths stand in the origin of a result only where the user named them.
    assert fleet["results"][0]["origin"]["serial"] == "SN0"
    assert "site_file" not in fleet["results"][0]["origin"]


def test_what_nobody_measured_is_null(files):
    lines = files["datasheet"]["lines"]
    assert {line["verdict"] for line in lines if line["value"] is None} == {"not measured"}
    assert [file["sha256"] for file in files["datasheet"]["recordings"]] == ["ab" * 32, ""]
    x, y = files["prediction"]["coefficients"]
    assert x == {"name": "a_x", "sigma": 1e-6, "sigma_in_noise": 2e-6, "bound": None, "prior": 3e-6, "unit": "rad/s"}
    assert y["bound"] == 1e-7
