"""The batch and the filter are different algorithms and give the same numbers; both are honest."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from imus import PERCENTS
from scipy.stats import chi2

from sdimu_calibration.core.alignment.prepared import reduce, set_up
from sdimu_calibration.core.batch.batch import _begin
from sdimu_calibration.core.batch.preintegration import preintegrate
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.error_slope import error_slope
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.navigation.track import Correction, motion
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.planning.predict import prepare
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix, rotation_vector
from sdimu_calibration.storage.files.config import load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import in_body_frame

KIM18 = load_plan("kim18")
SHORT = Plan(
    "kim18 in a hurry",
    (20.0,) * 19,
    tuple(replace(turn, rate_rad_s=np.radians(9.0)) for turn in KIM18.turns),
    np.radians(9.0),
)
"""The same orientations in ten minutes."""


def nees(found, truth):
    """Normalised squared error and its degrees of freedom, in the reported frame."""
    true = in_body_frame(truth.imu.coefficients, found.body_frame)
    sigma = np.sqrt(np.diag(found.covariance))
    k = np.array([i for i, name in enumerate(found.names) if name not in PINNED])
    z = np.array([found.values[i] - true[found.names[i]] for i in k]) / sigma[k]
    correlation = found.covariance[np.ix_(k, k)] / np.outer(sigma[k], sigma[k])
    return float(z @ np.linalg.solve(correlation, z)), len(k)


@pytest.fixture(scope="module")
def hurried(imu, model, site):
    """Result of the batch from a short test, and the truth, of each seed once."""

    @cache
    def of(seed):
        recording, truth = generate(Scenario(SHORT, imu, site, seed=seed, rate_hz=20.0))
        return calibrate(recording, site, imu, model, estimator="batch", held_out=False), truth

    return of


PINNED = ("accel_misalignment_xy", "accel_misalignment_xz", "accel_misalignment_yx")


def test_batch_and_filter_agree_in_covariance_and_in_estimate(imu, model, site):
    recording, _ = generate(Scenario(KIM18, imu, site, seed=2, rate_hz=20.0))
    filtered = calibrate(recording, site, imu, model, held_out=False)
    batch = calibrate(recording, site, imu, model, estimator="batch", held_out=False)
    k = [i for i, name in enumerate(batch.names) if name not in PINNED]
    sigma = np.sqrt(np.diag(batch.covariance))[k]
    np.testing.assert_allclose(np.sqrt(np.diag(filtered.covariance))[k], sigma, rtol=0.03)
    # Both see the same samples, so their difference is that of two computations, not of two draws.
    assert np.max(np.abs(filtered.values - batch.values)[k] / sigma) < 0.1


def test_errors_of_the_batch_are_as_large_as_it_says(hurried):
    total, dof = 0.0, 0
    for seed in range(1, 5):
        value, n = nees(*hurried(seed))
        total, dof = total + value, dof + n
    assert chi2.ppf(5e-4, dof) < total < chi2.ppf(1.0 - 5e-4, dof)


def test_misfit_of_the_batch_is_that_of_the_noise(hurried):
    total, dof = 0.0, 0.0
    for seed in range(1, 5):
        fit = hurried(seed)[0].fit
        total, dof = total + fit["nis_mean"] * fit["nis_dof"], dof + fit["nis_dof"]
    # The simulated table stands perfectly still: six of the rows of a stop have less noise than the model says.
    assert chi2.ppf(5e-4, dof * 0.8) < total < chi2.ppf(1.0 - 5e-4, dof)


def test_errors_of_percents_are_found_with_honest_sigmas(model, site):
    total, dof = 0.0, 0
    for seed in (1, 2):
        recording, truth = generate(Scenario(SHORT, PERCENTS, site, seed=seed, rate_hz=20.0))
        found = calibrate(recording, site, PERCENTS, model, estimator="batch", held_out=False)
        value, n = nees(found, truth)
        total, dof = total + value, dof + n
    assert chi2.ppf(5e-4, dof) < total < chi2.ppf(1.0 - 5e-4, dof)


def test_a_wrong_azimuth_at_the_start_changes_nothing_at_the_end(imu, model, site, hurried):
    recording, _ = generate(Scenario(SHORT, imu, site, seed=5, rate_hz=20.0))
    right, _ = hurried(5)
    k = [i for i, name in enumerate(right.names) if name not in PINNED]
    for azimuth_deg in (90.0, 180.0):
        told = replace(site, initial_azimuth_rad=np.radians(azimuth_deg), initial_azimuth_sigma_rad=np.radians(104.0))
        found = calibrate(recording, told, imu, model, estimator="batch", held_out=False)
        off = np.abs(found.values - right.values)[k] / np.sqrt(np.diag(right.covariance))[k]
        assert np.max(off) < 0.02, azimuth_deg


@pytest.mark.parametrize("latitude_deg", [80.0, -80.0, 90.0, -90.0])
def test_coefficients_are_honest_near_and_at_the_poles(imu, model, site, latitude_deg):
    there = replace(site, latitude_rad=np.radians(latitude_deg), height_m=5000.0)
    total, dof = 0.0, 0
    for seed in (1, 2):
        recording, truth = generate(Scenario(SHORT, imu, there, seed=seed, rate_hz=20.0))
        value, n = nees(calibrate(recording, there, imu, model, estimator="batch", held_out=False), truth)
        total, dof = total + value, dof + n
    assert chi2.ppf(5e-4, dof) < total < chi2.ppf(1.0 - 5e-4, dof)


@pytest.mark.parametrize("latitude_deg", [90.0, -90.0])
def test_the_filter_is_honest_at_the_poles(imu, model, site, latitude_deg):
    # A cosine of latitude without its limit made Zp of the east read zero there, and the filter diverge.
    there = replace(site, latitude_rad=np.radians(latitude_deg))
    recording, truth = generate(Scenario(SHORT, imu, there, seed=2, rate_hz=20.0))
    value, dof = nees(calibrate(recording, there, imu, model, held_out=False), truth)
    assert chi2.ppf(5e-4, dof) < value < chi2.ppf(1.0 - 5e-4, dof)


def test_an_effect_that_changes_at_random_is_refused(imu, model, site):
    bias = registry.get("gyro_bias")
    renamed = tuple(replace(p, name=f"wandering_{p.name}") for p in bias.parameters)
    drifting = replace(bias, name="wandering_bias", parameters=renamed, decay_s=1000.0)
    recording, _ = generate(Scenario(SHORT, imu, site, seed=5, rate_hz=20.0))
    with pytest.raises(DataError, match="changes at random"):
        calibrate(recording, site, imu, replace(model, effects=(*model.effects, drifting)), estimator="batch")


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_responses_of_a_motion_are_its_derivatives(imu, model, site, share):
    coefficients = np.array(list(PERCENTS.prior.values())).repeat([3, 3, 6, 6, 3, 3, 6]) * share
    recording, _ = generate(Scenario(SHORT, imu, site, seed=6, rate_hz=50.0))
    setup = set_up(site, imu, model)
    prepared = reduce(recording, setup)
    C_nb = rotation_matrix(np.array([0.7, -1.1, 1.9]))
    rows = slice(200, 350)
    at_rest = np.zeros(len(prepared.cycles), dtype=bool)

    def go(C: np.ndarray, c: np.ndarray):
        seen = motion(prepared.cycles, at_rest, Correction(setup.sensors, c), C_nb.copy(), setup.around(None), True)
        return preintegrate(prepared, rows, setup, seen, setup.sensors.regressors(seen), c, C)

    def difference(ahead, behind) -> np.ndarray:
        return np.concatenate([rotation_vector(ahead.C_nb @ behind.C_nb.T), ahead.moved - behind.moved])

    here = go(C_nb, coefficients)
    scale = np.repeat([1.0, 9.8 * here.seconds, 9.8 * here.seconds**2], 3)
    for i in range(3):
        turn = rotation_matrix(1e-5 * np.eye(3)[i])
        numerical = difference(go(turn @ C_nb, coefficients), go(turn.T @ C_nb, coefficients)) / 2e-5
        # Left out: second order of Earth rate times the 15 s, and of the time step.
        np.testing.assert_allclose(here.by_attitude[:, i] / scale, numerical / scale, atol=5e-4)
    for j, size in enumerate(setup.sensors.prior):
        step = np.zeros(len(coefficients))
        step[j] = 1e-2 * size
        numerical = difference(go(C_nb, coefficients + step), go(C_nb, coefficients - step)) / (2e-2 * size)
        largest = np.max(np.abs(numerical / scale))
        # Left out besides: what errors of percents do to corrections of percents, 0.02 at most.
        tolerance = (2e-3 + 0.02 * (share > 0)) * largest
        np.testing.assert_allclose(
            here.by_coefficient[:, j] / scale, numerical / scale, atol=tolerance, err_msg=setup.sensors.names[j]
        )


def test_it_begins_at_the_attitude_of_every_stop(imu, model, site):
    mount = np.array([0.7, -1.1, 1.9])
    nominal = prepare(SHORT, site, imu, model, mount, None)
    nothing = np.zeros(len(nominal.setup.sensors.prior))
    point, _ = _begin(nominal.prepared, nominal.setup, nominal.start.C_nb, nothing)
    C_nb = rotation_matrix(mount)
    table = np.eye(3)
    for turn, found in zip((None, *SHORT.turns), point.C_nb, strict=True):
        if turn is not None:
            table = table @ rotation_matrix(turn.angle_rad * np.eye(3)["XYZ".index(turn.axis)])
        # A perfect IMU: what is left is the second order of the angle of a sample.
        assert np.linalg.norm(rotation_vector(found @ (table @ C_nb).T)) < 1e-4


def test_known_biases_do_not_change_where_it_begins(model, site):
    """Biases of a degree a second and of 20 mg, as the coarse alignment finds them, lead and level every stop.

    From biases of zero two of six tests (this IMU and `mems_consumer`, seeds 1 to 3) do not converge.
    """
    sizes = {f"{name}_{axis}": PERCENTS.prior[name] for name in ("gyro_bias", "accel_bias") for axis in "xyz"}
    setup = set_up(site, PERCENTS, model)
    names, begun = setup.sensors.names, []
    for own in ({}, sizes):
        recording, _ = generate(Scenario(SHORT, PERCENTS, site, seed=2, rate_hz=20.0, coefficients=own))
        coefficients = np.array([own.get(name, 0.0) for name in names])
        point, _ = _begin(reduce(recording, setup), setup, rotation_matrix(np.array([0.7, -1.1, 1.9])), coefficients)
        np.testing.assert_array_equal(point.coefficients, coefficients)
        begun.append(point.C_nb)
    # The same draws of noise: what is left is the coning of a bias times the angle of a sample.
    off = [np.linalg.norm(rotation_vector(a @ b.T)) for a, b in zip(*begun, strict=True)]
    assert max(off) < 1e-4


@pytest.mark.parametrize("share", [0.0, 1e-3, 2.0])
def test_the_slope_of_sensor_errors_is_in_proportion_to_the_coefficients(imu, model, site, share):
    recording, _ = generate(Scenario(SHORT, imu, site, seed=6, rate_hz=20.0))
    setup = set_up(site, imu, model)
    prepared = reduce(recording, setup)
    coefficients = np.array(list(PERCENTS.prior.values())).repeat([3, 3, 6, 6, 3, 3, 6])
    moving = np.zeros(len(prepared.cycles), dtype=bool)
    C_nb, nothing = rotation_matrix(np.array([0.7, -1.1, 1.9])), Correction(setup.sensors, 0.0 * coefficients)
    seen = motion(prepared.cycles, moving, nothing, C_nb, setup.around(None), True)
    whole = error_slope(setup.sensors, seen, slice(200, 350), coefficients)
    assert np.abs(whole).max() > 0.01
    part = error_slope(setup.sensors, seen, slice(200, 350), share * coefficients)
    # Rounding of errors of percents over the steps of the derivatives.
    np.testing.assert_allclose(part, share * whole, atol=1e-6)
