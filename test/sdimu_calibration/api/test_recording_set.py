"""Sets in Python give what the verbs give."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import sdimu_calibration as sdimu
from sdimu_calibration.api.recording_set import JointFit
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.fleet_folder import candidates, gather
from sdimu_calibration.storage.files.json_file import write_json
from sdimu_calibration.storage.files.result_file import read_result


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("set")
    common = {"plan": "kim18_signed", "unit": 3, "serial": "SN3", "rate": 10.0, "turn_on": ["accel_bias=20 ug"]}
    effect = ["gyro_scale_asymmetry_y=40 ppm"]
    return [sdimu.simulate(folder / f"day{k}", seed=k, power_on=str(k), effect=effect, **common) for k in (1, 2)]


@pytest.fixture(scope="module")
def opened(bags, tmp_path_factory):
    return sdimu.open_set(bags, site="daejeon", imu="dtg", keep=tmp_path_factory.mktemp("kept"))


@pytest.fixture(scope="module")
def fit(opened):
    return sdimu.calibrate(opened)


@pytest.fixture(scope="module")
def found(fit):
    return sdimu.diagnose(fit)


def test_a_set_is_listed_with_its_unit_and_power_ons(opened):
    assert repr(opened).splitlines() == ["2 recordings of SN3", "  day1: power-on 1", "  day2: power-on 2"]
    assert "<li>day2: power-on 2</li>" in opened._repr_html_()


def test_a_set_file_is_the_same_set(bags, opened):
    path = bags[0].parent / "set.json"
    write_json(path, {"format": "sdimu-set/1", "recordings": [{"bag": bag.name, "name": bag.name} for bag in bags]})
    assert [m.name for m in sdimu.open_set(path).members] == [m.name for m in opened.members]


def test_a_joint_fit_is_a_table_with_units(fit):
    assert repr(fit).lstrip().startswith("2 recordings together")
    assert "<table>" in fit._repr_html_()
    k = fit.names.index("accel_bias_x")
    assert fit["accel_bias_x"].sigma == pytest.approx(float(np.sqrt(fit.covariance[k, k])))
    assert str(fit["accel_bias_x"]).endswith("ug")
    assert {t.effect for t in fit.of_set.turn_on} == {"gyro_bias", "accel_bias"}
    assert fit.result.origin.serial == "SN3"


def test_a_diagnosis_of_a_set_says_what_is_known_and_what_to_record(found):
    assert found.verdict == "class of effects"
    assert {"gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"} <= set(found.known.open[0])
    assert "turn Y" in " ".join(found.advice)
    assert f"{found.verdict}: {found.sentence}" in repr(found)
    assert "<li>" in found._repr_html_()
    assert found.best is found.found[0]
    family = {share.family: share.probability for share in found.probabilities.families}
    assert 0.9 < max(family.values()) <= found.best.probability
    plan = sdimu.plan("kim18_signed", tries=2, after=found.known)
    assert plan.minutes <= 49.7 + 1e-6


def test_files_are_those_of_the_verbs(fit, found, tmp_path):
    assert {p.name for p in fit.save(tmp_path / "cal").iterdir()} == {"result.json", "report.html"}
    assert {p.name for p in found.save(tmp_path / "dia").iterdir()} == {"diagnosis.json", "result.json", "report.html"}
    np.testing.assert_array_equal(read_result(tmp_path / "cal").values, fit.values)
    content = json.loads((tmp_path / "dia" / "diagnosis.json").read_text())
    assert (content["format"], content["verdict"]) == ("sdimu-diagnosis/1", found.verdict)
    # Keys that programs read are those of one recording.
    (first, *_), best = content["candidates"], found.best
    assert (first["effect"], first["label"]) == (best.family, best.label)
    assert first["parameters"][0]["value"] == best.value
    assert first["indistinguishable_from"] == list(best.alike)
    assert first["delta_log_likelihood"] == pytest.approx(0.5 * best.z**2)
    assert max(content["p_value"], first["p_value_adjusted"]) < 1e-6
    assert not content["adequate"]
    assert not content["unexplained"]["is"]
    # The stops of both recordings, the worst first; page and Python draw the same.
    sizes = [abs(one["normalised_mean"]) for one in content["where"]]
    assert sizes == sorted(sizes, reverse=True)
    assert {one["recording"] for one in content["where"]} == {"day1", "day2"}
    assert sizes[0] > 5.0 > max(abs(one["normalised_mean_after"]) for one in content["where"])
    (drawn,) = found.plot_heat_map().data
    assert np.nanmax(np.abs(drawn.z)) == pytest.approx(sizes[0])
    page = (tmp_path / "dia" / "report.html").read_text()
    assert "Where it fails: sensor by stop" in page
    assert 'data-show="1"' in page
    # A fleet reads from a set what it reads from a diagnosis of one recording.
    given = gather([tmp_path / "dia"]).given
    assert [entry.unit for entry in given] == ["SN3"]
    of_fleet = candidates(given)
    k = of_fleet.names.index("gyro_scale_asymmetry_y")
    assert of_fleet.estimates[0, k] == pytest.approx(to_si(40.0, "ppm"), abs=5.0 * of_fleet.sigmas[0, k])


def test_what_cannot_be_used_is_one_line(fit, opened, tmp_path):
    with pytest.raises(DataError, match="no such bag"):
        sdimu.open_set([tmp_path / "nothing"])
    with pytest.raises(DataError, match="one recording"):
        sdimu.diagnose(fit, refits=True)
    one = replace(opened, core=replace(opened.core, members=opened.members[:1]))
    with pytest.raises(DataError, match=r"a set of one recording: open it with open\(bag, ...\)"):
        sdimu.diagnose(JointFit(one, fit.options, fit.core))
    with pytest.raises(DataError, match=r"open_set"):
        sdimu.calibrate([opened])
