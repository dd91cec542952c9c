"""Soaks and a ramp: every polynomial of the temperature from one set, and what is true of a ramp."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.compensation.compensator import compensate_recording, compensator
from sdimu_calibration.core.effect_key import sized
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_sim.core.hidden import size_unit
from sdimu_sim.core.true_coefficients import POWERS, SEEN_OF_TURNS, true_coefficients
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.set_world import here, members_of, opened
from sdimu_study.soak_world import T0_DEGC, in_the_frame, noise_of, ramp
from sdimu_study.soaks import RATES, SOAK_KINDS, STUDY, drawn, errors, model_of, of_power_on, ratios, tables, with_lag

SEED = 3


def short(kind: str):
    """Draw a world whose soaks take twelve minutes, and whose ramp takes half an hour."""
    world = drawn((kind, "dtg"), SEED)
    plan = replace(world.plan, dwell_s=tuple(0.2 * dwell for dwell in world.plan.dwell_s))
    return replace(world, plan=plan, soaks_degc=(-40.0, 10.0, 70.0), rate_k_s=4.0 / 60.0)


@pytest.fixture(scope="module")
def fitted():
    world = short("soaks")
    scenarios = world.scenarios()
    tests = [opened(scenario) for scenario in scenarios]
    members = members_of(tests[:-1])
    result = set_outcome(fit_set(members, SetOptions(model_of("soaks")), here))
    return world, scenarios, tests, result, of_power_on(result, members[-1].name)


def test_every_polynomial_is_found_within_its_sigma(fitted):
    world, _, _, result, _ = fitted
    z = errors(result, world)
    # Thirty coefficients and two powers of each, less three turns of the frame in each; what the gyros see of two.
    assert len(z) == 3 * 27 + 6
    # A chi-square of 87 is this far from its mean once in a thousand sets.
    assert 0.75 < np.sqrt(np.mean(np.square(list(z.values())))) < 1.25
    assert np.abs(list(z.values())).max() < 4.5


def test_a_compensated_ramp_has_little_more_than_its_noise(fitted):
    _, scenarios, tests, _, own = fitted
    for scenario, test in zip(scenarios[-2:], tests[-2:], strict=True):
        assert max(ratios([own], scenario, test.recording)[0].values()) < 1.2


def without_noise(sensor_of, scenario, test):
    """RMS of what compensation leaves of samples free of noise, at rest and where the temperature's rate stands.

    In turns the noise of the thermometer counts, times coefficients of scale factors.
    """
    omega, force = in_the_frame(scenario)
    noise = noise_of(scenario, test.recording)
    clean = replace(
        test.recording, omega_ib_b=test.recording.omega_ib_b - noise[0], f_ib_b=test.recording.f_ib_b - noise[1]
    )
    done = compensate_recording(compensator(sensor_of, scenario.imu, has_temperature=True), clean)
    corners = np.array(scenario.temperature.knots)[1:, 0]
    still = np.abs(omega).max(axis=1) < 1e-3
    # The estimator takes the rate as its mean over a minute.
    still &= np.abs(test.recording.t[:, None] - corners).min(axis=1) > 60.0
    assert np.mean(still) > 0.3
    return tuple(float(np.sqrt(np.mean(left[still] ** 2))) for left in (done.omega_ib_b - omega, done.f_ib_b - force))


def test_the_truth_compensates_a_ramp_with_axes_that_bend(fitted):
    """What the gyros see of a frame that turns with the square of the temperature stands in the model."""
    world, scenarios, tests, result, _ = fitted
    scenario, test = scenarios[-1], tests[-1]
    truth = true_coefficients(world.unit.sensor(world.effects), result.body_frame)
    truth |= {name: value for name, value in scenario.coefficients.items() if "bias" in name}
    whole = replace(result, values=np.array([truth.get(name, 0.0) for name in result.names]))
    bent = [name.startswith(SEEN_OF_TURNS[1]) for name in result.names]
    less = replace(whole, values=np.where(bent, 0.0, whole.values))
    # White noise of 0.1 deg/h/sqrt(Hz) over the whole ramp is 1e-8 rad/s; of the force 2e-6 m/s^2.
    rate, force = without_noise(whole, scenario, test)
    assert rate < 1e-8
    assert force < 2e-5
    assert without_noise(less, scenario, test)[0] > 1e-7


def test_a_lag_shows_as_rate_terms():
    """What a lagging sensor reads late in a ramp is what its rate terms say."""
    sizes = {f"accel_bias_{POWERS[0]}_y": 3e-5, f"accel_bias_{POWERS[1]}_y": 2e-7, "accel_scale_temperature_x": 4e-6}
    shown = {name: size_unit(name) for name in sizes}
    truth = ImuTruth(effects=tuple(sized(name, size, shown[name]) for name, size in sizes.items()))
    lag, rate, above = 40.0, 1.0 / 30.0, 20.0
    profile = replace(ramp(-40.0, 70.0, rate, lag), reference_degc=T0_DEGC)
    at = (above + T0_DEGC + 40.0) / rate + 300.0
    behind = profile.sensor_value(np.array([at]))[0] - T0_DEGC
    found = with_lag(truth, "prior", lag)
    k, square, of_rate, linear = (found[f"accel_bias_{word}_y"] for word in (*POWERS[:2], *RATES))
    # Beyond it is the square of what the sensor lags, 1.3 K.
    expected = k * behind + square * behind**2 - square * (lag * rate) ** 2
    assert k * above + square * above**2 + (of_rate + linear * above) * rate == pytest.approx(expected, rel=1e-9)
    assert found["accel_scale_temperature_rate_x"] == pytest.approx(-lag * 4e-6)


def test_tables_sort_coefficients_by_power_and_kind():
    ratio = {"gyro": 1.0, "accel": 1.1}
    row = {
        "z": {
            "gyro_bias_x": 2.0,
            "accel_scale_temperature_y": 1.0,
            "gyro_bias_temperature_rate_z": 4.0,
            "gyro_misalignment_temperature_squared_xy": 3.0,
        },
        "scatter": [{"low": 1.0, "high": 2.0, "true": 1.5}],
        "ramp": ratio,
        "other_ramp": ratio,
        "mean_bias": ratio,
    }
    first, second = tables("soaks", [row, {"seed": 4, "error": "no"}])
    assert dict(first.lines)["sets"] == "1 of 2"
    assert dict(first.lines)["true scatter inside its interval"] == "1 of 1"
    cells = {line[0]: tuple(line[1:]) for line in second.lines}
    assert cells["all"] == ("2.00", "1.00", "3.00", "", "4.00")
    assert cells["gyro_bias"] == ("2.00", "", "", "", "4.00")
    assert cells["gyro_misalignment"] == ("", "", "3.00", "", "")


@pytest.mark.slow
@pytest.mark.parametrize("kind", SOAK_KINDS[:1])
def test_five_soaks_and_a_ramp_hold_their_sigmas_over_units_sites_and_plans(kind):
    rows = [STUDY.of((kind, "dtg"))(seed) for seed in range(73_001, 73_009)]
    z = np.array([value for row in rows for value in row["z"].values()])
    assert 0.85 < np.sqrt(np.mean(z**2)) < 1.15
    assert all(max(row["ramp"].values()) <= 1.2 for row in rows)
