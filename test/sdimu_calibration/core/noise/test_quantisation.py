"""Pulses are recognised in the rests, and an estimate knows what they do to means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.noise import with_measured_noise
from sdimu_calibration.core.noise.quantisation import with_quantisation
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_study.score import baseline_z
from sdimu_study.worlds import simulate

DT = 0.01
PULSE = to_si(3.0, "arcsec")
IMU = load_imu("rlg_navigation")


def at_rest(pulse: float, times: float = 1.0, seconds: float = 400.0, seed: int = 1) -> Recording:
    """An IMU at rest with white noise, `times` that of the specification, whose gyros count pulses."""
    rng = np.random.default_rng(seed)
    n = round(seconds / DT)
    rate = np.array([5e-5, 3e-5, -4e-5]) + times * IMU.gyro_white_noise / np.sqrt(DT) * rng.standard_normal((n, 3))
    if pulse:
        angle = np.cumsum(rate, axis=0) * DT
        rate = np.diff(pulse * np.round(angle / pulse), axis=0, prepend=0.0) / DT
    force = IMU.accel_white_noise / np.sqrt(DT) * rng.standard_normal((n, 3)) + np.array([0.0, 0.0, -9.8])
    return Recording(0, np.arange(1, n + 1) * DT, rate, force)


def test_pulses_are_recognised():
    imu, note = with_quantisation(IMU, at_rest(PULSE))
    assert imu.gyro_quantisation == pytest.approx(PULSE / np.sqrt(12.0), rel=0.1)
    assert imu.accel_quantisation == 0.0
    assert "quantisation or vibration of gyro" in note


@pytest.mark.parametrize("times", [1.0, 3.0])
@pytest.mark.parametrize("seed", range(5))
def test_white_noise_is_no_quantisation_even_where_the_specification_is_wrong(times, seed):
    assert with_quantisation(IMU, at_rest(0.0, times, seed=seed)) == (IMU, "")


def test_what_the_file_states_stands():
    stated = replace(IMU, gyro_quantisation=1e-6)
    assert with_quantisation(stated, at_rest(PULSE))[0] is stated


def counted_force(recording: Recording, pulse: float) -> Recording:
    """The same at an attitude where every accelerometer feels a force, and counts pulses (m/s)."""
    velocity = np.cumsum(recording.f_ib_b + np.array([0.3137, -0.2213, 0.0069]), axis=0) * DT
    return replace(recording, f_ib_b=np.diff(pulse * np.round(velocity / pulse), axis=0, prepend=0.0) / DT)


@pytest.mark.parametrize("stated", ["gyro_quantisation", "accel_quantisation"])
def test_a_triad_of_which_the_file_says_nothing_is_read_in_the_rests(stated):
    """The other one's stays as the file has it, and the epochs follow the one that needs the longer ones."""
    # So small that white noise carries the velocity over a pulse in a second: residues are then independent.
    pulse = 2e-4
    true = {"gyro_quantisation": PULSE / np.sqrt(12.0), "accel_quantisation": pulse / np.sqrt(12.0)}
    (other,) = set(true) - {stated}
    file = replace(IMU, **{stated: true[stated]})
    imu, note = with_quantisation(file, counted_force(at_rest(PULSE), pulse))
    assert getattr(imu, stated) == true[stated]
    assert getattr(imu, other) == pytest.approx(true[other], rel=0.1)
    assert ("gyro" in note, "accelerometer" in note) == (other[0] == "g", other[0] == "a")
    assert imu.epoch_s >= file.epoch_s
    # A triad that keeps nothing has white noise in epochs of any length.
    assert getattr(file.in_means_over(10.0), other.replace("quantisation", "white_noise")) == getattr(
        IMU, other.replace("quantisation", "white_noise")
    )


def test_a_triad_that_does_not_count_stays_white_beside_one_that_is_stated():
    stated = replace(IMU, gyro_quantisation=PULSE / np.sqrt(12.0))
    assert with_quantisation(stated, at_rest(PULSE)) == (stated, "")
    assert stated.epoch_s > 1.0


def test_measured_noise_parts_pulses_from_white_noise():
    found = with_measured_noise(load_imu("dtg"), at_rest(PULSE))[0]
    assert found.gyro_quantisation == pytest.approx(PULSE / np.sqrt(12.0), rel=0.1)
    # What is left of a variance that pulses double and more is known to a few tens of percent.
    assert found.gyro_white_noise == pytest.approx(IMU.gyro_white_noise, rel=0.4)


def test_a_mean_over_an_epoch_has_the_variance_of_both():
    """Against the definition: the residue at both ends of the mean, and white noise in between."""
    imu = replace(IMU, gyro_quantisation=PULSE)
    T = imu.epoch_s
    assert T == 10.0
    variance = imu.in_means_over(T).gyro_white_noise ** 2 / T
    assert variance == pytest.approx(IMU.gyro_white_noise**2 / T + 2.0 * (PULSE / T) ** 2)
    assert IMU.epoch_s == 1.0


def counted(site, seed, dwell_s=100.0, effects=(), imu=IMU):
    """A test of a ring laser gyro that counts, and its sensor."""
    plan = load_plan("kim18")
    plan = replace(plan, dwell_s=(dwell_s,) * len(plan.dwell_s))
    extras = {"gyro_step_rad": PULSE, "accel_step_m_s": 1e-3}
    scenario = Scenario(plan, IMU, site, rate_hz=50.0, seed=seed, extras=extras, effects=effects)
    sensor = imu_truth(scenario)
    return PreparedTest(*open_test(simulate(scenario, sensor), OpeningOptions(imu, site))), sensor


def test_what_a_counter_hides_is_found(site):
    found = climb(solve(counted(site, 4, effects=("accel_quadratic_x=60 ug/g^2",))[0], load_model("baseline")))
    assert [c.label for c in found.chosen] == ["accel_quadratic_x"], found.sentence


def test_stops_shorter_than_an_epoch_have_the_variance_of_their_own_length(site):
    test, _ = counted(site, 1, dwell_s=6.0)
    fit = solve(test, load_model("baseline"))
    used = fit.prepared.phases.used
    length = (fit.prepared.epochs.end - fit.prepared.epochs.start)[used]
    # A second of six is for settling, and stamps cut the dwells of some stops by another one.
    assert 4.0 <= np.median(length) <= 5.0
    expected = test.imu.in_means_over(float(np.median(length))).gyro_white_noise
    assert fit.setup.imu.gyro_white_noise == pytest.approx(expected, rel=0.12)


def test_a_file_that_states_the_pulses_of_the_gyros_alone_is_as_good(site):
    """The accelerometers' are in the rests; as much is found as with a file that states neither."""
    told = replace(IMU, gyro_quantisation=PULSE / np.sqrt(12.0))
    test, sensor = counted(site, 1, imu=told)
    assert test.imu.accel_quantisation == pytest.approx(1e-3 / np.sqrt(12.0), rel=0.1)
    found = outcome(solve(test, load_model("baseline")))
    assert not found.not_to_be_trusted
    assert 0.5 < np.sqrt(np.mean(np.square(baseline_z(found, sensor)))) < 1.0 + 3.0 / np.sqrt(2.0 * 27.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_ring_laser_gyro_that_counts_is_calibrated(site, seed):
    """Means over a second scatter eight times more than the file says: every dwell would count as motion."""
    test, sensor = counted(site, seed)
    found = climb(solve(test, load_model("baseline")))
    assert found.verdict == "consistent", found.sentence
    z = baseline_z(found.after, sensor)
    # 27 coefficients of one IMU scatter by a seventh; their sigmas are too large where residues of a stop cancel: with
    # 2 Q^2 / 10 s four times N^2, and a fifth of that over a dwell, by up to two.
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.0 + 3.0 / np.sqrt(2.0 * 27.0)
