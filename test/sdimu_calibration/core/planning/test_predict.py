"""Covariance simulation tells before a test what the filter says after it."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.batch.batch import bound_covariance
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.planning.noise_set import NoiseSet, apply
from sdimu_calibration.core.planning.predict import largest_by_effect, predict
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, generate

KIM18 = load_plan("kim18")


def free(prediction):
    """Coefficients that the body frame does not make zero."""
    return prediction.sigma > 1e-6 * prediction.prior


def test_predicted_sigma_is_the_sigma_after_the_test(imu, model, site):
    mount = (0.02, -0.03, 0.01)
    predicted = predict(KIM18, site, imu, model, np.array(mount))
    recording, _ = generate(Scenario(KIM18, imu, site, seed=11, mount_rad=mount))
    after = np.sqrt(np.diag(calibrate(recording, site, imu, model, held_out=False).covariance))
    k = free(predicted)
    # Errors of 150 ppm and arcminutes change a covariance in their own proportion: far below 2 %.
    np.testing.assert_allclose(after[k], predicted.sigma[k], rtol=0.02)


def test_sigma_reaches_the_bound_of_all_data(imu, model, site):
    found = predict(KIM18, site, imu, model, bound=bound_covariance)
    k = free(found)
    # The bound is another algorithm; what differs is second order in Earth rate times the length of a turn, 5e-5 of the
    # responses, against velocities and positions known to 1e-2 of what noise makes of them.
    np.testing.assert_allclose(found.sigma[k], found.bound[k], rtol=2e-3)


def test_sigma_never_rises_and_stands_still_while_the_table_turns(imu, model, site):
    found = predict(KIM18, site, imu, model)
    change = np.diff(found.history, axis=0)
    assert np.all(change <= 1e-9 * found.prior)
    turning = ~found.dwell[:-1] & ~found.dwell[1:]
    assert turning.sum() > 100
    assert np.all(change[turning] == 0.0)


def test_gyro_scale_is_seen_only_after_a_turn_about_its_axis(imu, model, site):
    # Fig. 3.1: a coefficient keeps its first sigma until the stop that makes it observable. First turns: Y, then Z, X.
    found = predict(KIM18, site, imu, model)
    first_turned = {"y": 100.0, "z": 580.0, "x": 1015.0}
    for axis, start in first_turned.items():
        k = found.names.index(f"gyro_scale_{axis}")
        before = found.history[found.t <= start, k]
        assert np.all(before > 0.9 * found.prior[k]), axis
        assert found.history[-1, k] < 0.1 * found.prior[k], axis


@pytest.mark.parametrize("latitude_deg", [-80.0, -45.0, 0.0, 45.0, 80.0])
@pytest.mark.parametrize("height_m", [0.0, 5000.0])
def test_every_site_but_the_poles_reaches_the_figures_of_the_paper_by_far(imu, model, latitude_deg, height_m, site):
    found = predict(KIM18, replace(site, latitude_rad=np.radians(latitude_deg), height_m=height_m), imu, model)
    limits = {
        "gyro_bias": "0.003 deg/h",
        "gyro_scale": "1.0 ppm",
        "gyro_misalignment": "0.01 arcmin",
        "gyro_mass_unbalance": "0.0045 deg/h/g",
        "accel_bias": "0.45 ug",
        "accel_scale": "0.5 ppm",
        "accel_misalignment": "0.008 arcmin",
    }
    largest = largest_by_effect(found)
    for effect, text in limits.items():
        value, unit = text.split()
        assert largest[effect] <= to_si(float(value), unit), effect


@pytest.mark.parametrize("mount_deg", [1.0, 3.0, 5.0])
def test_mount_moves_no_sigma_by_a_tenth(imu, model, site, mount_deg):
    straight = predict(KIM18, site, imu, model)
    turned = predict(KIM18, site, imu, model, np.radians([mount_deg] * 3))
    k = free(straight)
    assert np.max(np.abs(turned.sigma[k] / straight.sigma[k] - 1.0)) < 0.10


def test_measurement_noise_below_the_process_noise_is_refused(imu, model):
    noise = NoiseSet("odd", 1e-6, 1e-3, 5e-7, 1e-2, 1e-3, 1e-2, "every_epoch", False, 1e-3, 2e-2)
    with pytest.raises(DataError, match="rate_sigma"):
        apply(noise, imu, model)


def test_a_plan_of_short_stops_is_no_recording_of_stuck_sensors(imu, model, site):
    # A perfect IMU shows one number all through a stop; where most of the time is turning that looks like a fault.
    found = predict(replace(KIM18, dwell_s=(20.0,) * 19), site, imu, model)
    assert found.duration_s == pytest.approx(KIM18.duration_s - 19 * 80.0, abs=1.0)
    assert np.all(np.isfinite(found.sigma))
