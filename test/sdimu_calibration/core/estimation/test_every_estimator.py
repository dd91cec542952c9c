"""Whatever can be calibrated can be used: estimators times verbs, and one set of digits for every caller."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from plans import quick_plan

from sdimu_calibration.core.compensation import compensate_recording, compensator
from sdimu_calibration.core.diagnosis.diagnose import climb, diagnose
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.estimation.outcome import calibrate, outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import choose_estimator, extend, solve
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.front_door import open_test as open_read
from sdimu_calibration.core.live import LiveCalibration
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.report.page import Contents, page
from sdimu_calibration.report.report_extras import ReportExtras
from sdimu_calibration.report.workbench.fit import FitSession
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.export import FORMS, export
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.files.diagnosis_file import read_diagnosis, write_diagnosis
from sdimu_calibration.storage.files.effect_file import find_effects
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_sim.bag_file import write_test
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate, simulate_test
from sdimu_study.monte_carlo import STUDY, Campaign
from sdimu_study.worlds import choice

SITE = Site(latitude_rad=float(np.radians(36.4)))
HANDHELD_IMU = "mems_by_hand"


@dataclass(frozen=True)
class Case:
    imu: str
    estimator: str


CASES = (
    Case("dtg", "filter"),
    Case("mems_industrial", "filter"),
    Case(HANDHELD_IMU, "handheld"),
    Case("dtg", "batch"),
    Case("mems_industrial", "batch"),
)
TABLE_IMUS = ("dtg", "rlg_navigation", "fog_tactical", "mems_industrial", "mems_consumer")


def scenario(imu, dwell_s=40.0):
    return Scenario(quick_plan("kim18_signed", dwell_s), load_imu(imu), SITE, rate_hz=20.0, seed=71)


@cache
def recording_of(imu):
    if imu == HANDHELD_IMU:
        return by_hand_recording(ByHand(20, load_imu(imu), SITE, seed=71))[0]
    return generate(scenario(imu))[0]


def model_of(imu):
    return load_model("hand" if imu == HANDHELD_IMU else "baseline")


def test_of(imu):
    return PreparedTest(recording_of(imu), load_imu(imu), None if imu == HANDHELD_IMU else SITE)


test_of.__test__ = False


@cache
def fit_of(case):
    return solve(test_of(case.imu), model_of(case.imu), case.estimator)


@pytest.fixture(params=CASES, ids=lambda case: f"{case.imu} {case.estimator}")
def case(request):
    return request.param


def test_a_result_is_written_read_compensated_and_exported(case, tmp_path):
    result = outcome(fit_of(case))
    write_result(tmp_path / "result.json", result)
    again = read_result(tmp_path)
    assert again.estimator == case.estimator
    assert again.model == result.model
    np.testing.assert_array_equal(again.values, result.values)
    using = compensator(again, load_imu(case.imu))
    done = compensate_recording(using, recording_of(case.imu))
    assert np.isfinite(done.omega_ib_b).all()
    assert np.isfinite(done.f_ib_b).all()
    for form in FORMS:
        path = tmp_path / f"out-{form}.txt"
        assert export(form, path, again, load_imu(case.imu)).files


def test_a_fit_answers_every_question(case):
    fit = fit_of(case)
    effect = find_effects("accel_quadratic_x")
    evidence = fit.evidence(effect)
    assert evidence.candidates[-1].label == "accel_quadratic_x"
    assert np.isfinite(evidence.W).all()
    estimate, _ = evidence.information.estimate(evidence.model, evidence.weight)
    residual = evidence.e - evidence.W[:, evidence.model] @ estimate
    if case.estimator == "handheld":
        assert residual @ residual == pytest.approx(fit.statistics().nis_mean * fit.statistics().nis_dof, rel=0.02)
    else:
        # Whitened residuals of a right model have unit variance.
        assert residual @ residual / len(residual) == pytest.approx(1.0, abs=0.15)
        assert fit.held_out_rms() == pytest.approx(1.0, abs=0.25)
    assert fit.converged
    assert fit.consistency().where
    assert fit.history().value.shape[1] == len(fit.names)
    wider = extend(fit, effect)
    assert wider.names[-1] == "accel_quadratic_x"
    sigma = np.sqrt(wider.covariance[-1, -1])
    assert abs(wider.values[-1]) < 5.0 * sigma


def test_models_that_stay_open_move_and_widen_what_a_fit_states(case):
    fit, name = fit_of(case), "accel_scale_x"
    evidence, k = fit.evidence(), fit.names.index(name)
    count, place = sum(one in fit.names for one in evidence.names), evidence.names.index(name)
    sigma = np.sqrt(fit.covariance[k, k])
    doubt, moved = np.zeros((count, count)), np.zeros(count)
    doubt[place, place], moved[place] = (3.0 * sigma) ** 2, 2.0 * sigma
    over = fit.with_doubt(doubt, moved)
    assert (over.values - fit.values)[k] == pytest.approx(2.0 * sigma, rel=1e-3)
    assert over.covariance[k, k] == pytest.approx(10.0 * sigma**2, rel=1e-3)


def test_a_fit_is_diagnosed_and_shown(case, tmp_path):
    summary = summarise(climb(fit_of(case)))
    write_diagnosis(tmp_path / "diagnosis.json", summary)
    read = read_diagnosis(tmp_path).plain()
    assert read["estimator"] == case.estimator
    assert read["where"]
    text = page(summary.diagnosis.after, Contents("A test", summary=summary, more=ReportExtras()))
    assert "Where it fails" in text
    assert summary.diagnosis.verdict == "consistent", summary.diagnosis.sentence


def test_free_navigation_is_made_or_refused_with_its_reason(case):
    fit = fit_of(case)
    if case.estimator == "handheld":
        with pytest.raises(DataError, match="no known velocity"):
            fit.free_inertial([])
        return
    for run in fit.free_inertial([]):
        nothing, compensated = run.drifts
        assert compensated.distance[-1] < nothing.distance[-1]
        assert np.isfinite(compensated.distance).all()


@pytest.mark.parametrize("imu", TABLE_IMUS)
def test_every_caller_gives_the_same_digits(imu, tmp_path):
    """Calibrate, the base fit of a diagnosis, the workbench, the end of a live test; and a campaign without a bag."""
    model, short = load_model("baseline"), scenario(imu, 20.0)
    write_test(tmp_path / "bag", short, simulate_test(short))
    options = OpeningOptions(load_imu(imu), SITE)
    test = PreparedTest(*open_read(read_recording(tmp_path / "bag"), options))
    recording = test.recording
    once = calibrate(recording, SITE, test.imu, model)
    bench = FitSession(PreparedTest(recording, test.imu, SITE), model).fit(Setting()).calibration
    live = LiveCalibration(options, model)
    ns = recording.start_ns + np.rint(recording.t * 1e9).astype(np.int64)
    live.add_samples(ns, recording.omega_ib_b, recording.f_ib_b)
    log = recording.phase
    for t, dwell, stop in zip(log.t, log.dwell, log.stop, strict=True):
        live.add_phase(recording.start_ns + round(float(t) * 1e9), bool(dwell), int(stop))
    others = [bench, live.finish()]
    # The search behind the base fit is long: once for each estimator.
    if imu in {"dtg", "mems_industrial"}:
        others.append(diagnose(recording, SITE, test.imu, model).before)
    for other in others:
        np.testing.assert_array_equal(other.values, once.values)
        np.testing.assert_array_equal(other.covariance, once.covariance)
    row, simulated = STUDY.of(Campaign(short, model))(71), calibrate(generate(short)[0], SITE, test.imu, model)
    np.testing.assert_array_equal(row["estimate"], simulated.values)


@pytest.mark.parametrize("imu", [*TABLE_IMUS, HANDHELD_IMU])
def test_the_estimator_follows_from_the_file_and_the_plan(imu):
    expected = "handheld" if imu == HANDHELD_IMU else "filter"
    assert choose_estimator(test_of(imu), model_of(imu)).estimator == expected


def test_an_older_name_means_the_same_fit():
    old, new = (solve(test_of("dtg"), model_of("dtg"), name, learn=False) for name in ("second-order", "filter"))
    assert old.estimator == new.estimator == "filter"
    np.testing.assert_array_equal(old.values, new.values)


@pytest.mark.parametrize(("plan", "seed"), [("kim18", 50_001), ("kim18", 50_023), ("recommended", 50_016)])
def test_the_estimator_does_not_hang_on_how_noise_cuts_the_rests(plan, seed):
    """Tests whose rests the detection cut into pieces, so that a wide gyro seemed never to rest for long."""
    assert choice("mems_consumer", plan, seed) == "filter"
