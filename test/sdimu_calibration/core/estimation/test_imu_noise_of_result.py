"""A result keeps the noise with which its samples were weighed."""

from __future__ import annotations

from dataclasses import replace

from sdimu_calibration.core.estimation.outcome import outcome


def test_a_result_has_the_noise_of_the_test_without_its_priors(bench):
    fit = bench.fit()
    noisier = replace(fit, test=replace(fit.test, imu=fit.test.imu.with_noise_times(3.0, 2.0)))
    kept = outcome(noisier, held_out=False).imu_noise
    assert kept.gyro_white_noise == 3.0 * fit.test.imu.gyro_white_noise
    assert kept.accel_white_noise == 2.0 * fit.test.imu.accel_white_noise
    assert not kept.prior
