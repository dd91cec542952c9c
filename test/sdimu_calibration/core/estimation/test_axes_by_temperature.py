"""Axes that turn with the temperature: every estimator gives the truth in the accelerometers' frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import TemperatureLog
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_sim.core.true_coefficients import true_coefficients

SITE = Site(latitude_rad=float(np.radians(36.4)))
TURNING = ("gyro_misalignment_temperature", "accel_misalignment_temperature")
EFFECTS = (
    "accel_misalignment_temperature_xy=9 arcsec/degC",
    "accel_misalignment_temperature_yz=-14 arcsec/degC",
    "accel_misalignment_temperature_zx=11 arcsec/degC",
    "gyro_misalignment_temperature_xz=-12 arcsec/degC",
    "gyro_misalignment_temperature_zy=8 arcsec/degC",
)


@pytest.mark.parametrize(
    ("imu", "estimator"), [("dtg", "filter"), ("mems_industrial", "filter"), ("mems_industrial", "batch")]
)
def test_a_ramp_gives_the_axes_of_every_temperature(imu, estimator):
    imu = load_imu(imu)
    plan = load_plan("kim18_signed")
    recording, truth = generate(
        Scenario(
            replace(plan, dwell_s=(40.0,) * len(plan.dwell_s)),
            imu,
            SITE,
            rate_hz=20.0,
            seed=5,
            effects=EFFECTS,
            temperature=TemperatureProfile(rise=60.0, tau_s=1000.0),
        )
    )
    model = load_model("baseline")
    # Gyros that see 0.01 deg/h see the case turn, unless their bias may follow the rate of the temperature.
    model = replace(model, effects=(*model.effects, *TURNING, "gyro_bias_temperature_rate"))
    found = outcome(solve(PreparedTest(recording, imu, SITE), model, estimator), held_out=False)
    assert found.body_frame == "accelerometer_triad"
    true = true_coefficients(truth.imu, found.body_frame)
    sigma = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    pinned = body_frame.pinned_in(found.names)
    assert len(pinned) == 6
    error = np.array([found.values[i] - true[name] for i, name in enumerate(found.names)])
    free = np.array([name not in pinned for name in found.names])
    z = error[free] / sigma[free]
    assert np.abs(z).max() < 4.0
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.4
    assert np.all(sigma[~free] < 1e-9)
    rows = [i for i, name in enumerate(found.names) if name.startswith(TURNING) and free[i]]
    assert np.abs(found.values[rows] / sigma[rows]).max() > 10.0


def test_a_run_by_hand_pins_the_same():
    imu = load_imu("mems_by_hand")
    recording = by_hand_recording(ByHand(24, imu, SITE, seed=71))[0]
    t = np.arange(0.0, recording.t[-1], 5.0)
    recording = replace(recording, temperature=TemperatureLog(t, 25.0 + 0.02 * t))
    model = load_model("hand")
    model = replace(model, effects=(*model.effects, *TURNING))
    found = outcome(solve(PreparedTest(recording, imu, None), model, "handheld"), held_out=False)
    sigma = dict(zip(found.names, np.sqrt(np.diag(found.covariance)), strict=True))
    pinned = body_frame.pinned_in(found.names)
    assert len(pinned) == 6
    assert all(sigma[name] == 0.0 for name in pinned)
    free = [n for n in found.names if n.startswith(TURNING) and n not in pinned]
    assert all(0.0 < sigma[name] < 1e-3 for name in free)
