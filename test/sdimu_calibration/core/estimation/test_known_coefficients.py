"""Navigation about coefficients that another estimate gives: the attitude is found, however wrong the coarse one is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.effects.imu_model import build
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import fit_about
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.true_coefficients import true_coefficients
from sdimu_sim.core.truth import draw_coefficients
from sdimu_study.worlds import simulate


def test_an_azimuth_that_the_gyro_bias_put_wrong_is_found():
    imu, model = load_imu("dtg"), load_model("baseline")
    plan = load_plan("recommended")
    plan = replace(plan, dwell_s=(30.0,) * len(plan.dwell_s))
    # 2 deg/h in an Earth's rate of 12 deg/h: the coarse azimuth is wrong by ten degrees at most.
    bias = {f"gyro_bias_{axis}": to_si(2.0, "deg/h") for axis in "xyz"}
    scenario = Scenario(
        plan, imu, Site(np.radians(36.4)), rate_hz=10.0, seed=4, coefficients=draw_coefficients(imu, 4) | bias
    )
    sensor = imu_truth(scenario)
    test = PreparedTest(simulate(scenario, sensor), imu, scenario.site)
    truth = true_coefficients(sensor, "accelerometer_triad")
    true = {name: truth.get(name, 0.0) for name in build(model.effects, imu).names}
    fit = fit_about(test, model, true)
    assert fit.statistics().nis_mean < 1.05
    # It stands where it is: a second linearisation moves it by less than its sigma of some arcseconds.
    again = fit_about(test, model, true, fit.start)
    assert np.abs(rotation_vector(again.start.C_nb @ fit.start.C_nb.T)).max() < to_si(1.0, "arcsec")
    assert abs(rotation_vector(fit.start.C_nb @ fit.alignment.C_nb.T)[2]) > to_si(1.0, "deg")
