"""The classical calibration is right when IMU axes are table axes, and wrong by the mount when they are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from sdimu_calibration.core.estimation.fit_words import MISFIT
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import in_body_frame
from sdimu_study.classical import calibrate_classically

KIM18, IMU, MODEL = load_plan("kim18"), load_imu("dtg"), load_model("baseline")
SITE = Site(latitude_rad=float(np.radians(36.4)), height_m=80.0)


def test_without_mount_the_errors_are_those_of_the_noise():
    total, dof = 0.0, 0
    for seed in (1, 2, 3):
        recording, truth = generate(Scenario(KIM18, IMU, SITE, seed=seed, mount_rad=(0.0, 0.0, 0.0), rate_hz=50.0))
        found = calibrate_classically(recording, SITE, IMU, MODEL)
        assert found.nis < MISFIT
        true = in_body_frame(truth.imu.coefficients, "prior")
        z = (found.values - np.array([true[n] for n in found.names])) / np.sqrt(np.diag(found.covariance))
        total, dof = total + float(z @ z), dof + len(z)
    # z are correlated; 2.5 times the mean is what uncorrelated ones would reach once in a million, and the reference
    # of a turn is interpolated between angles at 10 Hz, which is not in the sigma.
    assert total / dof < 2.5
    assert total > chi2.ppf(1e-6, dof)


@pytest.mark.parametrize("mount_deg", [1.0, 3.0])
def test_a_mount_passes_for_misalignment_and_scale(mount_deg):
    angle = np.radians(mount_deg)
    perfect = dict.fromkeys((), 0.0)
    scenario = Scenario(KIM18, IMU, SITE, seed=2, mount_rad=(0.0, 0.0, angle), coefficients=perfect, rate_hz=50.0)
    found = calibrate_classically(generate(scenario)[0], SITE, IMU, MODEL)
    value = dict(zip(found.names, found.values, strict=True))
    for triad in ("gyro", "accel"):
        # Turned about z, x and y both see sin(m) of the other and cos(m) of their own.
        assert abs(value[f"{triad}_misalignment_xz"] - np.sin(angle)) < to_si(0.05, "arcmin")
        assert abs(value[f"{triad}_misalignment_yz"] - np.sin(angle)) < to_si(0.05, "arcmin")
        for axis in "xy":
            assert abs(value[f"{triad}_scale_{axis}"] - (np.cos(angle) - 1.0)) < to_si(10, "ppm")
        assert abs(value[f"{triad}_scale_z"]) < to_si(10, "ppm")


def test_turned_into_the_accelerometers_frame_the_mount_is_gone():
    recording, truth = generate(Scenario(KIM18, IMU, SITE, seed=2, mount_rad=(0.05, 0.04, -0.05), rate_hz=50.0))
    found = calibrate_classically(recording, SITE, IMU, MODEL)
    found = found.turned("accelerometer_triad")
    true = in_body_frame(truth.imu.coefficients, "accelerometer_triad")
    for name in ("gyro_scale_x", "accel_scale_y", "gyro_scale_z"):
        assert abs(found.values[found.names.index(name)] - true[name]) < to_si(10, "ppm"), name


def test_angles_that_do_not_explain_the_samples_are_seen():
    # Askew by more degrees, what the model lacks in the axes of the table is more than noise.
    recording, _ = generate(Scenario(KIM18, IMU, SITE, seed=2, mount_rad=(0.1, -0.1, 0.1), rate_hz=20.0))
    found = calibrate_classically(recording, SITE, IMU, MODEL)
    assert found.nis > 2.0


def test_an_encoder_that_counts_to_half_a_turn_is_followed_over_it():
    recording, _ = generate(Scenario(KIM18, IMU, SITE, seed=2, mount_rad=(0.0, 0.0, 0.0), rate_hz=20.0))
    table = recording.table
    wrapped = replace(table, angle=np.remainder(table.angle + np.pi, 2.0 * np.pi) - np.pi)
    assert np.abs(np.diff(wrapped.angle, axis=0)).max() > 6.0
    plain, folded = (calibrate_classically(replace(recording, table=log), SITE, IMU, MODEL) for log in (table, wrapped))
    np.testing.assert_allclose(folded.values, plain.values, rtol=0, atol=1e-9)


def test_missing_table_angles_are_named():
    recording, _ = generate(Scenario(KIM18, IMU, SITE, seed=2, rate_hz=20.0))
    with pytest.raises(DataError, match="/rate_table/joint_states"):
        calibrate_classically(replace(recording, table=None), SITE, IMU, MODEL)


def test_angles_of_a_table_without_gimbals_are_refused():
    recording, _ = generate(Scenario(KIM18, IMU, SITE, seed=2, rate_hz=20.0))
    free = replace(recording.table, names=("x", "y", "z"))
    with pytest.raises(DataError, match="outer, middle, inner"):
        calibrate_classically(replace(recording, table=free), SITE, IMU, MODEL)
