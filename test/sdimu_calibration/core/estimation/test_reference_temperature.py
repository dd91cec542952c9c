"""The temperature from which effects count is a choice: no prediction depends on it, and the result says what it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.compensation import compensate_recording, compensator
from sdimu_calibration.core.effects import imu_model, registry
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import TemperatureLog
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate

SITE = Site(latitude_rad=float(np.radians(36.4)))
FIRST, REFERENCE = 25.0, 5.0
"""deg C: a reference outside the range of the recording, so that the biases move by many sigmas."""
BIASES = ("gyro_bias", "accel_bias", "gyro_bias_temperature", "accel_bias_temperature")


def open_minded(imu):
    """The IMU with priors of the biases that say nothing: they are about zero, whatever the reference."""
    wide = {name: 100.0 * imu_model.prior_size(registry.get(name), imu) for name in BIASES}
    return replace(imu, prior={**imu.prior, **wide})


def warmed(recording):
    """The recording with a temperature that rises from `FIRST`."""
    t = np.arange(0.0, recording.t[-1], 5.0)
    return replace(recording, temperature=TemperatureLog(t, FIRST + 8.0 * -np.expm1(-t / 400.0)))


def table_test(imu):
    plan = load_plan("kim18_signed")
    short = replace(plan, dwell_s=(40.0,) * len(plan.dwell_s))
    return warmed(generate(Scenario(short, imu, SITE, rate_hz=20.0, seed=71))[0]), SITE, load_model("baseline")


def hand_run(imu):
    return warmed(by_hand_recording(ByHand(20, imu, SITE, seed=71))[0]), None, load_model("hand")


@pytest.mark.parametrize(
    ("imu", "made", "estimator"),
    [("dtg", table_test, "filter"), ("mems_industrial", table_test, "filter"), ("mems_by_hand", hand_run, "handheld")],
)
def test_another_reference_moves_the_biases_by_the_coefficient_and_no_prediction(imu, made, estimator):
    recording, site, model = made(load_imu(imu))
    imu = open_minded(load_imu(imu))
    model = replace(model, effects=(*model.effects, *BIASES[2:]))
    other = replace(recording, temperature=replace(recording.temperature, reference_degc=REFERENCE))
    before, after = (
        outcome(solve(PreparedTest(r, imu, site), model, estimator), held_out=False) for r in (recording, other)
    )
    assert before.data["start_temperature_degc"] == FIRST
    assert after.data["start_temperature_degc"] == REFERENCE

    sigma = np.sqrt(np.diag(before.covariance))
    of = {name: i for i, name in enumerate(before.names)}
    for triad in ("gyro", "accel"):
        for axis in "xyz":
            bias, k = of[f"{triad}_bias_{axis}"], of[f"{triad}_bias_temperature_{axis}"]
            moved = before.values[k] * (REFERENCE - FIRST)
            # What the end of the iterations leaves.
            assert abs(after.values[k] - before.values[k]) < 0.01 * sigma[k]
            assert abs(after.values[bias] - before.values[bias] - moved) < 0.01 * sigma[bias] + 0.01 * abs(moved)
    kept = [i for name, i in of.items() if "_bias_" not in name and sigma[i] > 0.0]
    assert np.all(np.abs(after.values - before.values)[kept] < 0.01 * sigma[kept])

    used = [compensate_recording(compensator(r, imu, has_temperature=True), recording) for r in (before, after)]
    for field, size in (("omega_ib_b", "gyro_bias_x"), ("f_ib_b", "accel_bias_x")):
        difference = getattr(used[1], field) - getattr(used[0], field)
        assert np.abs(difference).max() < 0.02 * sigma[of[size]]
