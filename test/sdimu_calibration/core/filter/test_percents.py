"""With errors of percents the filter iterates until it agrees with the batch; both are honest."""

from dataclasses import replace

import numpy as np
import pytest
from imus import PERCENTS
from scipy.stats import chi2

from sdimu_calibration.core.alignment.prepared import reduce, set_up
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.accelerometer_frame import accelerometer_frame_model, model_in_frame
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.navigation.correct_cycles import correct_cycles, spread
from sdimu_calibration.core.navigation.track import Correction, motion
from sdimu_calibration.storage.files.config import load_imu, load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import in_body_frame

KIM18 = load_plan("kim18")


def normalised(found, truth):
    """Errors in sigma, and the normalised square of them all."""
    true = in_body_frame(truth.imu.coefficients, found.body_frame)
    k = np.flatnonzero(np.diag(found.covariance))
    error = np.array([found.values[i] - true[found.names[i]] for i in k])
    P = found.covariance[np.ix_(k, k)]
    s = np.sqrt(np.diag(P))
    return error / s, float((error / s) @ np.linalg.solve(P / np.outer(s, s), error / s))


def agreement(filtered, batch):
    """Differences in sigma of the batch."""
    k = np.flatnonzero(np.diag(batch.covariance))
    return (filtered.values - batch.values)[k] / np.sqrt(np.diag(batch.covariance))[k]


def test_the_filter_agrees_with_the_batch(model, site):
    recording, truth = generate(Scenario(KIM18, PERCENTS, site, seed=201, rate_hz=20.0))
    filtered = calibrate(recording, site, PERCENTS, model, held_out=False)
    batch = calibrate(recording, site, PERCENTS, model, estimator="batch")
    # Two computations on the same samples; the filter's epochs of a second and the batch's means of twenty share the
    # noise, not its rounding into weights.
    assert np.sqrt(np.mean(agreement(filtered, batch) ** 2)) < 0.3
    z, nees = normalised(filtered, truth)
    assert chi2.ppf(5e-4, len(z)) < nees < chi2.ppf(1.0 - 5e-4, len(z))


@pytest.mark.slow
def test_fifty_fresh_seeds_converge_and_agree(model, site):
    z, differences, lost = [], [], []
    for seed in range(101, 151):
        recording, truth = generate(Scenario(KIM18, PERCENTS, site, seed=seed, rate_hz=50.0))
        filtered = calibrate(recording, site, PERCENTS, model, held_out=False)
        batch = calibrate(recording, site, PERCENTS, model, estimator="batch")
        z.append([normalised(one, truth)[0] for one in (filtered, batch)])
        differences.append(agreement(filtered, batch))
        lost += [seed] if any("did not converge" in note for note in filtered.notes) else []
    rms = np.sqrt(np.mean(np.square(z), axis=(0, 2)))
    assert (rms > 0.85).all()
    assert (rms < 1.15).all()
    assert np.sqrt(np.mean(np.square(differences))) < 0.3
    assert not lost


def test_errors_are_undone_exactly(imu, model, site):
    perfect = replace(imu, gyro_white_noise=0.0, accel_white_noise=0.0)
    recording, truth = generate(Scenario(KIM18, perfect, site, seed=7, rate_hz=20.0, coefficients={}))
    bent, bent_truth = generate(
        Scenario(
            KIM18,
            replace(PERCENTS, gyro_white_noise=0.0, accel_white_noise=0.0),
            site,
            seed=7,
            rate_hz=20.0,
            mount_rad=truth.imu.mount_rad,
        )
    )
    setup = set_up(site, PERCENTS, model)
    true, measured = reduce(recording, setup).cycles, reduce(bent, setup).cycles
    n = min(len(true), len(measured))
    true, measured = true[:n], measured[:n]
    linear = in_body_frame(bent_truth.imu.coefficients, "prior")
    c = np.array([linear[name] for name in setup.sensors.names])
    near = motion(measured, np.zeros(n, dtype=bool), Correction(setup.sensors, c), np.eye(3), setup.around(None), False)
    clean = correct_cycles(measured, near, setup.sensors, c).cycles
    np.testing.assert_allclose(clean.t, true.t)
    # Rounding of rates of 0.03 rad/s and forces of 10 m/s^2, times a condition number near one.
    np.testing.assert_allclose(clean.alpha / clean.dt[:, None], true.alpha / true.dt[:, None], atol=1e-12)
    np.testing.assert_allclose(clean.upsilon / clean.dt[:, None], true.upsilon / true.dt[:, None], atol=1e-11)


def test_regressors_of_corrected_samples_are_derivatives_of_the_correction(model, site):
    recording, _ = generate(Scenario(KIM18, PERCENTS, site, seed=8, rate_hz=20.0))
    setup = set_up(site, PERCENTS, model)
    cycles = reduce(recording, setup).cycles[1000:1020]
    sensors = setup.sensors
    c = 0.5 * sensors.prior

    def go(at):
        near = motion(cycles, np.zeros(20, dtype=bool), Correction(sensors, at), np.eye(3), setup.around(None), False)
        return correct_cycles(cycles, near, sensors, at)

    here = go(c)
    values, channel, parameter = spread(sensors.regressors(here.seen), sensors.channel, sensors.parameter, here.weight)
    for j, size in enumerate(sensors.prior):
        step = np.zeros(len(c))
        step[j] = 1e-3 * size
        ahead, behind = go(c + step).seen, go(c - step).seen
        change = np.hstack([ahead.w - behind.w, ahead.f - behind.f]) / (2e-3 * size)
        sum_of = np.zeros((20, 6))
        for column in np.flatnonzero(parameter == j):
            sum_of[:, channel[column]] -= values[:, column]
        np.testing.assert_allclose(change, sum_of, atol=1e-5 * np.max(np.abs(sum_of)), err_msg=sensors.names[j])


def test_a_model_without_all_misalignments_keeps_its_frame(model):
    some = imu_model.build((*model.effects[:-1], "accel_misalignment_xy"), PERCENTS)
    assert accelerometer_frame_model(some, PERCENTS) is None
    kept = model_in_frame(some, PERCENTS, model.body_frame)
    assert kept.inner is some
    assert not kept.turned


def test_gyros_that_lose_the_attitude_over_the_test_are_levelled_at_every_stop(model, site):
    fog = load_imu("fog_tactical")
    # Seed 5: passes along an attitude that the gyros carry through the test end with a normalised square of 60.
    recording, truth = generate(Scenario(KIM18, fog, site, seed=5, rate_hz=20.0))
    found = calibrate(recording, site, fog, model, held_out=False)
    _, square = normalised(found, truth)
    assert chi2.ppf(5e-4, 27) < square < chi2.ppf(1.0 - 5e-4, 27)
    assert not found.warnings


def test_what_speaks_against_a_result_is_in_it(model, site):
    recording, _ = generate(Scenario(KIM18, PERCENTS, site, seed=201, rate_hz=20.0))
    kept = np.ones(len(recording.t), dtype=bool)
    kept[1000] = False
    gap = replace(recording, t=recording.t[kept], omega_ib_b=recording.omega_ib_b[kept], f_ib_b=recording.f_ib_b[kept])
    found = calibrate(gap, site, PERCENTS, model, held_out=False)
    assert found.faults
    assert found.data["lost"] == 1.0
    quiet = replace(PERCENTS, accel_white_noise=0.2 * PERCENTS.accel_white_noise)
    assert any("does not fit" in text for text in calibrate(recording, site, quiet, model, held_out=False).warnings)
