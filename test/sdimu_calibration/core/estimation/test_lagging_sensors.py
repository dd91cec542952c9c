"""Sensors that lag behind the thermometer: what follows the temperature shows a part that follows its rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.temperature import TemperatureProfile

SITE = Site(latitude_rad=float(np.radians(36.4)))
LAG_S = 30.0
COEFFICIENTS = {"gyro_bias_temperature_z": (0.2, "deg/h/degC"), "accel_bias_temperature_x": (60.0, "ug/degC")}
CYCLE = ((0.0, 10.0), (150.0, 10.0), (700.0, 35.0), (1000.0, 35.0), (1600.0, 5.0))


def test_a_lag_is_seen_as_a_rate_coefficient_of_minus_the_lag_times_the_temperature_coefficient():
    imu, plan = load_imu("dtg"), load_plan("kim18_signed")
    profile = TemperatureProfile(
        10.0, knots=CYCLE, reference_degc=20.0, sensor_lag_s=LAG_S, noise=0.02, resolution=0.01
    )
    recording, truth = generate(
        Scenario(
            replace(plan, dwell_s=(40.0,) * len(plan.dwell_s)),
            imu,
            SITE,
            rate_hz=20.0,
            seed=9,
            temperature=profile,
            effects=tuple(f"{name}={size} {unit}" for name, (size, unit) in COEFFICIENTS.items()),
        )
    )
    assert truth.reference_degc == 20.0
    assert recording.temperature.origin_degc == 20.0
    model = load_model("baseline")
    kinds = ("gyro_bias_temperature", "accel_bias_temperature")
    model = replace(model, effects=(*model.effects, *kinds, *(f"{kind}_rate" for kind in kinds)))
    found = solve(PreparedTest(recording, imu, SITE), model)
    sigma = dict(zip(found.names, np.sqrt(np.diag(found.covariance)), strict=True))
    value = dict(zip(found.names, found.values, strict=True))
    for name, (size, unit) in COEFFICIENTS.items():
        k = to_si(size, unit)
        rate = name.replace("_temperature_", "_temperature_rate_")
        bias = name.replace("_temperature_", "_")
        assert abs(value[name] - k) < 4.0 * sigma[name] + 3.0 * LAG_S / 600.0 * k
        # The transient after a knot is over in a few lags of the ten minutes to the next: a share of that.
        assert abs(value[rate] + k * LAG_S) < 4.0 * sigma[rate] + 3.0 * LAG_S / 600.0 * k * LAG_S
        assert k * LAG_S > 8.0 * sigma[rate]
        # Stated at the reference, as built.
        assert abs(value[bias] - truth.imu.coefficients[bias]) < 4.0 * sigma[bias]
