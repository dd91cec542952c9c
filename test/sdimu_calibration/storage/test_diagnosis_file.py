"""diagnosis.json has the names that others rely on, and says what the diagnosis says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plans import quick_plan

from sdimu_calibration.core.diagnosis.diagnose import diagnose
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.files.diagnosis_file import content, read_diagnosis, unpacked, write_diagnosis
from sdimu_sim.core.scenario import Scenario, generate

SITE = Site(latitude_rad=float(np.radians(36.4)))


@pytest.fixture(scope="module")
def told():
    imu = load_imu("dtg")
    hidden = ("accel_quadratic_x=150 ug/g^2",)
    recording, _ = generate(Scenario(quick_plan(), imu, SITE, rate_hz=20.0, seed=301, effects=hidden))
    return summarise(diagnose(recording, SITE, imu, load_model("baseline")))


def test_the_file_has_every_name_of_the_interface(told, tmp_path):
    write_diagnosis(tmp_path / "diagnosis.json", told)
    read = read_diagnosis(tmp_path).plain()
    assert read["format"] == "sdimu-diagnosis/1"
    assert isinstance(read["adequate"], bool)
    assert 0.0 <= read["p_value"] <= 1.0
    assert set(read["where"][0]) == {"channel", "stop", "normalised_mean"}
    assert set(read["unexplained"]) == {"is", "fraction", "best_variables"}
    assert all(isinstance(text, str) for text in read["advice"])
    names = {
        "effect",
        "parameters",
        "delta_log_likelihood",
        "p_value_adjusted",
        "explained",
        "held_out_rms_before",
        "held_out_rms_after",
        "indistinguishable_from",
    }
    for candidate in read["candidates"]:
        assert names <= set(candidate)
        assert {"name", "value", "sigma", "unit"} <= set(candidate["parameters"][0])


def test_the_hidden_effect_is_in_the_file_in_si(told):
    first = content(told)["candidates"][0]
    (parameter,) = first["parameters"]
    named = {first["label"], *first["indistinguishable_from"]}
    assert "accel_quadratic_x" in named
    if first["label"] == "accel_quadratic_x":
        assert parameter["unit"] == "m/s^2/g^2"
        assert abs(parameter["value"] - to_si(150, "ug/g^2")) < 4.0 * parameter["sigma"]
    assert first["held_out_rms_after"] < first["held_out_rms_before"]


def test_every_candidate_is_there_alone_for_the_sum_over_units(told):
    alone = content(told)["alone"]
    assert len({len(alone[key]) for key in ("labels", "units", "estimates", "sigmas")}) == 1
    assert unpacked(alone["correlations"], len(alone["labels"])) is not None
    k = alone["labels"].index("accel_quadratic_x")
    assert alone["units"][k] == "m/s^2/g^2"
    # Its sigma takes the misfit of the other stops for noise.
    assert abs(alone["estimates"][k] - to_si(150, "ug/g^2")) < 4.0 * alone["sigmas"][k]


def test_places_are_ordered_by_how_far_they_are_off(told):
    sizes = [abs(w["normalised_mean"]) for w in content(told)["where"]]
    assert sizes == sorted(sizes, reverse=True)
    assert len(sizes) >= 6 * 19


def test_what_was_tried_on_the_way_to_nothing_is_not_listed_as_found(told):
    lost = summarise(replace(told.diagnosis, verdict="unexplained"))
    written = content(lost)
    assert written["candidates"] == []
    assert [c["label"] for c in written["partial"]] == [f.candidate.label for f in told.found]
    assert written["unexplained"]["is"]


def test_what_could_not_be_seen_has_a_reason(told):
    hidden = content(told)["not_testable"]
    assert {f"gyro_scale_asymmetry_{a}" for a in "xyz"} <= {h["label"] for h in hidden}
    assert all(h["reason"] for h in hidden)


def test_another_file_is_refused_by_name(tmp_path):
    (tmp_path / "diagnosis.json").write_text('{"format": "sdimu-result/1"}')
    with pytest.raises(DataError, match=r"diagnosis\.json: format is 'sdimu-result/1'"):
        read_diagnosis(tmp_path)
