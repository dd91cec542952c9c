"""On the way the sigmas of the filter hold in the noise that an IMU file states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.data.axes_and_units import Stated
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, LiveCalibration
from sdimu_calibration.core.live_model import NO_AZIMUTH, SQUARES
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.files.config import load_imu, load_plan
from sdimu_sim.core.mean_bias import mean_bias
from sdimu_sim.core.scenario import Scenario, generate, imu_truth
from sdimu_sim.core.true_coefficients import true_coefficients

START = 1_700_000_000 * NS
SITE = Site(latitude_rad=np.radians(36.4), height_m=0.0)
SEEDS = (1, 2)


def wandering(name, times=1.0):
    """IMU file whose bias instability is a multiple of what it is."""
    imu = load_imu(name)
    return replace(
        imu,
        gyro_bias_instability=times * imu.gyro_bias_instability,
        accel_bias_instability=times * imu.accel_bias_instability,
    )


def in_flicker(imu, seed):
    """Give the scenario of an IMU in flicker of its own bias instability: the turns of kim18 in ten minutes."""
    gyro, accel = from_si(imu.gyro_bias_instability, "deg/h"), from_si(imu.accel_bias_instability, "ug")
    noise = (f"gyro_noise_flicker={gyro:.5g} deg/h", f"accel_noise_flicker={accel:.5g} ug")
    plan = load_plan("kim18")
    turns = tuple(replace(turn, rate_rad_s=np.radians(10.0)) for turn in plan.turns)
    short = replace(plan, turns=turns, dwell_s=(20.0,) * len(plan.dwell_s), acceleration_rad_s2=np.radians(5.0))
    return Scenario(short, imu, SITE, rate_hz=20.0, seed=seed, noise=noise)


def last_on_the_way(scenario, model):
    """Last estimate of the filter on the way, error over sigma of its free coefficients by name, and the notes."""
    recording, _ = generate(scenario)
    live = LiveCalibration(OpeningOptions(scenario.imu, SITE, stated=Stated(1.0, 1.0, 1, 1)), model)
    notes = list(live.notes)
    log = recording.phase
    for t, dwell, stop in zip(log.t, log.dwell, log.stop, strict=True):
        live.add_phase(START + round(t * 1e9), bool(dwell), int(stop))
    ns = START + np.rint(recording.t * 1e9).astype(np.int64)
    live.add_samples(ns, recording.omega_ib_b, recording.f_ib_b)
    last = live.advance(int(ns[-1]))[-1]
    sensor = imu_truth(scenario)
    means = mean_bias(sensor, recording.t, log, recording.interval_s, scenario.seed)
    truth = true_coefficients(replace(sensor, coefficients={**sensor.coefficients, **means}), last.body_frame)
    error = last.coefficients - np.array([truth.get(name, 0.0) for name in last.names])
    sigma = np.sqrt(np.diag(last.covariance))
    return last, {n: e / s for n, e, s in zip(last.names, error, sigma, strict=True) if s > 0.0}, notes


def rms(z):
    return float(np.sqrt(np.mean(np.square(list(z)))))


def test_sigmas_on_the_way_hold_in_the_flicker_that_the_imu_file_states(model):
    imu = wandering("rlg_navigation", times=10.0)
    found = [last_on_the_way(in_flicker(imu, seed), model)[1] for seed in SEEDS]
    # 54 coefficients that share some errors: by chance within a third of one. A filter in white noise has over two.
    assert 0.65 < rms(z for one in found for z in one.values()) < 1.35


def test_an_azimuth_that_stated_noise_hides_is_told_and_left_open(model):
    imu = load_imu("mems_industrial")
    last, z, notes = last_on_the_way(in_flicker(imu, SEEDS[0]), model)
    assert notes == [NO_AZIMUTH, SQUARES]
    assert np.sqrt(last.navigation_covariance[8, 8]) > 0.3
    # What is left are squares of the errors, as the note says; with an azimuth, in white noise, it was over five.
    assert rms(z.values()) < 2.5
    azimuth = replace(SITE, initial_azimuth_rad=0.5, initial_azimuth_sigma_rad=0.01)
    assert LiveCalibration(OpeningOptions(imu, azimuth), model).notes == [SQUARES]


def test_an_imu_file_without_noise_of_a_memory_has_no_states_of_it(model, imu):
    assert len(LiveCalibration(OpeningOptions(imu, SITE), model).setup.sensors.names) == 30
