"""Turns of 360 deg on a desk, said to be such, give the scale factors of gyros that no other turn shows."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu

RATE_HZ, REST_S, TURN_S, APART_S = 100.0, 5.0, 6.0, 60.0
SCALE, BIAS = np.array([0.013, -0.009, 0.02]), np.radians([0.3, -0.2, 0.1])
IMU = load_imu("mems_by_hand")
MODEL = Model(("gyro_bias", "gyro_scale", "gyro_misalignment", "accel_bias", "accel_scale", "accel_misalignment"))
BACK = np.radians(1.0)


def desk(seed, turned=True):
    """The six sides one after the other, a recording each; on three of them one turn of 360 deg about the vertical."""
    rng = np.random.default_rng(seed)
    t, w, f = [], [], []
    for k in range(6):
        up = np.zeros(3)
        up[k % 3] = 1.0 if k < 3 else -1.0
        up += 0.01 * rng.standard_normal(3)
        up /= np.linalg.norm(up)
        still, moving = np.zeros(int(REST_S * RATE_HZ)), np.linspace(0.0, np.pi, int(TURN_S * RATE_HZ))
        angle = 2.0 * np.pi + BACK * rng.standard_normal()
        profile = np.sin(moving) / np.sum(np.sin(moving)) * angle * RATE_HZ
        rate = np.concatenate([still, profile, still]) if turned and k < 3 else np.concatenate([still, still])
        t.append(k * APART_S + (np.arange(len(rate)) + 1) / RATE_HZ)
        w.append(rate[:, None] * up * (1.0 + SCALE) + BIAS)
        f.append(np.tile(STANDARD_GRAVITY * up, (len(rate), 1)))
    w, f = np.concatenate(w), np.concatenate(f)
    w += IMU.gyro_white_noise * np.sqrt(RATE_HZ) * rng.standard_normal(w.shape)
    f += IMU.accel_white_noise * np.sqrt(RATE_HZ) * rng.standard_normal(f.shape)
    return Recording(0, np.concatenate(t), w, f)


def fitted(recording, sigma):
    return outcome(solve(PreparedTest(recording, IMU, whole_turns=sigma), MODEL, "handheld"))


def scales(found):
    at = [found.names.index(f"gyro_scale_{axis}") for axis in "xyz"]
    return found.values[at], np.sqrt(np.diag(found.covariance))[at]


def test_whole_turns_that_are_stated_give_the_scale_factors_of_the_gyros():
    z = []
    for seed in range(6):
        value, sigma = scales(fitted(desk(seed), BACK))
        # One degree of 360; the Earth's rate, estimated with it, shows or blurs a little of the heading.
        assert (np.abs(np.log(sigma * 360.0)) < np.log(1.3)).all()
        z.append((value - SCALE) / sigma)
    # Eighteen numbers: chance leaves their RMS between these once in two thousand.
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6


def test_what_is_not_stated_is_not_taken_but_told():
    found = fitted(desk(1), 0.0)
    _, sigma = scales(found)
    assert (sigma > 0.9 * IMU.prior["gyro_scale"]).all()
    assert any("3 turns are about the vertical" in note and "--whole-turns" in note for note in found.notes)
    told = fitted(desk(1), BACK)
    assert any("3 turns are whole ones about the vertical, as stated, to 1 deg" in note for note in told.notes)


def test_a_run_without_such_turns_is_refused():
    with pytest.raises(DataError, match="--whole-turns: no turn about the vertical"):
        fitted(desk(1, turned=False), BACK)


def test_evidence_of_a_run_with_whole_turns_is_that_of_its_fit():
    fit = solve(PreparedTest(desk(2), IMU, whole_turns=BACK), MODEL, "handheld")
    evidence = fit.evidence()
    assert evidence.e.shape == evidence.stop.shape == evidence.channel.shape
    # At the optimum hardly anything is left for the coefficients: a tenth of a sigma of one row is none of the hundred.
    q = evidence.coefficients
    gradient = (evidence.W.T @ evidence.e + evidence.weight * evidence.shift)[:q]
    assert np.abs(gradient / np.linalg.norm(evidence.W, axis=0)[:q]).max() < 0.1
